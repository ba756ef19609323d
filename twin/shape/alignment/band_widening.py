"""Fit the band width of an estimator to the finger of an alignment, from its clouds, without labels.

Bands are made for training fingers, whose numbers are drawn and less well known than those of an aligned one, and for training
pushes. With a distance D between an estimate of spread s and a reference, a band holds a point if it is widened by r or more,

    free motion:  r = sqrt(D^2 + o^2) / (1.645 s)   the reference is the shape that tendons of known length make by the twin, which
                                                    has an error o of its own
    contact:      r = D / (1.645 sqrt(s^2 + c^2))   it is the shape behind a cloud (`cloud_fit.py`), itself uncertain by c

Free motion: errors of frames half a second apart hardly correlate (0.16), so the band is conformal. Of n frames the quantile
ceil(0.9 (n + 1)) / n of r holds 90 % of the points of a further frame.

Contact: an error depends on where, how wide and at how many places a hand presses, which strains do not show. It stays for a whole
push, and too few pushes are seen for a conformal band. Their quantile is weighed against the training pushes:

    widen = (90 % quantile of r)^w,    w = H^2 / (H^2 + ONE^2 / n)

w weighs the information of n pushes: log r scatters by ONE (PUSH_SCATTER) from push to push, and hands differ by H (HAND_SCATTER)
from the training pushes. This holds for the contact of the alignment. A contact that its trial's `external_contact` names otherwise
may hold the finger in ways that no training push does; its band is widened by UNKNOWN_CONTACT_WIDENING.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from twin.shape.estimators.estimator import Z90, Estimator, SensorReadings, ShapeEstimates, twin_error

HELD = 0.9  # of the points
PUSH_SCATTER = 0.75  # of log r of a single push: 0.37 of four pushes, measured on 70 training chains with `physics`
HAND_SCATTER = 0.4  # of log r: a hand whose band should be half as wide again is an ordinary one; ours
PUSH_DURATION = 3.0  # s, of one push
UNKNOWN_CONTACT_WIDENING = 1.8  # 1.7 (`physics`; `modal` 1.8) holds 90 % of a slack finger between two edges up to 25 mm apart


@dataclass(frozen=True)
class BandWidening:
    """Band factors of each estimator: in free motion, and under the contacts of the alignment, named as in their trials."""

    factors: Mapping[str, float] = field(default_factory=dict)
    known_contacts: tuple[str, ...] = ()
    free_factors: Mapping[str, float] = field(default_factory=dict)

    def free_factor(self, estimator: Estimator) -> float:
        """Return the factor of an estimator's band in free motion."""
        return self.free_factors.get(estimator.name(), 1.0)

    def factor(self, estimator: Estimator, contact: str) -> float:
        """Return the factor of an estimator's band under this contact."""
        return UNKNOWN_CONTACT_WIDENING if self.is_unknown(contact) else self.factors.get(estimator.name(), 1.0)

    def is_unknown(self, contact: str | None) -> bool:
        """Return whether the alignment had no such contact; False if it had none at all. None: an undeclared contact."""
        return bool(self.known_contacts) and contact not in self.known_contacts


@dataclass(frozen=True)
class ShapeReference:
    """Readings of some frames of a trial, over how many seconds, and the points there from tendons or clouds.

    `displacements` (f, P, 3) m of the points, by clouds where something pushes and else by tendons, and the clouds' standard
    deviations `std` (f, P) m.
    """

    readings: SensorReadings
    seconds: float
    displacements: np.ndarray
    std: np.ndarray


def fit_widening(estimator: Estimator, trials: Sequence[ShapeReference]) -> float:
    """Return the factor of this estimator's band under the contact of these trials."""
    needed = np.concatenate([_needed_widening(estimator, trial) for trial in trials])
    pushes = sum(trial.seconds for trial in trials) / PUSH_DURATION
    weight = HAND_SCATTER**2 / (HAND_SCATTER**2 + PUSH_SCATTER**2 / max(pushes, 1.0))
    return float(max(np.quantile(needed, HELD), 1e-3) ** weight)


def fit_free_widening(estimator: Estimator, trials: Sequence[ShapeReference]) -> float:
    """Return the conformal factor of this estimator's band in free motion; 1 for fewer frames than can hold 90 %."""
    needed = np.concatenate([_needed_widening(estimator, trial) for trial in trials])
    n = len(needed)
    rank = math.ceil(HELD * (n + 1))
    return float(max(np.quantile(needed, rank / n), 1e-3)) if rank <= n else 1.0


def _needed_widening(estimator: Estimator, trial: ShapeReference) -> np.ndarray:
    """Return the factor (f, P) that each point needs, without clamped points, which have no error."""
    shapes = estimator.estimate(trial.readings)
    distance = np.linalg.norm(shapes.displacements - trial.displacements, axis=2)
    if not trial.readings.pushed:
        distance = np.hypot(distance, twin_error(trial.displacements))
    needed = distance / (Z90 * np.hypot(shapes.std, trial.std))
    return needed[:, estimator.points.rest[:, 2] > estimator.body.cone.clamp]


def widen_band(shapes: ShapeEstimates, factor: float | np.ndarray) -> ShapeEstimates:
    """Widen the band by one factor or (n,), to no less than the twin's own error, which a shape by tendons has too."""
    return replace(shapes, std=np.maximum(np.reshape(factor, (-1, 1)) * shapes.std, twin_error(shapes.displacements)))
