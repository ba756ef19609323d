"""Fit the band width of an estimator under the contact of the alignment trials, from their clouds, without labels.

Bands are made for the training pushes; an estimate's error depends on where, how wide and at how many places a hand presses, which
strains do not show. The shape behind a cloud (`cloud_fit.py`) does. With a distance D between the two, a spread s beyond the twin's
own error o, and the cloud's own uncertainty c, the band holds a point if it is widened by k or more,

    k = sqrt(max((D / 1.645)^2 - c^2 - o^2, 0)) / s,        widen = (90 % quantile of k)^w,    w = H^2 / (H^2 + ONE^2 / n)

w weighs the information of n pushes: log k scatters by ONE (PUSH_SCATTER) from push to push, and hands differ by H (HAND_SCATTER)
from the training pushes. This holds for the contact of the alignment. A contact that its trial's `external_contact` names otherwise
may hold the finger in ways that no training push does; its band is widened by UNKNOWN_CONTACT_WIDENING.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from twin.shape.estimators.estimator import Z90, Estimator, SensorReadings, ShapeEstimates, twin_error

PUSH_SCATTER = 0.75  # of log k of a single push: 0.37 of four pushes, measured on 70 training chains with `physics`
HAND_SCATTER = 0.4  # of log k: a hand whose band should be half as wide again is an ordinary one; ours
PUSH_DURATION = 3.0  # s, of one push
UNKNOWN_CONTACT_WIDENING = 1.8  # 1.7 (`physics`; `modal` 1.8) holds 90 % of a slack finger between two edges up to 25 mm apart


@dataclass(frozen=True)
class BandWidening:
    """Band factors of each estimator under the contacts of the alignment, which are named as in their trials."""

    factors: Mapping[str, float] = field(default_factory=dict)
    known_contacts: tuple[str, ...] = ()

    def factor(self, estimator: Estimator, contact: str) -> float:
        """Return the factor of an estimator's band under this contact."""
        return UNKNOWN_CONTACT_WIDENING if self.is_unknown(contact) else self.factors.get(estimator.name(), 1.0)

    def is_unknown(self, contact: str | None) -> bool:
        """Return whether the alignment had no such contact; False if it had none at all. None: an undeclared contact."""
        return bool(self.known_contacts) and contact not in self.known_contacts


@dataclass(frozen=True)
class CloudReference:
    """Readings at a trial's clouds, over how many seconds, and the true points behind each cloud.

    `displacements` (f, P, 3) m of the points and their standard deviations `std` (f, P) m.
    """

    readings: SensorReadings
    seconds: float
    displacements: np.ndarray
    std: np.ndarray


def fit_widening(estimator: Estimator, trials: Sequence[CloudReference]) -> float:
    """Return the factor by which this estimator's spread is to be widened under this contact."""
    unclamped = estimator.points.rest[:, 2] > estimator.body.cone.clamp
    needed = np.concatenate([_required_widening(estimator, trial)[:, unclamped] for trial in trials])
    pushes = sum(trial.seconds for trial in trials) / PUSH_DURATION
    weight = HAND_SCATTER**2 / (HAND_SCATTER**2 + PUSH_SCATTER**2 / max(pushes, 1.0))
    return float(max(np.quantile(needed, 0.9), 1e-3) ** weight)


def _required_widening(estimator: Estimator, trial: CloudReference) -> np.ndarray:
    """Return the factor (f, P) that each point needs."""
    shapes = estimator.estimate(trial.readings)
    distance = np.linalg.norm(shapes.displacements - trial.displacements, axis=2) / Z90
    spread, own = _split_std(shapes)
    return np.sqrt(np.maximum(distance**2 - trial.std**2 - own**2, 0.0)) / spread


def widen_band(shapes: ShapeEstimates, factor: float | np.ndarray) -> ShapeEstimates:
    """Widen the spread beyond the twin's own error, by one factor or (n,)."""
    spread, own = _split_std(shapes)
    factor = np.reshape(factor, (-1, 1))
    return replace(shapes, std=np.hypot(factor * spread, own))


def _split_std(shapes: ShapeEstimates) -> tuple[np.ndarray, np.ndarray]:
    """Return the spread and the twin's own error, (n, P) m each."""
    own = twin_error(shapes.displacements)
    return np.sqrt(np.maximum(shapes.std**2 - own**2, 1e-14)), own
