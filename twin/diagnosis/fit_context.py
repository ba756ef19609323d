"""What every stage works on: the fitted trials, what they are compared by, and whom to tell how far things are."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from twin.body import Drive
from twin.diagnosis.budget import Budget
from twin.diagnosis.calibration.fit import Fit, Objective
from twin.diagnosis.evidence.discrepancy import Evidence
from twin.diagnosis.noise.transmission import transmitted_noise
from twin.diagnosis.noise.whitening import SLACK_READING
from twin.foundation.parameters import parameter_array
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording

Progress = Callable[[str], None]


def silent(words: str) -> None:
    """Nobody is told."""


@dataclass(frozen=True)
class FitContext:
    """White residuals of the fitted trials, and named effects against "some smooth error" on them.

    The bench holds every trial's inputs, for a body that remembers, and the fitted trials' measurements alone.
    """

    objective: Objective
    evidence: Evidence
    progress: Progress = silent
    budget: Budget = field(default_factory=Budget)

    def unwhitened(self, fit: Fit) -> np.ndarray:
        """The residual in sigmas of its sensors, not made white (n,); zero where nothing was measured."""
        return np.concatenate([np.nan_to_num(r / self.objective.whitener.noise.sigma).ravel() for r in fit.evaluation.raw])

    def blocked_input_noise(self, fit: Fit) -> float:
        """What the fitted trials' |z|^2 lacks of the readings' noise (`Whitener.heard`): the law averages it away (`passed`), or
        lets tendons fall slack, or so near it that noise is cut off there (`SLACK_READING`)."""
        traces, whitener, prepared = fit.evaluation.traces, self.objective.whitener, self.prepared
        drive = whitener.noise.drive
        near = np.where(prepared.driven_by(Drive.TENSION), SLACK_READING * drive, 0.0)
        lacking = 0.0
        for k, heard in zip(self.trials, whitener.input_noise_energy, strict=True):
            true = traces[k].true
            felt = np.where(
                true.tension <= near, 0.0, transmitted_noise(fit.model.twin, prepared.inputs[k], drive, true.antagonists)
            )
            lacking += float((heard * (1.0 - felt)).sum())
        return lacking

    def fall_by_group(self, before: Fit, after: Fit) -> np.ndarray:
        """(n_group,) by how much |z|^2 is less after, in each group of outputs in the order in which they come."""
        of = [o.group for o in self.prepared.outputs]
        z = (before.z**2 - after.z**2).reshape(-1, len(of)).sum(axis=0)
        return np.array([z[[o == g for o in of]].sum() for g in dict.fromkeys(of)])

    @property
    def accuracy(self) -> np.ndarray:
        """What the robot's description is good for (m,), sigmas of each output that it is declared for; zero for the others."""
        robot, outputs = self.prepared.robot, self.prepared.outputs
        stated = np.array([robot.accuracy if OUTPUT_GROUPS[o.group].has_declared_accuracy else 0.0 for o in outputs])
        values = {p.name: p.value for p in robot.parameters}
        if (strain := values.get("sensors.accuracy", 0.0)) > 0.0:  # dR = 2 R0 d(strain), kappa being about 1
            rest = parameter_array(values, "sensors.resistance", int(str(robot.structure["sensors"])))
            stated += [2.0 * rest[o.index] * strain if o.group == "sensor" else 0.0 for o in outputs]
        return stated / self.objective.whitener.noise.sigma

    @property
    def excused(self) -> np.ndarray:
        """(n_group,) of |z|^2 that what the description gets wrong can take of each group; without end where none is declared."""
        of = np.array([o.group for o in self.prepared.outputs])
        each_output = self.evidence.present.sum(axis=0) * self.accuracy**2
        return np.array([total if (total := each_output[of == g].sum()) > 0.0 else np.inf for g in dict.fromkeys(of)])

    @property
    def prepared(self) -> PreparedRecording:
        return self.objective.prepared

    @property
    def trials(self) -> list[int]:
        return self.objective.trials
