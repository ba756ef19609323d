"""Estimators that are trained on the factory's shapes: their weights, how wide their band is, and what they know.

    std^2 = (widen spread)^2 + own^2,      `widen` (2, k, P): of each point, where something may press and where nothing does,
                                            at k mean displacements `levels` (2, k) m of the points, between these by straight lines

so that 1.645 widen spread holds 90 % of its places on held-out factory fingers, little and far deformed ones alike; own is the
error of the twin that made these. A strain pattern is outside what they know where its distance from the factory's patterns, a
Mahalanobis distance, is beyond all but one in a thousand of those.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.shape.estimator import Estimator, Felt, Shapes, own_error
from twin.shape.weights import read_weights
from twin.twin import Twin

if TYPE_CHECKING:
    from twin.shape.lesson import Data, Lesson


def level(moved: np.ndarray) -> np.ndarray:
    """Mean displacement (n,) m of points moved by (n, P, 3) m."""
    return np.linalg.norm(moved, axis=2).mean(axis=1)


def at_level(level: np.ndarray, levels: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(n, P) at levels (n,) of `values` (k, P) at rising `levels` (k,); beyond the last as at the last."""
    i = np.clip(np.searchsorted(levels, level) - 1, 0, len(levels) - 2)
    t = np.clip((level - levels[i]) / (levels[i + 1] - levels[i]), 0.0, 1.0)[:, None]
    return (1.0 - t) * values[i] + t * values[i + 1]


class Learned(Estimator):
    """Base of all estimators with weights. Remembers nothing."""

    unknown: str = ""  # what it does not know besides what every trained estimator does not

    def __init__(self, twin: Twin, arrays: dict[str, Any] | None = None) -> None:
        """`arrays`: weights other than those beside the robot. Raises DataError for a robot or weights that do not go together."""
        super().__init__(twin)
        self.arrays = read_weights(twin.robot.folder / self.file(), self.form()) if arrays is None else arrays

    @classmethod
    def file(cls) -> str:
        """Name of the weights' file beside robot.toml."""
        return f"{cls.name()}.npz"

    @classmethod
    def form(cls) -> str:
        return f"twin-{cls.name()}/3"

    @classmethod
    @abstractmethod
    def lesson(cls, data: Data) -> Lesson:
        """How its network is trained."""

    @abstractmethod
    def decode(self, felt: Felt) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (n, P, 3) m of the points and how widely (n, P) m they are spread, before it is widened."""

    def levels(self, felt: Felt) -> dict[str, float]:
        """More that it wants to know of held-out samples, by names in its weights' file."""
        return {}

    def estimate(self, felt: Felt) -> Shapes:
        moved, spread = self.decode(felt)
        row = 0 if felt.pushed else 1
        widen = at_level(level(moved), self.arrays["levels"][row], self.arrays["widen"][row])
        std = np.hypot(spread * widen, own_error(moved))
        return Shapes(moved, std, self._outside(felt))

    def _outside(self, felt: Felt) -> np.ndarray:
        """(n,) over the strains that are there, as these are spread whatever the others are."""
        x, covariance = felt.strain - self.arrays["known_mean"], np.linalg.inv(self.arrays["known_inverse"])
        there, far = np.isfinite(x), np.zeros(len(x))
        for some in np.unique(there, axis=0):
            rows = (there == some).all(axis=1)
            inverse, known = np.linalg.inv(covariance[np.ix_(some, some)]), x[rows][:, some]
            far[rows] = np.einsum("ni,ij,nj->n", known, inverse, known)
        return far > float(self.arrays["known_far"])


class Pointwise(Learned):
    """One that says nothing about its error itself: (share (n, 1) |moved|)^2 + rest^2 of `error`, as held-out fingers have it."""

    @abstractmethod
    def moved(self, felt: Felt) -> np.ndarray:
        """Displacements (n, P, 3) m of the points."""

    def decode(self, felt: Felt) -> tuple[np.ndarray, np.ndarray]:
        moved = self.moved(felt)
        moved[:, self.points.rest[:, 2] <= self.body.cone.clamp] = 0.0
        share, rest = self.arrays["error"]
        return moved, np.hypot(share * np.linalg.norm(moved, axis=2), rest)
