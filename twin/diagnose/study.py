"""What every stage works on: the fitted trials, what they are compared by, and whom to tell how far things are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from twin.bench import Bench
from twin.calibrate import Fit, Objective
from twin.diagnose.budget import Budget
from twin.diagnose.evidence import Evidence
from twin.diagnose.passed import passed
from twin.effects import Drive
from twin.evaluate import ACCURATE
from twin.quantities import each
from twin.whitener import SILENT

Progress = Callable[[str], None]


def silent(words: str) -> None:
    """Nobody is told."""


@dataclass(frozen=True)
class Study:
    """White residuals of the fitted trials, and named effects against "some smooth error" on them.

    The bench holds every trial's inputs, for a body that remembers, and the fitted trials' measurements alone.
    """

    objective: Objective
    evidence: Evidence
    progress: Progress = silent
    budget: Budget = field(default_factory=Budget)

    def plain(self, fit: Fit) -> np.ndarray:
        """The residual in sigmas of its sensors, not made white (n,); zero where nothing was measured."""
        return np.concatenate([np.nan_to_num(r / self.objective.whitener.noise.sigma).ravel() for r in fit.evaluation.raw])

    def unheard(self, fit: Fit) -> float:
        """What the fitted trials' |z|^2 lacks of the readings' noise (`Whitener.heard`): the law averages it away (`passed`), or
        lets tendons fall slack, or so near it that noise is cut off there (`SILENT`)."""
        traces, whitener, bench = fit.evaluation.traces, self.objective.whitener, self.bench
        drive = whitener.noise.drive
        near = np.where(bench.driven_by(Drive.TENSION), SILENT * drive, 0.0)
        lacking = 0.0
        for k, heard in zip(self.trials, whitener.heard, strict=True):
            true = traces[k].true
            felt = np.where(true.tension <= near, 0.0, passed(fit.model.twin, bench.inputs[k], drive, true.antagonists))
            lacking += float((heard * (1.0 - felt)).sum())
        return lacking

    def fall(self, before: Fit, after: Fit) -> np.ndarray:
        """(n_group,) by how much |z|^2 is less after, in each group of outputs in the order in which they come."""
        of = [o.group for o in self.bench.outputs]
        z = (before.z**2 - after.z**2).reshape(-1, len(of)).sum(axis=0)
        return np.array([z[[o == g for o in of]].sum() for g in dict.fromkeys(of)])

    @property
    def accuracy(self) -> np.ndarray:
        """What the robot's description is good for (m,), sigmas of each output that it is declared for; zero for the others."""
        robot, outputs = self.bench.robot, self.bench.outputs
        stated = np.array([robot.accuracy if o.group in ACCURATE else 0.0 for o in outputs])
        values = {p.name: p.value for p in robot.parameters}
        if (strain := values.get("sensors.accuracy", 0.0)) > 0.0:  # dR = 2 R0 d(strain), kappa being about 1
            rest = each(values, "sensors.resistance", int(str(robot.structure["sensors"])))
            stated += [2.0 * rest[o.index] * strain if o.group == "sensor" else 0.0 for o in outputs]
        return stated / self.objective.whitener.noise.sigma

    @property
    def excused(self) -> np.ndarray:
        """(n_group,) of |z|^2 that what the description gets wrong can take of each group; without end where none is declared."""
        of = np.array([o.group for o in self.bench.outputs])
        each_output = self.evidence.present.sum(axis=0) * self.accuracy**2
        return np.array([total if (total := each_output[of == g].sum()) > 0.0 else np.inf for g in dict.fromkeys(of)])

    @property
    def bench(self) -> Bench:
        return self.objective.bench

    @property
    def trials(self) -> list[int]:
        return self.objective.trials
