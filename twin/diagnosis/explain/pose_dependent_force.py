"""A check of what is left for a tip force that depends on the tip's position: a magnet, a spring, a cable that drags.

It is no effect of the catalogue, since every such force has its own form. To first order in the tip's position,

    F(x) = f + G (x - mean x),

twelve numbers, whose effect on the white residual is C_a per newton along axis a, so that z ~ C_a (f_a + G_ab (x - mean x)_b) is
linear least squares beside the robot's own parameters. It is reported where it explains `TIP_FORCE_SHARE` of the smooth error, f
alone does not, and the evidence is `LEAST_EVIDENCE` after twelve numbers.
"""

from dataclasses import dataclass, replace

import numpy as np

from twin.body import Loads
from twin.diagnosis.calibration.model import Model, prior_weight
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import LEAST_EVIDENCE, PROBE_FORCE, TIP_FORCE_SHARE
from twin.effects.base.effect import Effect
from twin.foundation.parameters import Parameter


class TipForce(Effect):
    """A constant force on the tip, in the base frame."""

    id = "tip_force"
    parameters = tuple(Parameter(f"along_{a}", 0.0, "N", -10.0, 10.0, "of a difference", scale=PROBE_FORCE) for a in "xyz")
    moves_with = "nothing"

    def surround(self, loads: Loads) -> Loads:
        return replace(loads, force=loads.force + np.array([self[f"along_{a}"] for a in "xyz"]))


@dataclass(frozen=True)
class PoseDependentForce:
    """A tip force that depends on the tip's position.

    `share`: of the smooth error that it explains. `change` (N): the 90 % quantile of |F - mean F| over the fitted samples. Its
    direction is not reported: a force along an inextensible robot moves nothing.
    """

    share: float
    change: float

    def words(self) -> str:
        return (
            f" A force on the tip that changes with where the tip is, by some {1e3 * self.change:.2g} mN, would explain "
            f"{100 * self.share:.0f} % of it: a magnet, a spring, a cable that drags?"
        )


def pose_dependent_force(context: FitContext, final: ScoredModel) -> PoseDependentForce | None:
    """Return the tip force that would explain what `final` leaves.

    None where none would, or where the tip is not known.
    """
    body, fit, size = context.prepared.robot.build(), final.fit, final.discrepancy.size
    if "tip_x" not in body.senses or size == 0.0:
        return None
    at = body.senses["tip_x"].index
    tip = np.concatenate([fit.evaluation.traces[k].true.markers[:, at] for k in context.trials])
    twin, probe = fit.model.twin, PROBE_FORCE * context.prepared.robot.size.force
    pushed = [(Model(replace(twin, effects=(*twin.effects, TipForce({f"along_{a}": probe}))), ()), probe) for a in "xyz"]
    C = context.objective.columns(fit.evaluation, pushed, unsolved="zeros")
    away = tip - tip.mean(axis=0)
    rows = np.repeat(away, len(fit.z) // len(tip), axis=0)
    linear = (C[:, :, None] * rows[:, None, :]).reshape(len(C), -1)
    (constant, _), (whole, numbers) = (_taken(context, final, K) for K in (C, np.hstack([C, linear])))
    structure = size**2 * context.objective.n
    chance = len(numbers) * np.log(context.objective.n) + LEAST_EVIDENCE
    if whole < max(TIP_FORCE_SHARE * structure, chance) or constant >= TIP_FORCE_SHARE * structure:
        return None
    change = np.linalg.norm(away @ numbers[3:].reshape(3, 3).T, axis=1)
    return PoseDependentForce(min(1.0, whole / structure), float(np.quantile(change, 0.9)))


def _taken(context: FitContext, final: ScoredModel, K: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the fall of |z|^2, beside the robot's own parameters with their priors, and the numbers (p,) for columns K (n, p)."""
    J, z, k = final.fit.J, final.fit.z, final.fit.J.shape[1]
    scale = np.maximum(np.linalg.norm(K, axis=0), 1e-30)
    prior = np.zeros((k, k + K.shape[1]))
    prior[:, :k] = np.diag(prior_weight(final.fit.model))
    A, b = np.vstack([np.hstack([J, K / scale]), prior]), np.append(-z, np.zeros(k))
    without, both = (np.linalg.lstsq(M, b, rcond=1e-9)[0] for M in (A[:, :k], A))
    fall = float(((b - A[:, :k] @ without) ** 2).sum() - ((b - A @ both) ** 2).sum())
    return fall, both[k:] / scale
