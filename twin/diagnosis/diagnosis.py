"""The result of a diagnosis: the types that reports are made from."""

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
    """The settings of a diagnosis.

    `seed`: of the split and of the simulated sets without effects. `jobs`: worker threads. `budget`: time limit (s) for trying sets
    of effects; with a limit the answer depends on the speed of the machine.
    """

    seed: int = 0
    jobs: int = 2
    budget: float | None = None


@dataclass(frozen=True)
class Claim:
    """A claimed effect or a runner-up, with its parameters and its probability.

    `error` is the RMS error on held-out trials: without the effect for a claim, with it for a runner-up.
    """

    effect: str
    parameters: dict[str, FittedValue]
    error: float
    probability: float
    contribution: float = 0.0  # sigma: how far dropping it moves the fitted trials
    beside: tuple[str, ...] = ()  # the other effects of the set a runner-up was fitted in


@dataclass(frozen=True)
class Missed:
    """A held-out trial that the final twin misses, by the outputs that show it most: its RMS error and the noise floor, SI."""

    trial: int
    group: str
    error: float
    floor: float


@dataclass(frozen=True)
class Errors:
    """RMS errors on the held-out trials, SI, by group of outputs (points: Euclidean per point).

    `ci_*`: confidence intervals over trials. `without_physics`: error of a polynomial of the inputs (`predict_by_polynomial`).
    `lost`: held-out trials for which one of the three twins has no equilibrium; they are left out of every error. `spikes`: samples
    left out of the other trials, in words. `missed`: trials that noise and the description do not explain.
    """

    nominal: dict[str, float]
    calibrated: dict[str, float]
    after: dict[str, float]
    floor: dict[str, float]
    ci_calibrated: dict[str, tuple[float, float]]
    ci_after: dict[str, tuple[float, float]]
    without_physics: dict[str, float] = field(default_factory=dict)
    lost: tuple[int, ...] = ()
    spikes: tuple[str, ...] = ()
    missed: tuple[Missed, ...] = ()

    @property
    def improved(self) -> bool:
        """Whether the effects reduce the error, summed over groups in units of the noise floor.

        True where the errors cannot be compared.
        """
        groups = [g for g, floor in self.floor.items() if floor > 0.0]
        before, after = (sum((e[g] / self.floor[g]) ** 2 for g in groups) for e in (self.calibrated, self.after))
        return not after >= before


@dataclass(frozen=True)
class Fold:
    """The conclusion from all trials but one, which was held out."""

    trial: int
    verdict: str
    effects: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything that a report shows.

    Residuals are measured - predicted (n_k, n_output) SI, by stage, all trials in clock order.
    """

    verdict: str
    twin: Twin
    calibrated: Twin
    claims: tuple[Claim, ...]
    runners_up: tuple[Claim, ...]
    below_materiality: tuple[Claim, ...]
    # The robot's own; as "effect.parameter" the uncertain ones of effects that the robot is known to have.
    parameters: dict[str, FittedValue]
    unfixed: tuple[str, ...]
    correlation: tuple[tuple[str, ...], np.ndarray]  # of the errors of the fitted parameters, with their labels
    errors: Errors
    noise: Noise
    structure_before: float  # sigma
    structure_after: float
    structure_unseen: float  # after, on left-out trials
    limits: AcceptanceLimits
    structure: dict[str, float]  # component -> RMS in sigmas, after
    strongest: tuple[tuple[str, float], ...]
    line: tuple[float, float]  # z-score, Hz
    worst_channel: str
    description: str
    caveats: tuple[str, ...]  # reasons to doubt the verdict
    identifiability: tuple[Visibility, ...]
    ambiguous: tuple[tuple[str, ...], ...]
    experiment: Experiment | None
    recording: Recording  # as it was read
    prepared: PreparedRecording  # as diagnosed
    fitted_trials: tuple[int, ...]
    held_out_trials: tuple[int, ...]  # all of them where each was held out in turn
    folds: tuple[Fold, ...]  # () where one part of the trials was held out once
    loops: Loops
    suspicions: tuple[Suspicion, ...]  # raised before any fit; no number depends on them
    predictions: dict[str, list[np.ndarray]]
    notices: tuple[str, ...]
    settings: Settings
    scores: tuple[tuple[tuple[str, ...], float], ...] = field(default=())
    untried: tuple[str, ...] = ()  # sets of effects that the time limit left untried

    def summary(self) -> str:
        """Return the verdict in one plain sentence, as in the report."""
        from twin import report

        return report.sentence(self)

    def save(self, folder: Path | str) -> None:
        """Write `folder`/report.html, report.json and twin.toml, all or none. Raise DataError where that fails."""
        from twin import report

        report.write(self, folder, report.provenance(self.recording, self.settings, "Diagnosis.save"))
