"""A check whether the trials come from one robot: two groups of trials with own values of the robot's parameters, against one.

To first order a group G of trials with own parameters reduces its |z|^2 by fall(G) = g'(sum J_k'J_k + P)^-1 g, g = sum J_k'z_k.
Trials change groups while the sum of both falls grows (a two-means search from several starts). Groups count only where a robot
could have been changed between them: one came after the other, or they differ in a condition.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from twin.diagnosis.calibration.fisher_information import solve
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.model import prior_weight
from twin.diagnosis.thresholds import FEWEST_TRIALS_IN_GROUP, GROUPING_ROUNDS, SECOND_ROBOT_GAIN
from twin.prediction.prepared import PreparedRecording


@dataclass(frozen=True)
class MixedRobots:
    """Two groups of trials (indices into the recording) that fit two robots.

    `fall`: the reduction of |z|^2 less the penalty for the second robot.
    """

    one: tuple[int, ...]
    other: tuple[int, ...]
    fall: float


def mixed_robots(prepared: PreparedRecording, trials: Sequence[int], fitted: Fit) -> MixedRobots | None:
    """Return the two groups, the larger first; None where one robot fits, or where the groups alternate.

    `fitted`: the fit to the listed trials, with its residuals in their order.
    """
    own = [i for i, f in enumerate(fitted.model.free) if f.effect is None]
    rows = np.concatenate([[0], np.cumsum([len(prepared.inputs[k].time) * len(prepared.outputs) for k in trials])])
    J, z = fitted.J[:, own], fitted.z.ravel()
    H = np.array([J[a:b].T @ J[a:b] for a, b in pairwise(rows)])
    g = np.array([J[a:b].T @ z[a:b] for a, b in pairwise(rows)])
    P = np.diag(prior_weight(fitted.model)[own] ** 2) + 1e-9 * np.eye(len(own))

    def shift(side: np.ndarray) -> np.ndarray:
        return solve(H[side].sum(axis=0) + P, g[side].sum(axis=0))

    def fall(side: np.ndarray) -> float:
        return float(g[side].sum(axis=0) @ shift(side))

    def costs(move: np.ndarray) -> np.ndarray:
        return np.einsum("i,kij,j->k", move, H, move) - 2.0 * g @ move

    best, sides = 0.0, None
    for seed in range(len(trials)):
        # Start from each trial in turn, with the half of the others that its own robot fits best.
        start = costs(solve(H[seed] + P, g[seed]))
        side = start <= np.median(start)
        for _ in range(GROUPING_ROUNDS):
            if not FEWEST_TRIALS_IN_GROUP <= side.sum() <= len(trials) - FEWEST_TRIALS_IN_GROUP:
                break
            again = costs(shift(side)) < costs(shift(~side))
            if (again == side).all():
                break
            side = again
        if (
            FEWEST_TRIALS_IN_GROUP <= side.sum() <= len(trials) - FEWEST_TRIALS_IN_GROUP
            and (gain := fall(side) + fall(~side)) > best
        ):
            best, sides = gain, side
    n = int(np.count_nonzero(z))
    # The penalty: as many parameters more, and a choice of group for every trial.
    worth = best - fall(np.ones(len(trials), bool)) - len(own) * np.log(n) - 2.0 * len(trials) * np.log(2.0)
    if sides is None or worth < SECOND_ROBOT_GAIN**2 * n:
        return None
    one, other = (tuple(trials[int(k)] for k in np.flatnonzero(s)) for s in (sides, ~sides))
    if not _separable(prepared, one, other):
        return None
    return MixedRobots(one, other, worth) if len(one) >= len(other) else MixedRobots(other, one, worth)


def _separable(prepared: PreparedRecording, one: Sequence[int], other: Sequence[int]) -> bool:
    """Return whether all trials of one group came before the other's, or no payload or no gravity is common to both."""
    clock = {k: float(prepared.inputs[k].clock[0]) for k in (*one, *other)}
    sides = [k in one for k in sorted(clock, key=lambda k: clock[k])]
    if sum(a != b for a, b in pairwise(sides)) == 1:
        return True
    loads = ({k: prepared.inputs[k].loads for k in group}.values() for group in (one, other))
    a, b = (({x.payload for x in of}, {tuple(x.gravity) for x in of}) for of in loads)
    return any(not mine & theirs for mine, theirs in zip(a, b, strict=True))
