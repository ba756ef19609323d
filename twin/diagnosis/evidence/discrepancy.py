"""The evidence of a model against an unnamed smooth error.

The whitened residual of each channel is modelled as z ~ N(0, I + Phi D Phi'), Phi the regressors below (unit RMS, one block a
component: static, direction, rate, memory, slow, trial) and D their variances, one a component and group of channels. The variances
maximise the likelihood (MacKay's fixed point). This is Kennedy and O'Hagan's discrepancy, as variance components.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.body import Drive
from twin.diagnosis.thresholds import (
    FIXED_POINT_ROUNDS,
    LARGEST_VARIANCE,
    LEAST_VARIANCE,
    MEMORY_TIMES,
    NEGLIGIBLE_VARIANCE,
    SETTLED_VARIANCE_CHANGE,
)
from twin.prediction.prepared import Inputs, PreparedRecording

COMPONENTS = ("static", "direction", "rate", "memory", "slow", "trial")
STATIC = COMPONENTS.index("static")
IN_WORDS = {
    "static": "the pose (pull and payload)",
    "direction": "the direction of pull",
    "rate": "the rate of pull",
    "memory": "the recent past (2-30 s)",
    "slow": "time or temperature over the session",
    "trial": "the trial as a whole",
}


# What a regressor's name begins or ends with -> the kind of variable to plot against, as `Effect.plot_against`; the first counts.
PLOT_KINDS = (
    (("direction of ",), "loop"),
    (("rate of ",), "rate"),
    (("trial ", "time"), "clock"),
    (("temperature",), "temperature"),
    (("payload",), "payload"),
    (("torque",), "torque"),
)


def plot_kind(regressor: str) -> str | None:
    """Return the kind of variable that a regressor is plotted against; None for the constant."""
    if " over the last " in regressor:
        return "elapsed"
    kind = next((kind for starts, kind in PLOT_KINDS if regressor.startswith(starts)), "tension")
    return None if regressor == "1" else kind


@dataclass(frozen=True)
class Regressors:
    """Phi (n, p), the component of each column (p,), and names for reports."""

    matrix: np.ndarray
    component: np.ndarray
    names: tuple[str, ...]


def regressors(prepared: PreparedRecording, trials: Sequence[int], noise: np.ndarray) -> Regressors:
    """Return the regressors of an unnamed error, on the listed trials' samples (n, p).

    `noise` (n_tendon,) is the readings' noise.
    """
    inputs = [prepared.inputs[k] for k in trials]
    span = np.max([np.abs(i.pull).max(axis=0) for i in inputs], axis=0)
    held = prepared.driven_by(Drive.DISPLACEMENT)
    for kind in (held, ~held):  # tendons driven alike have one scale
        span[kind] = max(span[kind].max(initial=0.0), 1e-9)
    u = [quiet(i, noise) / span for i in inputs]
    slopes = [slope(i, w) for i, w in zip(inputs, u, strict=True)]
    typical = np.median(np.abs(np.concatenate(slopes))) + 1e-9
    U, dU = np.concatenate(u), np.concatenate(slopes)
    loads = {
        "payload": np.concatenate([np.full(len(i.time), i.loads.hung) for i in inputs]),
        "torque": np.concatenate([np.broadcast_to(i.loads.torque, len(i.time)) for i in inputs]),
    }
    clock = np.concatenate([i.clock for i in inputs])
    t = (clock - clock.mean()) / max(np.ptp(clock), 1e-9) * 2.0
    warm = np.concatenate([i.temperature for i in inputs])
    warm = (warm - warm.mean()) / max(float(warm.std()), 0.5)
    n_tendon = U.shape[1]
    blocks: dict[str, list[tuple[str, np.ndarray]]] = {c: [] for c in COMPONENTS}
    letter = {Drive.TENSION: "T", Drive.DISPLACEMENT: "d", Drive.CURRENT: "I", Drive.CONTROL: "c"}
    T = [f"{letter[d]}{i}" for i, d in enumerate(prepared.drives, 1)]
    static = blocks["static"]
    static.append(("1", np.ones(len(U))))
    for a in range(n_tendon):
        static.append((T[a], U[:, a]))
        for b in range(a, n_tendon):
            static.append((f"{T[a]} {T[b]}", U[:, a] * U[:, b]))
            static += [(f"{T[a]} {T[b]} {T[c]}", U[:, a] * U[:, b] * U[:, c]) for c in range(b, n_tendon)]
    for name, load in loads.items():
        if np.ptp(load) > 0:
            m = load / np.abs(load).max()
            static += [(name, m), *((f"{name} {T[a]}", m * U[:, a]) for a in range(n_tendon))]
    for a in range(n_tendon):
        sign = np.tanh(dU[:, a] / typical)
        blocks["direction"] += [(f"direction of {T[a]}", sign), (f"direction of {T[a]} x {T[a]}", sign * U[:, a])]
        blocks["rate"] += [(f"rate of {T[a]}", dU[:, a]), (f"rate of {T[a]} x {T[a]}", dU[:, a] * U[:, a])]
        for tau in MEMORY_TIMES:
            past = np.concatenate([_lagged(i.time, w[:, a], tau) for i, w in zip(inputs, u, strict=True)])
            blocks["memory"].append((f"{T[a]} over the last {tau:g} s", U[:, a] - past))
        blocks["slow"] += [(f"time x {T[a]}", t * U[:, a]), (f"temperature x {T[a]}", warm * U[:, a])]
    blocks["slow"] += [("time", t), ("time^2", t**2), ("time^3", t**3), ("temperature", warm)]
    which = np.repeat(np.arange(len(inputs)), [len(i.time) for i in inputs])
    if len(inputs) > 2:
        blocks["trial"] += [(f"trial {prepared.inputs[k].name}", (which == j).astype(float)) for j, k in enumerate(trials)]
    columns, component, names = [], [], []
    for c, name in enumerate(COMPONENTS):
        for label, column in blocks[name]:
            size = np.sqrt(np.mean(column**2))
            if size > 1e-9:
                columns.append(column / size)
                component.append(c)
                names.append(label)
    return Regressors(np.stack(columns, axis=1), np.array(component), tuple(names))


def quiet(inputs: Inputs, noise: np.ndarray) -> np.ndarray:
    """Return commands (n, n_tendon), each interpolated from the neighbouring rows where it agrees with them.

    It agrees within three standard deviations of its `noise` (n_tendon,). A regressor with a reading's own noise in it would
    correlate with the residual, which contains that noise too, although nothing is missing.
    """
    u, t = inputs.pull, inputs.time
    if len(u) < 3:
        return u
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    between = (1.0 - share) * u[:-2] + share * u[2:]
    within = np.abs(u[1:-1] - between) < 3.0 * noise * np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    return np.concatenate([u[:1], np.where(within, between, u[1:-1]), u[-1:]])


def slope(inputs: Inputs, u: np.ndarray) -> np.ndarray:
    """Return du/dt (n, n_tendon) of commands smoothed over three samples, so that noise alone gives no direction."""
    padded = np.pad(u, ((1, 1), (0, 0)), mode="edge")
    smooth = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
    return np.gradient(smooth, inputs.time, axis=0) if len(u) > 1 else np.zeros_like(u)


def _lagged(time: np.ndarray, u: np.ndarray, tau: float) -> np.ndarray:
    """Return the first-order low-pass of u with time constant tau (s), at rest at the start."""
    out = np.empty_like(u)
    out[0] = u[0]
    for i, keep in enumerate(np.exp(-np.diff(time) / tau), 1):
        out[i] = keep * out[i - 1] + (1.0 - keep) * u[i]
    return out


@dataclass(frozen=True)
class Discrepancy:
    """The smooth error left in a residual.

    `gain` = 2 (log N(z; 0, I + Phi D Phi') - log N(z; 0, I)). `mean` (n, m): its posterior mean in sigmas. `static` (n, m): the
    part of the mean that is a function of the pose. `variance` (n_group, n_component). `coefficients` (p, m).
    """

    gain: float
    mean: np.ndarray
    static: np.ndarray
    variance: np.ndarray
    coefficients: np.ndarray

    @property
    def size(self) -> float:
        """Root-mean-square of the posterior mean, in sigmas."""
        return float(np.sqrt(np.mean(self.mean**2)))

    def rest(self, accuracy: np.ndarray) -> np.ndarray:
        """Return the mean (n, m) less what errors of the description explain.

        A description with the accuracy `accuracy` (m,) sigmas (RMS) of each channel explains functions of the pose up to that size.
        """
        static = np.sqrt(np.mean(self.static**2, axis=0))
        return self.mean - np.minimum(1.0, accuracy / np.maximum(static, np.finfo(float).tiny)) * self.static

    def beyond(self, accuracy: np.ndarray) -> float:
        """Return the root-mean-square of `rest`, in sigmas."""
        return float(np.sqrt(np.mean(self.rest(accuracy) ** 2)))


class Evidence:
    """The discrepancies of whitened residuals on fixed trials, of readings with that `noise` (n_tendon,) N, m or A.

    Everything that does not depend on the residual is computed once.
    """

    def __init__(self, prepared: PreparedRecording, trials: Sequence[int], noise: np.ndarray) -> None:
        self.phi = regressors(prepared, trials, noise)
        groups = list(dict.fromkeys(o.group for o in prepared.outputs))
        self.groups = groups
        self.member = np.array([groups.index(o.group) for o in prepared.outputs])
        present = np.isfinite(np.concatenate([prepared.measured[k] for k in trials]))
        self.present = present
        # Channels of one group that are missing together (a marker's x, y and z) share everything except the residual.
        alike, self.kind = np.unique(np.vstack([self.member, present]), axis=1, return_inverse=True)
        self.kind = self.kind.ravel()
        self.group = alike[0].astype(int)  # (n_kind,)
        self.gram = np.stack([self.phi.matrix.T @ (self.phi.matrix * mask[:, None]) for mask in alike[1:].T])

    def discrepancy(self, z: np.ndarray) -> Discrepancy:
        """Return the most likely discrepancy of z (n * m,) or (n, m)."""
        Z = z.reshape(self.present.shape)
        n_group, n_component = len(self.groups), len(COMPONENTS)
        variance = np.full((n_group, n_component), 1e-2)
        b = (self.phi.matrix.T @ Z).T  # (m, p)
        component = self.phi.component
        for _ in range(FIXED_POINT_ROUNDS):
            D = variance[self.group][:, component]  # (n_kind, p)
            covariance = np.linalg.inv(self.gram + _diagonal(1.0 / D))
            mean = np.einsum("mpq,mq->mp", covariance[self.kind], b)
            explained = mean**2
            determined = (1.0 - np.einsum("kpp->kp", covariance) / D)[self.kind]
            new = np.empty_like(variance)
            for g in range(n_group):
                rows = self.member == g
                for c in range(n_component):
                    block = np.ix_(rows, component == c)
                    new[g, c] = (
                        explained[block].sum() / max(determined[block].sum(), 1e-6) if (component == c).any() else LEAST_VARIANCE
                    )
            new = np.clip(new, LEAST_VARIANCE, LARGEST_VARIANCE)
            converged = np.all((np.abs(np.log(new / variance)) < SETTLED_VARIANCE_CHANGE) | (new < NEGLIGIBLE_VARIANCE))
            variance = new
            if converged:
                break
        D = variance[self.group][:, component]
        inner = np.eye(len(component)) + np.sqrt(D)[:, :, None] * self.gram * np.sqrt(D)[:, None, :]
        coefficients = np.einsum("mpq,mq->mp", np.linalg.inv(self.gram + _diagonal(1.0 / D))[self.kind], b)
        gain = float(np.einsum("mp,mp->", b, coefficients) - np.linalg.slogdet(inner)[1][self.kind].sum())
        mean, of_pose = (self.phi.matrix[:, of] @ coefficients.T[of] * self.present for of in (slice(None), component == STATIC))
        return Discrepancy(gain, mean, of_pose, variance, coefficients.T)

    def whiten(self, discrepancy: Discrepancy, X: np.ndarray) -> np.ndarray:
        """Return (I + Phi D Phi')^-1 X for columns X (n * m, k)."""
        n, m = self.present.shape
        Y = X.reshape(n, m, -1)
        D = discrepancy.variance[self.group][:, self.phi.component]
        inside = np.linalg.inv(self.gram + _diagonal(1.0 / D))[self.kind]
        b = np.einsum("np,nmk->mpk", self.phi.matrix, Y, optimize=True)
        c = np.einsum("mpq,mqk->mpk", inside, b, optimize=True)
        smooth = np.einsum("np,mpk->nmk", self.phi.matrix, c, optimize=True) * self.present[:, :, None]
        return (Y - smooth).reshape(X.shape)

    def log_likelihood_gain(self, z: np.ndarray) -> tuple[float, Discrepancy]:
        """Return 2 max log N(z; 0, I + Phi D Phi') up to a constant, -|z|^2 + gain, and the discrepancy."""
        found = self.discrepancy(z)
        return found.gain - float(z.ravel() @ z.ravel()), found

    def beyond_pose(self, z: np.ndarray) -> float:
        """Return the root-mean-square of z (n * m,) less its smooth function of the pose.

        The function is a least-squares fit of the static regressors.
        """
        Z = np.where(self.present, z.reshape(self.present.shape), 0.0)
        pose = np.flatnonzero(self.phi.component == COMPONENTS.index("static"))
        gram = self.gram[:, pose[:, None], pose] + 1e-9 * self.gram[:, pose, pose].max() * np.eye(len(pose))
        b = (self.phi.matrix[:, pose].T @ Z).T
        coefficients = np.linalg.solve(gram[self.kind], b[..., None])[..., 0]
        left = (Z - self.phi.matrix[:, pose] @ coefficients.T)[self.present]
        return float(np.sqrt(np.mean(left**2)))

    def strongest(self, discrepancy: Discrepancy, count: int = 5) -> list[tuple[str, float]]:
        """Return the regressors that carry most of a discrepancy: (name, RMS in sigmas)."""
        size = np.sqrt(np.mean(discrepancy.coefficients**2, axis=1))
        return [(self.phi.names[i], float(size[i])) for i in np.argsort(-size)[:count]]


def _diagonal(x: np.ndarray) -> np.ndarray:
    """Return the rows of x (m, p) as diagonal matrices (m, p, p)."""
    return x[:, :, None] * np.eye(x.shape[1])


@dataclass(frozen=True)
class Spectrum:
    """Waves exp(-2 pi i f t) of every trial on one absolute grid of frequencies (Hz), (n_f, n_k) each."""

    grid: np.ndarray
    waves: tuple[np.ndarray, ...]

    @staticmethod
    def of(prepared: PreparedRecording, trials: Sequence[int]) -> Spectrum:
        times = [prepared.inputs[k].time for k in trials]
        fastest = 0.45 / float(np.median(np.concatenate([np.diff(t) for t in times])))
        longest = max(float(t[-1] - t[0]) for t in times)
        grid = np.arange(4.0 / longest, fastest, 0.5 / longest)
        return Spectrum(grid, tuple(np.exp(-2j * np.pi * np.outer(grid, t - t[0])).astype(np.complex64) for t in times))

    def peak(self, rest: np.ndarray) -> tuple[float, float]:
        """Return the strongest spectral line of the residual without its smooth error: (z-score, frequency in Hz).

        Periodograms of all trials and channels (n, m) are added. Noise gives each grid point its continuum's level times a
        chi-square of 2 (trials x channels) degrees of freedom over their number. The continuum need not be flat: noise with a
        memory longer than one row (such as coloured and white together) is not whitened, and is no line.
        """
        if self.grid.size < 4:
            return 0.0, 0.0
        power, count, row = np.zeros(self.grid.size), 0, 0
        for wave in self.waves:
            n = wave.shape[1]
            x = rest[row : row + n]
            row += n
            used = x.std(axis=0) > 0
            x = x[:, used] - x[:, used].mean(axis=0)
            power += (np.abs(wave @ x.astype(np.float32)) ** 2 / (n * x.var(axis=0) + 1e-12)).sum(axis=1)
            count += int(used.sum())
        if count == 0:
            return 0.0, 0.0
        score = np.sqrt(count) * (power / self._continuum(power) - 1.0)
        best = int(np.argmax(score))
        return float(score[best]), float(self.grid[best])

    def _continuum(self, power: np.ndarray) -> np.ndarray:
        """Return the spectral continuum (n_f,) below the lines.

        Log power is a parabola of log frequency; a line with fewer than 16 frequencies, a constant with fewer than 8. Points more
        than three robust deviations above it are lines and left out.
        """
        x = np.log(self.grid / self.grid[0])
        basis, log = np.vander(x, min(3, 1 + x.size // 8)), np.log(power)
        below = np.ones(x.size, dtype=bool)
        for _ in range(FIXED_POINT_ROUNDS):
            rest = log - basis @ np.linalg.lstsq(basis[below], log[below], rcond=None)[0]
            before, below = below, rest < 3.0 * 1.4826 * np.median(np.abs(rest[below]))
            if np.array_equal(below, before):
                break
        return np.exp(log - rest)
