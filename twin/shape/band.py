"""How wide an estimator's band is to be under the hand that pushes, told by the clouds of alignment, without a label.

Bands are made for the factory's hands; how far an estimate is off depends on where, how wide and how many at once a hand presses,
which strains do not tell. The shape behind a cloud (`cloud_fit.py`) does. With a distance D of the two and a spread s beyond the
twin's own error o, c the cloud's own uncertainty, the band holds a point if it is widened by k or more,

    k = sqrt(max((D / 1.645)^2 - c^2 - o^2, 0)) / s,        widen = (90 % quantile of k)^w,    w = HANDS^2 / (HANDS^2 + ONE^2 / n)

w is the weight of what n pushes say against what is known without them: log k scatters by ONE from push to push, and hands differ
by HANDS from the factory's. That holds for what pushed then. What else may push, by the words of its trial's `external_contact`, is
a stranger, which may hold the finger as no hand of the factory's does; its band is widened by STRANGER.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from twin.shape.estimator import Z90, Estimator, Felt, Shapes, own_error

ONE = 0.75  # of log k of a single push: 0.37 of four pushes, measured on 70 chains of the factory with `physics`
HANDS = 0.4  # of log k: hands for which the band of the factory's is half as wide again as it should be are nothing strange; ours
PUSH = 3.0  # s that a push takes
STRANGER = 1.8  # 1.7 (`physics`, `modal` 1.8) hold 90 % where two edges up to 25 mm apart hold a slack finger, by the twin itself


@dataclass(frozen=True)
class Bands:
    """By how much the band of each estimator is widened under the hands that pushed in alignment, in the words of their trials."""

    by: Mapping[str, float] = field(default_factory=dict)
    hands: tuple[str, ...] = ()

    def of(self, law: Estimator, contact: str) -> float:
        return STRANGER if self.strange(contact) else self.by.get(law.name(), 1.0)

    def strange(self, contact: str | None) -> bool:
        """Whether this pushed in no alignment; never where nothing did. None: a push that nobody named."""
        return bool(self.hands) and contact not in self.hands


@dataclass(frozen=True)
class Behind:
    """What was felt at a trial's clouds, over how many seconds, and behind each cloud the points' displacements (f, P, 3) m and
    their standard deviations (f, P) m."""

    felt: Felt
    seconds: float
    moved: np.ndarray
    std: np.ndarray


def widened_by(law: Estimator, trials: Sequence[Behind]) -> float:
    """By how much this estimator's spread is to be widened under this hand."""
    loose = law.points.rest[:, 2] > law.body.cone.clamp
    needed = np.concatenate([_needed(law, trial)[:, loose] for trial in trials])
    pushes = sum(trial.seconds for trial in trials) / PUSH
    weight = HANDS**2 / (HANDS**2 + ONE**2 / max(pushes, 1.0))
    return float(max(np.quantile(needed, 0.9), 1e-3) ** weight)


def _needed(law: Estimator, trial: Behind) -> np.ndarray:
    """(f, P)."""
    found = law.estimate(trial.felt)
    apart = np.linalg.norm(found.moved - trial.moved, axis=2) / Z90
    spread, own = _parts(found)
    return np.sqrt(np.maximum(apart**2 - trial.std**2 - own**2, 0.0)) / spread


def widened(shapes: Shapes, by: float | np.ndarray) -> Shapes:
    """With the spread beyond the twin's own error widened, by the same everywhere or (n,)."""
    spread, own = _parts(shapes)
    by = np.reshape(by, (-1, 1))
    return replace(shapes, std=np.hypot(by * spread, own))


def _parts(shapes: Shapes) -> tuple[np.ndarray, np.ndarray]:
    """Spread and the twin's own error, (n, P) m."""
    own = own_error(shapes.moved)
    return np.sqrt(np.maximum(shapes.std**2 - own**2, 1e-14)), own
