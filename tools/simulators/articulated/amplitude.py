"""Sizes effects: the level of an effect is what it leaves in the outputs, in noise sigmas, after the robot is fitted again.

With e the outputs' change in sigmas and B their change for one tolerance of each uncertain number (differences of the simulator, at
twice and four times the usual step, which is the same on both sides of a difference; B has neither friction nor stops):

    level = sqrt(mean((e - B a)^2)),    a = argmin |e - B a|,    |built + a| <= 2.5 standard deviations of the description

B is reduced once, B = Q R, and each fit is one of R a = Q^T e. Measured on every fourth trial, which carries the
day's mixture, at 50 Hz.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from tools.simulators.articulated.bench import channels, observe
from tools.simulators.articulated.dynamics import STEP
from tools.simulators.articulated.effects import Effect
from tools.simulators.articulated.robots import Robot, built
from tools.simulators.articulated.trials import Day

WITHIN = 2.5  # standard deviations of the description that a fit may use
CLOSE = 0.03  # relative error of a level that is good enough
THIN = 4  # one trial in so many
ROWS = 50  # a second
ROUNDS = 12


class Scale:
    """Measures levels on one built robot and day; `deviations` are those of the built robot."""

    def __init__(self, described: Robot, deviations: np.ndarray, day: Day) -> None:
        self.robot = built(described, deviations)
        self.trials = day.measured[::THIN]
        listed = channels(described, day.camera)
        self.names = [c.name for c in listed if not c.name.endswith("_y")]
        self.silent = sum(c.name.endswith("_y") for c in listed)  # outputs that never change count as well
        self.sigmas = np.array([described.instruments[c.instrument].sigma for c in listed if not c.name.endswith("_y")])
        self.clean = self._outputs(self.robot, [], 2.0 * STEP)
        coarse, moves = self._outputs(self.robot, [], 4.0 * STEP), []
        for i in range(len(deviations)):
            up = 0.5 if deviations[i] < 0.0 else -0.5
            other = deviations.copy()
            other[i] += up
            moves.append((self._outputs(built(described, other), [], 4.0 * STEP) - coarse) / up)
        self.q, self.r = np.linalg.qr(np.column_stack(moves))
        self.bounds = (-WITHIN - deviations, WITHIN - deviations)

    def _outputs(self, robot: Robot, effects: Sequence[Effect], step: float) -> np.ndarray:
        logs = [(observe(robot, effects, trial, step), trial.rate // ROWS) for trial in self.trials]
        stacked = [np.column_stack([log[name][::every] for name in self.names]) / self.sigmas for log, every in logs]
        return np.concatenate(stacked).ravel()

    def levels(self, effects: Sequence[Effect]) -> tuple[float, float]:
        """Return what effects change in sigmas before and after the fit."""
        change = self._outputs(self.robot, effects, 2.0 * STEP) - self.clean
        target = self.q.T @ change
        fitted = lsq_linear(self.r, target, self.bounds).x
        left = np.sum((target - self.r @ fitted) ** 2) + max(np.sum(change**2) - np.sum(target**2), 0.0)
        count = len(change) * (len(self.names) + self.silent) / len(self.names)
        return float(np.sqrt(np.sum(change**2) / count)), float(np.sqrt(left / count))


def scaled(effect: Effect, wanted: float, scale: Scale) -> tuple[Effect, float]:
    """Return the effect at the strength that leaves `wanted` sigmas, and what it leaves; at its `most` if that is not enough."""
    low, high = 0.0, np.inf
    at_low, strength, best = 0.0, min(effect.strength, effect.most), (0.0, 0.0)
    for _ in range(ROUNDS):
        try:
            found = scale.levels([replace(effect, strength=strength)])[1]
        except ArithmeticError:  # too stiff for the step: less of it
            found = np.inf
        if abs(found - wanted) < abs(best[1] - wanted):
            best = (strength, found)
        if abs(found - wanted) < CLOSE * wanted or (found < wanted and strength >= effect.most):
            break
        if found < wanted:
            slope = np.log(found / at_low) / np.log(strength / low) if at_low > 0.0 and found > at_low else 1.0
            low, at_low = strength, found
        else:
            slope, high = 1.0, strength
        guess = strength * (wanted / max(found, 1e-3 * wanted)) ** (1.0 / np.clip(slope, 0.5, 3.0))
        guess = float(np.clip(guess, 0.1 * strength, 5.0 * strength))
        if not low < guess < high:
            guess = 0.5 * (low + high)
        strength = float(min(guess, effect.most))
    return replace(effect, strength=best[0]), best[1]
