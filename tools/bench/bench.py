"""Runs a bench day on a built robot with its effects: true motion and noise-free logs of every trial.

Order of loads in a trial: straight and unloaded; gravity and payload in 4 steps; the first command in 12 or more; then
the log. The whole ramp takes RAMP seconds before the log's time zero. Slow states live on the day's clock.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tools.bench.design import Day, Trial
from tools.bench.effects import Effect, Situation
from tools.bench.rod import Creep, Rod, follow

RAMP = 2.0  # s
NODES = 3  # Gauss nodes per interval: within 3e-4 mm of the converged tip at full load
STRIDE = 0.25  # N, largest step of tension between two equilibria


@dataclass(frozen=True)
class Log:
    """One trial, free of noise; SI."""

    trial: Trial
    tension: np.ndarray  # (n, T) N, the logged input
    markers: np.ndarray  # (n, N, 3) m
    displacement: np.ndarray  # (n, T) m
    ambient: np.ndarray  # (n,) degC


def run(rod: Rod, effects: Sequence[Effect], day: Day, progress: Callable[[int], None] = lambda done: None) -> list[Log]:
    """All trials of the day, in the order of the clock."""
    logs: list[Log] = []
    delayed, rested = None, 0.0
    for n, trial in enumerate(day.trials):
        situation = Situation(rod, np.array(trial.gravity or day.gravity), trial.payload, trial.start)
        for effect in effects:
            effect.mount(situation)
        creep = None
        if situation.creep is not None:
            share, time = situation.creep
            if delayed is None:
                delayed = np.zeros((len(time), len(rod.pitch), NODES, 3))
            else:
                delayed *= np.exp(-max(0.0, trial.start - RAMP - rested) / time)[:, None, None, None]
            creep = Creep(share, time, delayed)
        logs.append(_run_trial(situation, effects, day, trial, creep))
        rested = trial.start + trial.time[-1]
        progress(n + 1)
    return logs


def _run_trial(situation: Situation, effects: Sequence[Effect], day: Day, trial: Trial, creep: Creep | None) -> Log:
    delivered = trial.command
    for effect in effects:
        delivered = effect.deliver(trial.fine, delivered)

    def at(time: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(time, trial.fine, column) for column in delivered.T], axis=1)

    seen = np.maximum(trial.time - situation.latency, 0.0)  # the moment a row's outputs show
    grid = np.union1d(np.union1d(trial.time, seen), _milestones(trial.fine, delivered))
    tension = at(grid)
    ramp = max(12, int(np.ceil(tension[0].max() / 0.1)))
    drive = np.concatenate([np.zeros((4, tension.shape[1])), tension[0] * np.arange(1, ramp + 1)[:, None] / ramp, tension[1:]])
    lead = 4 + ramp - 1
    dt = np.concatenate([np.full(lead + 1, RAMP / (lead + 1)), np.diff(grid)])
    clock = trial.start + np.concatenate([np.zeros(lead), grid])
    softness = np.ones(len(drive))
    for effect in effects:
        softness = softness * effect.soften(clock, day.ambient(clock))
    keep = np.concatenate([np.zeros(lead, bool), np.ones(len(grid), bool)])
    shape = follow(
        situation.rod,
        drive,
        gravity=situation.gravity,
        payload=situation.payload,
        weight=np.minimum(np.arange(1, len(drive) + 1) / 4, 1.0),
        softness=softness,
        dt=dt,
        mu=situation.mu,
        stroke=situation.stroke,
        creep=creep,
        fields=situation.fields,
        keep=keep,
        nodes=NODES,
    )
    displacement = shape.displacement
    for effect in effects:
        displacement = effect.encode(displacement, tension)
    rows = np.searchsorted(grid, seen)
    clock = trial.start + trial.time
    ambient = day.ambient(clock)
    markers = shape.markers[rows]
    for effect in effects:
        markers = effect.observe(clock, ambient, markers)
    reading = _logged_input(effects, trial, clock, tension[np.searchsorted(grid, trial.time)])
    return Log(trial, reading, markers, displacement[rows], ambient)


def _logged_input(effects: Sequence[Effect], trial: Trial, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
    if any(effect.logs_command for effect in effects):
        tension = np.stack([np.interp(trial.time, trial.fine, column) for column in trial.command.T], axis=1)
    for effect in effects:
        tension = effect.read(clock, tension)
    return tension


def _milestones(time: np.ndarray, tension: np.ndarray) -> np.ndarray:
    """Fine times at which some tension has changed by STRIDE since the last one."""
    marks, last = [], tension[0]
    for t, now in zip(time, tension, strict=True):
        if np.abs(now - last).max() > STRIDE:
            marks.append(t)
            last = now
    return np.array(marks)


def as_described(rod: Rod, logs: Sequence[Log], day: Day) -> list[Log]:
    """What the same built robot would log without any effect, driven by the logged inputs."""
    trials = tuple(replace(log.trial, fine=log.trial.time, command=np.maximum(log.tension, 0.0)) for log in logs)
    return run(rod, [], replace(day, trials=trials))
