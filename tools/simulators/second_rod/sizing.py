"""How large an effect is: what it does to the markers beyond what a refit of the robot's own parameters takes up.

The refit is linear about the true robot and bounded by nominal.md's tolerances. The unit is the noise of a marker's coordinate,
root mean square over all rows, disks and coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from tools.simulators.second_rod.day import Day
from tools.simulators.second_rod.effects import Effect
from tools.simulators.second_rod.mechanics.rod import INTERVALS
from tools.simulators.second_rod.mechanics.simulate import Run, simulate, without_effects

Array = np.ndarray
ROWS_SIZED = 25  # of each trial, where a robot that remembers nothing is sized
SIZE_ERROR = 0.12  # of the size asked for
FAIR = 0.35  # |log| of the ratio beyond which numbers are drawn anew: a direction that shows nothing
SIZING_TRIES, SIZING_DRAWS = 9, 4


@dataclass(frozen=True)
class Size:
    """In marker noises: before and after the refit, and how many equilibria were not found."""

    raw: float
    after_refit: float
    failures: int


class Sizer:
    """Sizes effects on one day."""

    def __init__(self, day: Day) -> None:
        self.day = day
        self.rows = [np.unique(np.linspace(0, trial.times.size - 1, ROWS_SIZED).astype(int)) for trial in day.trials]
        self.seen = np.array(day.markers) - 1
        robot = day.robot
        plain = simulate(day, rows=self.rows)
        # each step, and how many of them the tolerance allows
        steps = [
            (replace(robot, youngs_modulus=1.02 * robot.youngs_modulus), 9.0),
            (replace(robot, hole_radius=1.01 * robot.hole_radius), 3.0),
            (replace(robot, disk_mass=1.03 * robot.disk_mass), 2.5),
            (replace(robot, backbone_taper=robot.backbone_taper + 0.005), 2.0),
        ]
        columns = [self.apart(simulate(replace(day, robot=other), rows=self.rows), plain) for other, _ in steps]
        for disk in self.seen:
            offset = np.zeros((INTERVALS, 1))
            offset[disk] = 0.2e-3
            columns.append(np.concatenate([(offset * run.axes)[:, self.seen].ravel() for run in plain]))
        self.columns = np.array(columns).T
        self.bounds = np.array([*(limit for _, limit in steps), *(1.2 for _ in self.seen)])

    def apart(self, one: Sequence[Run], other: Sequence[Run]) -> Array:
        """Differences of the markers that the day has, at the rows for sizing, m."""
        out = []
        for a, b, rows in zip(one, other, self.rows, strict=True):
            moved = (a.positions - b.positions)[:, self.seen]
            out.append((moved if len(moved) == len(rows) else moved[rows]).ravel())
        return np.concatenate(out)

    def size(self, runs: Sequence[Run], plain: Sequence[Run]) -> Size:
        """Of what sets two runs of the day apart."""
        moved, noise = self.apart(runs, plain), self.day.marker_noise
        refit = lsq_linear(self.columns / noise, moved / noise, bounds=(-self.bounds, self.bounds))
        left = moved - self.columns @ refit.x
        failures = sum(run.failures for run in (*runs, *plain))
        return Size(float(np.sqrt(np.mean(moved**2)) / noise), float(np.sqrt(np.mean(left**2)) / noise), failures)

    def of(self, effect: Effect) -> Size:
        rows = None if effect.remembers else self.rows
        runs = simulate(self.day, [effect], rows)
        return self.size(runs, without_effects(self.day, runs, rows))

    def scaled(self, effect: Effect, target: float) -> tuple[Effect, Size]:
        """The effect at about the size asked for, or as near as it may come."""
        limit = effect.scale_limit()
        factor, best = min(1.0, 0.9 * limit), None
        below: tuple[float, float] | None = None  # factor and size
        above: tuple[float, float] | None = None
        for _ in range(SIZING_TRIES):
            tried = effect.scaled(factor)
            size = self.of(tried)
            reached = max(size.after_refit, 1e-6)
            if best is None or abs(np.log(reached / target)) < abs(np.log(best[1].after_refit / target)):
                best = tried, replace(size, after_refit=reached)
            if abs(reached / target - 1) < SIZE_ERROR or (reached < target and factor > 0.999 * limit):
                break
            if reached < target:
                below = factor, reached
            else:
                above = factor, reached
            if below and above:
                # a power law between the two, held off their ends; the middle where contact begins all at once
                power = np.log(above[0] / below[0]) / max(np.log(above[1] / below[1]), 1e-3)
                guess = below[0] * (target / below[1]) ** power
                middle = (below[0] + above[0]) / 2
                held = below[0] < guess < above[0] and effect.identifier != "contact"
                factor = float(guess) if held else middle
            else:
                step = target / reached
                low, high = (0.8, 1.3) if effect.identifier == "contact" else (0.25, 3.0)
                factor = min(factor * float(np.clip(step, low, high)), limit)
        assert best is not None
        return best

    def drawn(self, kind: type[Effect], target: float, random: np.random.Generator) -> tuple[Effect, Size]:
        """An effect of a kind at about the size asked for; drawn anew a few times where its numbers show too little."""

        def miss(found: tuple[Effect, Size]) -> float:
            return abs(float(np.log(found[1].after_refit / target)))

        found = []
        for _ in range(SIZING_DRAWS):
            found.append(self.scaled(kind.draw(random, self.day), target))
            if miss(found[-1]) < FAIR and found[-1][1].failures == 0:
                break
        return min(found, key=miss)
