"""Loops: the difference between pulling and releasing at the same commands, from the data alone.

Where a trial returns over its own commands in the opposite direction, the measured output is compared with itself: d = (y_release -
y_pull) . e, e the unit vector in which the pull moves it. A positive d means that the robot lags: it moves less when pulled, and
returns less when released. The mean of d is lag + drift over pairs whose pull came first, and lag - drift over pairs whose release
came first. With both kinds, time and direction are separated; otherwise creep, drift and friction look alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.diagnosis.evidence.discrepancy import slope
from twin.diagnosis.thresholds import FEWEST_LOOP_CROSSINGS, LOOP_SIGNIFICANCE, MOVING_RATE_SHARE, SAME_COMMAND_DISTANCE
from twin.prediction.evaluate import OUTPUT_GROUPS, headline_group
from twin.prediction.prepared import Inputs, PreparedRecording


@dataclass(frozen=True)
class Loop:
    """The loop of one trial.

    Mean lag (SI), its standard error from the scatter of neighbouring pairs, the number of pairs, and the mean drift from the
    earlier to the later reading where it can be separated from the lag.
    """

    trial: int
    lag: float
    noise: float
    pairs: int
    drift: float | None

    @property
    def seen(self) -> bool:
        return abs(self.lag) > LOOP_SIGNIFICANCE * self.noise


@dataclass(frozen=True)
class Loops:
    """The loops of all trials that return over their commands: the output (group and name), and each trial's loop."""

    group: str
    name: str
    by_trial: tuple[Loop, ...]

    @property
    def lag(self) -> float:
        """Mean over all pairs, SI; NaN without any."""
        return sum(loop.pairs * loop.lag for loop in self.by_trial) / self._pairs if self.by_trial else float("nan")

    @property
    def noise(self) -> float:
        """Standard error of that mean."""
        return float(np.sqrt(sum((x.pairs * x.noise) ** 2 for x in self.by_trial))) / self._pairs if self.by_trial else float("nan")

    @property
    def seen(self) -> bool:
        return bool(self.by_trial) and abs(self.lag) > LOOP_SIGNIFICANCE * self.noise

    @property
    def confounded(self) -> bool:
        """Whether every command was visited once in each direction and always in the same order."""
        return bool(self.by_trial) and all(loop.drift is None for loop in self.by_trial)

    @property
    def _pairs(self) -> int:
        return sum(loop.pairs for loop in self.by_trial)


def loops(prepared: PreparedRecording, predicted: Sequence[np.ndarray] | None = None) -> Loops:
    """Return the loops of the headline output: of points the one that moves most.

    With `predicted` outputs (n_k, n_output) return those of a twin, in the channel and along the direction of the measured ones,
    where these are known.
    """
    group = headline_group([o.group for o in prepared.outputs if o.group != "skin"] or ["skin"])  # too few clouds
    name, columns = _largest(prepared, group)
    top = np.max([np.abs(i.pull).max(axis=0) for i in prepared.inputs], axis=0)
    top = np.where(top > 0.0, top, 1.0)
    found = []
    for k, i in enumerate(prepared.inputs):
        y = prepared.measured[k][:, columns]
        shown = y if predicted is None else np.where(np.isfinite(y), predicted[k][:, columns], np.nan)
        found.append(_loop(k, i, i.pull / top, shown, y))
    return Loops(group, name, tuple(loop for loop in found if loop is not None))


def _largest(prepared: PreparedRecording, group: str) -> tuple[str, list[int]]:
    """Return the name and the columns of the point, or the channel, of this group that moves most."""
    found: dict[str, list[int]] = {}
    for j, o in enumerate(prepared.outputs):
        if o.group == group:
            found.setdefault(o.channel.name.rpartition("_")[0] if OUTPUT_GROUPS[group].is_point else o.channel.name, []).append(j)
    y = np.concatenate(prepared.measured)
    moved = {name: float(np.nansum((y[:, c] - np.nanmean(y[:, c], axis=0)) ** 2)) for name, c in found.items() if _any(y[:, c])}
    name = max(moved, key=lambda n: moved[n])
    return name, found[name]


def _any(y: np.ndarray) -> bool:
    return bool(np.isfinite(y).all(axis=1).any())


def _loop(trial: int, inputs: Inputs, u: np.ndarray, y: np.ndarray, measured: np.ndarray) -> Loop | None:
    """Return the loop of one point or channel; None where too few commands are repeated.

    `u` (n, n_tendon): commands in units of the largest. `y` (n, 1 to 3): positions. `measured` positions give the direction.
    """
    if len(u) < 4 or not _any(y):
        return None
    first, then, share, pulling = crossings(inputs, u)
    later = y[then] + share[:, None] * (y[then + 1] - y[then])
    d = ((later - y[first]) * np.where(pulling, 1.0, -1.0)[:, None]) @ _along(u, measured)
    known = np.isfinite(d)
    kinds = [d[known & pulling], d[known & ~pulling]]
    enough = [k for k in kinds if len(k) >= FEWEST_LOOP_CROSSINGS]
    if not enough:
        return None
    means = [float(k.mean()) for k in enough]
    errors = [float(np.sqrt(np.mean(np.diff(k) ** 2) / (2.0 * len(k)))) for k in enough]
    drift = 0.5 * (means[0] - means[1]) if len(enough) == 2 else None
    pairs = sum(len(k) for k in enough)
    return Loop(trial, float(np.mean(means)), float(np.sqrt(np.square(errors).sum())) / len(enough), pairs, drift)


def crossings(inputs: Inputs, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return where commands u (n, n_tendon) return in the opposite direction.

    Rows i; the first later row j for which u_i lies a share s of the way from row j to the next; the s; and whether row i pulls
    (|u| grows).
    """
    v = slope(inputs, u)
    speed = np.linalg.norm(v, axis=1)
    moving = speed > MOVING_RATE_SHARE * max(float(speed.max()), 1e-12)
    step = np.diff(u, axis=0)
    length = (step**2).sum(axis=1)
    found: list[tuple[int, int, float]] = []
    for i in np.flatnonzero(moving):
        j = np.arange(i + 1, len(u) - 1)
        j = j[moving[j] & (length[j] > 0.0)]
        share = ((u[i] - u[j]) * step[j]).sum(axis=1) / length[j]
        off = np.linalg.norm(u[j] + share[:, None] * step[j] - u[i], axis=1)
        against = v[j] @ v[i] < -0.5 * speed[j] * speed[i]
        hit = np.flatnonzero((share >= 0.0) & (share < 1.0) & (off < SAME_COMMAND_DISTANCE) & against)
        if hit.size:
            found.append((int(i), int(j[hit[0]]), float(share[hit[0]])))
    first, then, shares = (np.array([f[c] for f in found], t) for c, t in ((0, int), (1, int), (2, float)))
    return first, then, shares, (u[first] * v[first]).sum(axis=1) > 0.0


def _along(u: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the unit vector from the mean y at the least fifth of the pulls to that at the largest fifth."""
    order = np.argsort(np.linalg.norm(u, axis=1), kind="stable")
    order = order[np.isfinite(y[order]).all(axis=1)]
    fifth = max(1, len(order) // 5)
    e = y[order[-fifth:]].mean(axis=0) - y[order[:fifth]].mean(axis=0)
    return e / max(float(np.linalg.norm(e)), 1e-12)
