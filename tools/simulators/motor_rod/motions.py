"""A day of motor-driven motions: bends along planned directions, as lengths that the described spools draw in.

A bend b = (b_x, b_y) rad of the whole rod shortens tendon i, at the angle psi_i on the hole circle of radius R, by R (b_x cos psi_i
+ b_y sin psi_i); antagonists then differ in sign alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tools.simulators.rod.design import Day, Trial

HOLE_CIRCLE = 8e-3  # m
FINE_RATE = 50.0  # Hz
LARGEST_BEND = 1.2  # rad
ROWS = (66, 80)  # of a trial, from and to
PAUSE = (15.0, 90.0)  # s between trials


def motor_day(angles: np.ndarray, rng: np.random.Generator) -> Day:
    """Draw a day for tendons at `angles` (T,) rad: slow and fast pulls, holds, wanderings, steps, payloads, one circle repeated."""
    hanging = rng.random() < 0.5
    sideways = tuple(float(g) for g in 9.81 * rng.choice([-1.0, 1.0]) * np.eye(3)[rng.integers(2)])
    trials = []
    for n in range(4):
        to = rng.uniform(0.8, 1.0) * LARGEST_BEND * _direction(0.5 * np.pi * n + rng.uniform(-0.2, 0.2))
        shape = np.array([0.0, 0.75, 0.35, 1.0, 0.55, 0.8, 0.2, 0.45, 0.0])
        trials.append(_trial(rng, f"slow_{n + 1}", 0.01 * (n % 3), shape[:, None] * to, 70.0))
        if n < 2:
            trials.append(_trial(rng, f"fast_{n + 1}", 0.0, -shape[:, None] * to, 9.0))
            trials.append(_trial(rng, f"hold_{n + 1}", 0.02 * n, np.array([[0, 0], *[1.0 * to] * 6, *[0.1 * to] * 4]), 90.0))
    for n, payload in enumerate((0.0, 0.01, 0.02, 0.0)):
        levels = rng.uniform(-0.75, 0.75, (11, 2)) * LARGEST_BEND
        trials.append(_trial(rng, f"wander_{n + 1}", payload, levels, 9.0 if n == 3 else 50.0))
    for n, payload in enumerate((0.0, 0.02)):
        levels = np.repeat(rng.uniform(-0.7, 0.7, (9, 2)) * LARGEST_BEND, 2, axis=0)
        trials.append(_trial(rng, f"steps_{n + 1}", payload, levels, 22.0))
    around = np.linspace(0.0, 3.0 * np.pi, 61)
    circle = _trial(rng, "circle", 0.01, 0.8 * LARGEST_BEND * np.stack([np.cos(around), np.sin(around)], axis=1), 40.0)
    order = [trials[n] for n in rng.permutation(len(trials))]
    for n in (2, 1, 0):
        order.insert(n * len(order) // 2, replace(circle, name=f"circle_{n + 1}"))
    clock, timed = 0.0, []
    for t in order:
        bend = t.command
        drawn = HOLE_CIRCLE * (bend[:, :1] * np.cos(angles) + bend[:, 1:] * np.sin(angles))
        timed.append(replace(t, start=round(clock, 1), command=drawn))
        clock += t.time[-1] + rng.uniform(*PAUSE)
    knots = np.linspace(0.0, clock, 9)
    room = np.stack([knots, 23.0 + rng.uniform(-2.0, 2.0) + rng.uniform(-4.0, 4.0, len(knots))])
    return Day(tuple(timed), (0.0, 0.0, 9.81) if hanging else sideways, room, driven_by_length=True)


def _direction(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle)])


def _trial(rng: np.random.Generator, name: str, payload: float, bends: np.ndarray, seconds: float) -> Trial:
    """A trial whose command is the bends (m, 2) rad so far, eased from level to level and begun at the straight robot."""
    levels = np.vstack([np.zeros((1, 2)), bends])
    when = np.linspace(0.0, seconds, len(levels))
    fine = np.linspace(0.0, seconds, int(np.ceil(seconds * FINE_RATE)) + 1)
    k = np.clip(np.searchsorted(when, fine, side="right") - 1, 0, len(when) - 2)
    x = 0.5 - 0.5 * np.cos(np.pi * (fine - when[k]) / (when[k + 1] - when[k]))
    rows = int(rng.integers(*ROWS))
    time = np.linspace(0.0, seconds, rows)
    time[1:-1] += rng.uniform(-0.15, 0.15, rows - 2) * seconds / (rows - 1)
    return Trial(name, payload, np.round(time, 4), fine, levels[k] + x[:, None] * (levels[k + 1] - levels[k]))
