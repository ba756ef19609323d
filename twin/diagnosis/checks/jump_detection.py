"""Detection of zeros that jump: steps in time of the calibrated robot's error that do not depend on the pose.

Residuals are taken in the metric of their variation within trials, C^(-1/2) r, C their covariance there. A wrong robot model bends,
and hardly moves the markers near its base; a moved camera moves those too. S_k is the mean of trial k projected on the pattern of a
group's zero, one number an angle, six a camera. Between trials k - 1 and k the means of the a trials before and the b trials after
differ by D, and

    T = a b / (a + b) |D|^2 / median_j |S_j+1 - S_j|^2,     a, b <= `TRIALS_AROUND_JUMP`

is large where a zero jumped. Friction, backlash or a wrong load scatter alike on both sides; creep, drift and warming go on.

A step counts under three conditions. |D|^2 over the median square by which trials change along D exceeds T of each of
`SHUFFLED_ORDERS` white series. The step leaves less than `STEP_LEFTOVER_SHARE` of the scatter around it and explains more than a
line in time. All outputs together step as that zero would make them: a robot that changed bends, and moves more outputs than one. A
turn about the base alone may be the robot's clamp and is left to the verdict; so is a step at which the commands or loads of the
trials changed too.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.checks.zero_jumps import ANGLE, Jump, Zeros, jumps_of, without
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import (
    CLEAR_CHI_SQUARE,
    LEAST_JUMP,
    LEFT_BY_EFFECTS,
    RIGID_MOTION_SHARE,
    SHUFFLED_ORDERS,
    STEP_LEFTOVER_SHARE,
    TRIALS_AROUND_JUMP,
)
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import Inputs


def next_jump(context: FitContext, fit: Fit, taken: Sequence[Jump]) -> Jump | None:
    """Return the clearest jump that a calibrated robot leaves in the fitted trials, beside those already `taken`; None if none.

    The robot was fitted without the jump and is bent by it. Whether it is a jump shows a fit with it (`stands`).
    """
    return _clearest(context, fit, fit.evaluation.raw, taken, CLEAR_CHI_SQUARE)


def stands(context: FitContext, fit: Fit, jump: Jump) -> bool:
    """Return whether a fitted jump is clear when it is put back into the residuals of its fit."""
    twin, traces, prepared = fit.model.twin, fit.evaluation.traces, context.prepared
    rest = replace(twin, effects=tuple(without(e, jump) if isinstance(e, Zeros) else e for e in twin.effects))
    raw = [prepared.measured[k] - traces[k].outputs(rest, prepared) for k in context.trials]
    found = _clearest(context, fit, raw, (), _by_chance(len(raw)))
    return found is not None and found.group == jump.group and found.last <= jump.since and jump.last <= found.since


def may_be_clamp(context: FitContext, before: Fit, after: Fit, jump: Jump) -> bool:
    """Return whether a turn about the base alone explains `RIGID_MOTION_SHARE` of what a fitted jump does.

    That is so if leaving out its shift would cost little, to second order in it. A turn about the robot's axis hardly moves the
    means in which jumps are sought; a fit shows it.
    """
    if len({o.index for o in context.prepared.outputs if OUTPUT_GROUPS[o.group].is_point}) < 2 or jump.joints:
        return False
    n = jumps_of(after.model.twin).index(jump) + 1
    names = {f"{x}_{n}" for x in jump.numbers[3:]}
    own = [i for i, f in enumerate(after.model.free) if f.effect == Zeros.id and f.parameter.name in names]
    shift, covariance = after.model.vector()[own], np.linalg.pinv(after.information())[np.ix_(own, own)]
    return float(shift @ np.linalg.solve(covariance, shift)) < (1.0 - RIGID_MOTION_SHARE) * (before.cost - after.cost)


def _clearest(context: FitContext, fit: Fit, raw: Sequence[np.ndarray], taken: Sequence[Jump], limit: float) -> Jump | None:
    if len(raw) < 4:
        return None
    inputs = [context.prepared.inputs[k] for k in context.trials]
    off = [r / context.objective.whitener.noise.sigma for r in raw]
    means = np.stack([_mean(x) for x in off])
    level = np.nan_to_num(_mean(means))
    M, metric = np.where(np.isfinite(means), means - level, 0.0), _metric(off)
    done = np.stack([_conditions(i) for i in inputs])
    found: list[tuple[float, Jump]] = []
    for group, zero, turn in _patterns(context, fit):
        B, clamp = _basis(metric @ zero), _basis(metric @ turn)
        for k, a, b in _steps(M @ metric @ B, np.array([i.clock[0] for i in inputs]), limit):
            before = M[k - a : k].mean(axis=0)
            D = M[k : k + b].mean(axis=0) - before
            moved = metric @ D
            whole, own, turned = (float(((X.T @ moved) ** 2).sum()) for X in (np.eye(len(D)), B, clamp))
            large = np.sqrt(np.mean(D[zero.any(axis=1)] ** 2)) > LEAST_JUMP
            known = any(t.group == group and inputs[k - 1].clock[0] <= t.since <= inputs[k].clock[-1] for t in taken)
            if (
                large
                and own > RIGID_MOTION_SHARE * whole
                and turned < RIGID_MOTION_SHARE * whole
                and not known
                and not _parted(done, k)
            ):
                found.append((own, _located(context, off, group, k, level + before, D)))
                break
    return max(found, key=lambda f: f[0])[1] if found else None


def _conditions(inputs: Inputs) -> np.ndarray:
    """Return the conditions of a trial: mean commands and their rate, mean loads."""
    u, loads = inputs.command, inputs.loads
    pace = np.abs(np.diff(u, axis=0)).sum() / (inputs.time[-1] - inputs.time[0] + 1e-9)
    return np.array([*u.mean(axis=0), pace, loads.hung, np.mean(loads.torque), *loads.gravity, *loads.force])


def _parted(done: np.ndarray, k: int) -> bool:
    """Return whether some condition (K, q) separates all trials before the k-th from all others.

    Then that condition may be the cause.
    """
    before, after = done[:k], done[k:]
    return bool(np.any((before.max(axis=0) < after.min(axis=0)) | (after.max(axis=0) < before.min(axis=0))))


def _metric(off: Sequence[np.ndarray]) -> np.ndarray:
    """Return C^(-1/2) (n_output, n_output), C = I + the covariance of residuals (n_k, n_output) in sigmas within trials."""
    x = np.nan_to_num(np.concatenate([r - _mean(r) for r in off]))
    eigen, V = np.linalg.eigh(np.eye(x.shape[1]) + x.T @ x / len(x))
    return V / np.sqrt(eigen) @ V.T


def _mean(x: np.ndarray) -> np.ndarray:
    """Return the mean of each column over what is there; NaN where nothing is."""
    known = np.isfinite(x)
    return np.where(known, x, 0.0).sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)


def _patterns(context: FitContext, fit: Fit) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield, for each group with a zero, its name, the pattern (n_output, p) of its jumps, and the clamp's (n_output, q).

    Patterns are in sigmas of all outputs; the clamp's are those jumps that a moved clamp may make too.
    """
    prepared, sigma = context.prepared, context.objective.whitener.noise.sigma
    angles = [c for c, o in enumerate(prepared.outputs) if o.group == ANGLE]
    if angles:
        yield ANGLE, np.eye(len(prepared.outputs))[:, angles], np.zeros((len(prepared.outputs), 0))
    points = [c for c, o in enumerate(prepared.outputs) if OUTPUT_GROUPS[o.group].is_point]
    if points:
        predicted = np.concatenate([prepared.measured[k] - r for k, r in zip(context.trials, fit.evaluation.raw, strict=True)])
        where = np.nan_to_num(_mean(predicted))
        shift, turn = np.zeros((2, len(prepared.outputs), 3))
        place: dict[int, np.ndarray] = {}
        for c in points:
            place.setdefault(prepared.outputs[c].index, np.zeros(3))[prepared.outputs[c].axis] = where[c]
        for c in points:
            o = prepared.outputs[c]
            shift[c, o.axis] = 1.0 / sigma[c]
            turn[c] = [np.cross(e, place[o.index])[o.axis] / sigma[c] for e in np.eye(3)]
        clamp = turn if len(place) > 1 else np.zeros((len(prepared.outputs), 0))
        yield "marker", np.hstack([shift, turn]), clamp


def _basis(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the span of columns (n, p)."""
    if not columns.size:
        return columns
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-30)
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return U[:, s > 1e-6 * s[0]]


def _steps(S: np.ndarray, start: np.ndarray, limit: float) -> Iterator[tuple[int, int, int]]:
    """Yield steps (k, a, b) of the series S (K, p) above the limit that are no drift, the clearest first."""
    taken = _explained(S[None])[0]
    for flat in np.argsort(-taken, axis=None)[: np.count_nonzero(taken)]:
        k, a, b = (int(i) for i in np.unravel_index(flat, taken.shape))
        D = S[k : k + b].mean(axis=0) - S[k - a : k].mean(axis=0)
        part, t = S[k - a : k + b], start[k - a : k + b]
        part, t = part - part.mean(axis=0), t - t.mean()
        scatter, line = float((part**2).sum()), float(((t @ part) ** 2).sum() / max(float(t @ t), 1e-30))
        clear = float(D @ D) ** 2 > limit * float(np.median((np.diff(S, axis=0) @ D) ** 2))
        if clear and taken[k, a, b] > max((1.0 - STEP_LEFTOVER_SHARE) * scatter, line):
            yield k, a, b


def _explained(S: np.ndarray) -> np.ndarray:
    """Return a b / (a + b) |D|^2 (r, K, TRIALS_AROUND_JUMP + 1, TRIALS_AROUND_JUMP + 1) of series S (r, K, p).

    Zero where there are no such trials.
    """
    r, K, _ = S.shape
    total = np.concatenate([np.zeros_like(S[:, :1]), np.cumsum(S, axis=1)], axis=1)
    out = np.zeros((r, K, TRIALS_AROUND_JUMP + 1, TRIALS_AROUND_JUMP + 1))
    for a in range(2, TRIALS_AROUND_JUMP + 1):
        for b in range(2, TRIALS_AROUND_JUMP + 1):
            k = np.arange(a, K - b + 1)
            D = (total[:, k + b] - total[:, k]) / b - (total[:, k] - total[:, k - a]) / a
            out[:, k, a, b] = a * b / (a + b) * (D**2).sum(axis=2)
    return out


@cache
def _by_chance(K: int) -> float:
    """Return the largest T of `SHUFFLED_ORDERS` white series of K numbers."""
    S = np.random.default_rng(0).normal(size=(SHUFFLED_ORDERS, K, 1))
    scale = np.median((np.diff(S, axis=1) ** 2).sum(axis=2), axis=1)
    return float((_explained(S).reshape(SHUFFLED_ORDERS, -1).max(axis=1) / scale).max())


def _located(context: FitContext, off: Sequence[np.ndarray], group: str, k: int, before: np.ndarray, D: np.ndarray) -> Jump:
    """Return the jump at the row from which the residual is nearer to the level after the step.

    The jump is between two trials, unless a row within one of them fits clearly better.
    """
    prepared, trials = context.prepared, context.trials
    near = [_along(off[j], before, D) for j in (k - 1, k)]
    s, border = np.concatenate(near), len(near[0])
    cost = np.concatenate([[0.0], np.cumsum(s**2)]) + np.concatenate([np.cumsum(((s - 1.0) ** 2)[::-1])[::-1], [0.0]])
    row = int(np.argmin(cost[1:-1])) + 1
    row = row if cost[row] < LEFT_BY_EFFECTS * cost[border] else border
    clock = np.concatenate([prepared.inputs[trials[j]].clock for j in (k - 1, k)])
    joints = tuple(dict.fromkeys(o.index for o in prepared.outputs if o.group == ANGLE)) if group == ANGLE else ()
    return Jump(group, float(clock[row - 1]), float(clock[row]), joints)


def _along(x: np.ndarray, before: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Return how far along D each row of residuals (n, n_output) is, 0 before the step and 1 after it."""
    known = np.isfinite(x)
    return np.where(known, x - before, 0.0) @ D / np.maximum(known @ D**2, 1e-30)
