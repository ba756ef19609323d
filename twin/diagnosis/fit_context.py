"""The fit context: what every stage works on, how candidates are compared, and where progress is reported."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from twin.body import Drive
from twin.diagnosis.budget import Budget
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.objective import Objective
from twin.diagnosis.evidence.discrepancy import Evidence
from twin.diagnosis.noise.transmission import transmitted_noise
from twin.diagnosis.noise.whitening import SLACK_READING
from twin.foundation.parameters import parameter_array
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording

Progress = Callable[[str], None]


def silent(words: str) -> None:
    """Report no progress."""


@dataclass(frozen=True)
class FitContext:
    """The objective of the fitted trials, and the evidence of named effects against an unnamed smooth error.

    The prepared recording holds every trial's inputs, for a body with memory, but the measurements of the fitted trials only.
    """

    objective: Objective
    evidence: Evidence
    progress: Progress = silent
    budget: Budget = field(default_factory=Budget)

    def unwhitened(self, fit: Fit) -> np.ndarray:
        """Return the residual in sigmas of its sensors, not whitened (n,); zero where nothing was measured."""
        return np.concatenate([np.nan_to_num(r / self.objective.whitener.noise.sigma).ravel() for r in fit.evaluation.raw])

    def blocked_input_noise(self, fit: Fit) -> float:
        """Return the input noise, in |z|^2 of the fitted trials, that the fitted effects keep from the robot.

        An effect blocks input noise by averaging it (`transmitted_noise`), by making a tendon slack, or by bringing its tension so
        near to zero that the noise is clipped (`SLACK_READING`).
        """
        traces, whitener, prepared = fit.evaluation.traces, self.objective.whitener, self.prepared
        drive = whitener.noise.drive
        near = np.where(prepared.driven_by(Drive.TENSION), SLACK_READING * drive, 0.0) if not prepared.pushes else -np.inf
        blocked = 0.0
        for k, energy in zip(self.trials, whitener.input_noise_energy, strict=True):
            true = traces[k].true
            transmitted = np.where(
                true.tension <= near, 0.0, transmitted_noise(fit.model.twin, prepared.inputs[k], drive, true.antagonists)
            )
            blocked += float((energy * (1.0 - transmitted)).sum())
        return blocked

    def fall_by_group(self, before: Fit, after: Fit) -> np.ndarray:
        """Return the fall of |z|^2 from `before` to `after` (n_group,), by group of outputs in their order."""
        of = [o.group for o in self.prepared.outputs]
        z = (before.z**2 - after.z**2).reshape(-1, len(of)).sum(axis=0)
        return np.array([z[[o == g for o in of]].sum() for g in dict.fromkeys(of)])

    @property
    def accuracy(self) -> np.ndarray:
        """The declared accuracy of the description (m,), in sigmas of each output; zero where none is declared."""
        return stated_accuracy(self.prepared) / self.objective.whitener.noise.sigma

    @property
    def excused(self) -> np.ndarray:
        """The share of |z|^2 (n_group,) that errors of the description may explain in each group.

        Infinite where no accuracy is declared.
        """
        of = np.array([o.group for o in self.prepared.outputs])
        each_output = self.evidence.present.sum(axis=0) * self.accuracy**2
        return np.array([total if (total := each_output[of == g].sum()) > 0.0 else np.inf for g in dict.fromkeys(of)])

    @property
    def prepared(self) -> PreparedRecording:
        return self.objective.prepared

    @property
    def trials(self) -> list[int]:
        return self.objective.trials


def stated_accuracy(prepared: PreparedRecording) -> np.ndarray:
    """Return the declared accuracy of the description for each output (m,), SI; zero where none is declared."""
    robot, outputs = prepared.robot, prepared.outputs
    stated = np.array([robot.accuracy if OUTPUT_GROUPS[o.group].has_declared_accuracy else 0.0 for o in outputs])
    values = {p.name: p.value for p in robot.parameters}
    if (strain := values.get("sensors.accuracy", 0.0)) > 0.0:  # dR = 2 R0 d(strain), kappa being about 1
        rest = parameter_array(values, "sensors.resistance", int(str(robot.structure["sensors"])))
        stated += [2.0 * rest[o.index] * strain if o.group == "sensor" else 0.0 for o in outputs]
    return stated
