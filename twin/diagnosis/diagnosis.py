"""What a diagnosis finds: the types that reports are made from."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from twin.diagnosis.checks.identifiability import Visibility
from twin.diagnosis.checks.loops import Loops
from twin.diagnosis.checks.suspicions.case import Suspicion
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.explain.next_experiment import Experiment
from twin.diagnosis.noise.model import Noise
from twin.foundation.parameters import FittedValue
from twin.measurements import Recording
from twin.prediction.prepared import PreparedRecording
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class Settings:
    """How a diagnosis is run: seed of the split and of the no-effect sets, worker threads, and for how long (s) sets of effects are
    tried; with an end to that the answer depends on the machine."""

    seed: int = 0
    jobs: int = 2
    budget: float | None = None


@dataclass(frozen=True)
class Claim:
    """An effect in force (or a runner-up): parameters, the sealed trials' error without it (or with it), its probability."""

    effect: str
    parameters: dict[str, FittedValue]
    error: float
    probability: float
    contribution: float = 0.0  # sigma: how far dropping it moves the fitted trials
    beside: tuple[str, ...] = ()  # the other effects of the set a runner-up was fitted in


@dataclass(frozen=True)
class Errors:
    """RMS on the sealed trials, SI, by group of outputs (points: Euclidean per point); confidence intervals over trials.

    `lost`: sealed trials that one of the three has no equilibrium for; they count for none. `spikes`: what was left out of the
    others, in words.
    """

    nominal: dict[str, float]
    calibrated: dict[str, float]
    after: dict[str, float]
    floor: dict[str, float]
    ci_calibrated: dict[str, tuple[float, float]]
    ci_after: dict[str, tuple[float, float]]
    lost: tuple[int, ...] = ()
    spikes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fold:
    """One trial sealed, the others diagnosed: what was concluded without it."""

    trial: int
    verdict: str
    effects: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything a report shows. Residuals are measured - predicted (n_k, n_output) SI, by stage, all trials in clock order."""

    verdict: str
    twin: Twin
    calibrated: Twin
    claims: tuple[Claim, ...]
    runners_up: tuple[Claim, ...]
    below_materiality: tuple[Claim, ...]
    parameters: dict[
        str, FittedValue
    ]  # the robot's own, and as "effect.parameter" what was uncertain of effects it is known to have
    unfixed: tuple[str, ...]
    correlation: tuple[tuple[str, ...], np.ndarray]  # of the errors of what was fitted, by its labels
    errors: Errors
    noise: Noise
    structure_before: float  # sigma
    structure_after: float
    structure_unseen: float  # after, on trials left out of the fit in turn
    limits: AcceptanceLimits
    structure: dict[str, float]  # component -> RMS in sigmas, after
    strongest: tuple[tuple[str, float], ...]
    line: tuple[float, float]  # z-score, Hz
    worst_channel: str
    description: str
    identifiability: tuple[Visibility, ...]
    ambiguous: tuple[tuple[str, ...], ...]
    experiment: Experiment | None
    recording: Recording  # as it was read
    prepared: PreparedRecording  # of it, what was diagnosed
    fitted_trials: tuple[int, ...]
    held_out_trials: tuple[int, ...]  # all, where each was sealed in turn
    folds: tuple[Fold, ...]  # () where one part of the trials was sealed once
    loops: Loops
    suspicions: tuple[Suspicion, ...]  # said before anything was fitted; no number depends on them
    predictions: dict[str, list[np.ndarray]]
    notices: tuple[str, ...]
    settings: Settings
    scores: tuple[tuple[tuple[str, ...], float], ...] = field(default=())
    untried: tuple[str, ...] = ()  # sets of effects for which the budget left no time

    def summary(self) -> str:
        """Return the verdict in one plain sentence, as the report has it."""
        from twin import report

        return report.sentence(self)

    def save(self, folder: Path | str) -> None:
        """Write `folder`/report.html, report.json and twin.toml, all or none. Raises DataError where it cannot."""
        from twin import report

        report.write(self, folder, report.provenance(self.recording, self.settings, "Diagnosis.save"))
