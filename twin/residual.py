"""Measured - predicted, in sensor sigmas: how large the noise is, and the residual made white by it.

Two noises meet in a marker. Its own, sigma, and that of the readings that drive the twin (tensions or displacements): one wrong
by du moves the predicted shape by G du, the same way in all channels; so does a row whose inputs and markers were not taken at
quite the same moment, by a small share of the input's change from row to row. With A = sigma_u G / sigma the residual in sigmas has
covariance
I + A A', and C^(-1/2) r = r + A V diag((1/sqrt(1+l) - 1)/l) V' A' r (A'A = V l V') makes it white across channels. Successive
samples may still be correlated (AR(1), rho per group); z_k = (x_k - rho^g x_(k-g)) / sqrt(1 - rho^(2g)) over a gap of g samples.

A tendon that a law makes slack does not feel its reading's noise, and |z|^2 falls by it though the law need not be true: the robot
has never felt it. `Whitener.heard` is what that noise adds where the tendon is taut, so that laws can be compared without it
(the corrected score of errors in variables, Nakamura, Biometrika 77, 1990). A tendon that a law leaves x noises above slack feels
max(0, x + e): of the noise's square 1 - Var max(0, x + e) is lost, which is the share of readings under `SILENT`, to 0.03.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtr
from scipy.stats import chi2

from twin.autocorrelation import autocorrelation
from twin.bench import Bench, Inputs
from twin.effects import Drive

DECLARED = "as declared"
SYNC = 0.05  # of a sample interval: how well inputs and markers of one row are known to belong to the same moment
SILENT = 0.4  # noises of a reading above slack: as many are below as noise's square is cut off there
BLUR = 0.25  # noises, over which that is blurred where a fit is to feel it: derivatives then reach the readings beside it
LOCKED = 10.0  # times the spread of differences: an output that the noise of its inputs alone would move by more
OUTLYING = 1e-6  # probability: rows that noise makes less often are not noise
SAME = (
    0.03  # two trials repeat each other if their inputs differ by less than this share of their range (RMS), or two readings' noise
)


@dataclass(frozen=True)
class Noise:
    """Standard deviations: sigma (n_output,) SI per channel; drive (n_tendon,) N or m of a driving reading; rho (n_output,)
    lag-1 correlation."""

    sigma: np.ndarray
    drive: np.ndarray
    rho: np.ndarray
    source: str

    @property
    def declared(self) -> bool:
        return self.source == DECLARED

    def floor(self, bench: Bench, sensitivity: Sequence[np.ndarray]) -> dict[str, float]:
        """RMS error a perfect twin would still show, by group (m; Euclidean per marker).

        The sensors' noise, and that of the readings it is driven by, through the sensitivities (n_k, n_output, n_tendon).
        """
        driven = np.mean([((G * self.drive) ** 2).sum(axis=2).mean(axis=0) for G in sensitivity], axis=0)  # (n_output,)
        floors = {}
        for group in dict.fromkeys(o.group for o in bench.outputs):
            square = float(np.mean([self.sigma[j] ** 2 + driven[j] for j, o in enumerate(bench.outputs) if o.group == group]))
            floors[group] = float(np.sqrt(square * (3.0 if group == "marker" else 1.0)))
        return floors


class Whitener:
    """Makes residuals and their derivatives white, given a Noise and sensitivities G (n_k, n_output, n_tendon) to the commands;
    `taut` are those of tendons held taut, where some are slack.

    `heard` (n_k, n_tendon): the expected |z|^2 of a row that a reading's noise is in, of a tendon that is taut.
    """

    def __init__(
        self, noise: Noise, measured: Sequence[np.ndarray], sensitivity: Sequence[np.ndarray], command: Sequence[np.ndarray],
        taut: Sequence[np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        self.noise = noise
        self.present = [np.isfinite(y) for y in measured]
        self._mix = [self._across(p, g, u) for p, g, u in zip(self.present, sensitivity, command, strict=True)]
        self._memory = [self._along(p) for p in self.present]
        self.heard = [self._heard(k, G) for k, G in enumerate(taut or sensitivity)]

    def _across(self, present: np.ndarray, G: np.ndarray, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        change = np.abs(np.diff(command, axis=0, prepend=command[:1], append=command[-1:]))  # (n + 1, t)
        spread = np.hypot(self.noise.drive, SYNC * np.maximum(change[1:], change[:-1]))  # (n, t)
        A = spread[:, None, :] * G / self.noise.sigma[:, None] * present[:, :, None]  # (n, m, t)
        eigen, V = np.linalg.eigh(np.einsum("nmt,nms->nts", A, A))
        eigen = np.maximum(eigen, 1e-12)
        core = np.einsum("nij,nj,nkj->nik", V, (1.0 / np.sqrt(1.0 + eigen) - 1.0) / eigen, V)
        return A, core

    def _heard(self, k: int, G: np.ndarray) -> np.ndarray:
        a = self.noise.drive * G / self.noise.sigma[:, None] * self.present[k][:, :, None]
        A, core = self._mix[k]
        white = a + np.einsum("nmt,nts,nls,nlr->nmr", A, core, A, a, optimize=True)
        _, decay, scale = self._memory[k]
        return np.einsum("nm,nmt,nmt->nt", (1.0 + decay**2) * scale**2, white, white)

    def cut_off(self, k: int, tension: np.ndarray) -> np.ndarray:
        """Of `heard`, what is cut off near slack where a law has a tendon under tension (n_k, n_tendon) N, slack below zero."""
        above = np.divide(tension, self.noise.drive, out=np.full_like(tension, np.inf), where=self.noise.drive > 0.0)
        return self.heard[k] * ndtr((SILENT - above) / BLUR)

    def of(self, which: Sequence[int]) -> Whitener:
        """The same of some of its trials alone, by their positions."""
        part = copy(self)
        for name in ("present", "heard", "_mix", "_memory"):
            setattr(part, name, [getattr(self, name)[k] for k in which])
        return part

    def trial(self, k: int, r: np.ndarray) -> np.ndarray:
        """Whitened residual (n, m) of trial k; zero where nothing was measured. Works for columns of a Jacobian alike."""
        present = self.present[k]
        x = np.where(present, r, 0.0) / self.noise.sigma
        A, core = self._mix[k]
        x = x + np.einsum("nmt,nt->nm", A, np.einsum("nts,ns->nt", core, np.einsum("nmt,nm->nt", A, x)))
        before, decay, scale = self._memory[k]
        return (x - decay * np.take_along_axis(x, before, axis=0)) * scale

    def _along(self, present: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """For each sample (n, m): the row of the one measured before it, its correlation with that one, and 1 / the spread left."""
        rows = np.arange(len(present))[:, None]
        before = np.vstack([np.full((1, present.shape[1]), -1), np.maximum.accumulate(np.where(present, rows, -1), axis=0)[:-1]])
        decay = np.where(before < 0, 0.0, self.noise.rho ** (rows - before))
        return np.maximum(before, 0), decay, present / np.sqrt(1.0 - decay**2)


def repeats(bench: Bench) -> list[tuple[int, int]]:
    """Pairs of trials that repeat each other: same loads, same samples at the same times, same commands but for noise."""
    pairs = []
    for a in range(len(bench.inputs)):
        for b in range(a + 1, len(bench.inputs)):
            A, B = bench.inputs[a], bench.inputs[b]
            same_loads = (
                np.allclose(A.loads.gravity, B.loads.gravity)
                and A.loads.payload == B.loads.payload
                and np.allclose(A.loads.force, B.loads.force)
            )
            if not same_loads or len(A.time) != len(B.time):
                continue
            if np.abs((A.time - A.time[0]) - (B.time - B.time[0])).max() > SAME * np.ptp(A.time):
                continue  # the same way at another pace
            torque = np.broadcast_arrays(A.loads.torque, B.loads.torque)
            if np.sqrt(np.mean((torque[0] - torque[1]) ** 2)) > SAME * np.abs(torque).max():
                continue
            a_u, b_u = A.command / bench.reading, B.command / bench.reading
            if np.sqrt(np.mean((a_u - b_u) ** 2)) < max(SAME * np.ptp(a_u), 2.0):
                pairs.append((a, b))
    return pairs


def estimate_noise(
    bench: Bench, trials: Sequence[int], residual: Sequence[np.ndarray], sensitivity: Sequence[np.ndarray]
) -> tuple[Noise, list[str]]:
    """The noise of the listed trials, and what had to be assumed, in plain words.

    From repeats among the trials (differences cancel what the model lacks), else as declared, else from second differences along
    each trial (which cancel what is smooth), its correlation from what channels do not share. Tension noise as declared, else by
    maximum likelihood from the same differences. `residual` and `sensitivity` follow `trials`.
    """
    place = {k: i for i, k in enumerate(trials)}
    pairs = [(place[a], place[b]) for a, b in repeats(bench) if a in place and b in place]
    declared = np.array([o.channel.noise or np.nan for o in bench.outputs])
    cells = np.array([c.noise or np.nan for c in bench.drivers]) * np.abs(bench.pull)
    drive = cells if np.isfinite(cells).all() else None
    notes = []
    groups, member = _members(bench)
    if pairs:
        reading = bench.reading if drive is None else drive
        d = [
            _detrended((residual[a] - residual[b]) / np.sqrt(2.0), bench.inputs[trials[a]], sensitivity[a], member, reading)
            for a, b in pairs
        ]
        G, source = [sensitivity[a] for a, _ in pairs], f"{len(pairs)} pairs of repeated trials"
    else:
        rho = autocorrelation(residual, member)
        d, G = _along_rows(residual, sensitivity, rho)
        in_time = "white in time" if not rho.any() else "correlated from row to row as what no two channels share"
        if np.isfinite(declared).all():
            source = DECLARED
            notes.append(f"no repeated trials: the noise is taken as declared, and as {in_time}")
        else:
            source = f"second differences along each trial; taken as {in_time}"
            notes.append(f"no repeated trials: the noise floor is read off second differences and taken as {in_time}")
    D, G_all = np.concatenate(d), np.concatenate(G)
    if source == DECLARED:
        sigma = declared
        if drive is None:
            drive = _likeliest(D, G_all, member, len(groups), bench.reading, sigma=declared)[1]
    else:
        sigma, fitted = _likeliest(D, G_all, member, len(groups), bench.reading, drive=drive)
        drive = fitted if drive is None else drive
    noise = Noise(sigma, drive, np.zeros(len(sigma)), source)
    noise = replace(noise, rho=_correlation(noise, d, G, member) if pairs else rho)
    if not np.isfinite(cells).all():
        units = ["mm" if d is Drive.DISPLACEMENT else f"m{d.shown[0]}" for d in bench.drives]
        said = ", ".join(f"{1e3 * d:.3g} {unit}" for d, unit in zip(drive, units, strict=True))
        notes.append(f"no noise declared for the inputs: estimated as {said} from the data")
    return noise, notes


def row_noise(bench: Bench, residual: Sequence[np.ndarray], sensitivity: Sequence[np.ndarray], drive: np.ndarray) -> Noise:
    """What rows scatter by within trials, beside the inputs' noise `drive` (n_tendon,): from second differences, whatever repeats
    or a bench say. What was never measured has an infinite one, and tells nothing."""
    d, G = (np.concatenate(x) for x in _along_rows(residual, sensitivity, np.zeros(residual[0].shape[1])))
    seen = np.isfinite(d).any(axis=0)
    sigma = np.full(d.shape[1], np.inf)
    if np.any(seen):
        groups, member = np.unique(_members(bench)[1][seen], return_inverse=True)
        sigma[seen] = _likeliest(d[:, seen], G[:, seen], member, len(groups), bench.reading, drive=drive)[0]
    return Noise(sigma, drive, np.zeros(len(sigma)), "rows of a trial")


def _along_rows(
    residual: Sequence[np.ndarray], sensitivity: Sequence[np.ndarray], rho: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Second differences, of the variance of noise with the lag-1 correlation rho (n_output,), and what inputs add to them."""
    size = np.sqrt(6.0 - 8.0 * rho + 2.0 * rho**2)
    shrunk = np.sqrt(6.0) / size[:, None]
    return [(r[:-2] - 2 * r[1:-1] + r[2:]) / size for r in residual], [g[1:-1] * shrunk for g in sensitivity]


def _members(bench: Bench) -> tuple[list[str], np.ndarray]:
    """Groups of outputs in the order in which they come, and each output's (n_output,)."""
    groups = list(dict.fromkeys(o.group for o in bench.outputs))
    return groups, np.array([groups.index(o.group) for o in bench.outputs])


def _detrended(d: np.ndarray, inputs: Inputs, G: np.ndarray, member: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Differences of repeats d (n, m) less what may have changed between the two: a line in time in each channel, and an offset
    and a gain of each input, felt through its sensitivities G (n, m, n_tendon).

    All gains together are a stiffness: a robot that was warmer, or older, the second time is not noise. Each counts by what it may
    scatter by, its group's spread and the inputs' `reading` (n_tendon,); NaN where the inputs' share is `LOCKED` times the spread.
    There tendons hold each other, a tenth of a millimetre is newtons to the twin, and what gives way in the robot is not known.
    """
    t = (inputs.time - inputs.time[0]) / max(inputs.time[-1] - inputs.time[0], 1e-9) - 0.5
    basis = np.stack([np.ones_like(t), t], axis=1)
    felt = np.concatenate([G, G * inputs.command[:, None, :]], axis=2)
    scale, noise = _scales(d, member)[member], np.sqrt(((G * reading) ** 2).sum(axis=2))  # (m,), (n, m)
    weight = 1.0 / np.hypot(scale, noise)
    locked = noise >= LOCKED * scale
    d = np.where(locked & ~locked.all(axis=0), np.nan, d)  # a channel that would be left out altogether is what there is
    out, moved = np.full_like(d, np.nan), np.zeros_like(felt)
    for j in range(d.shape[1]):
        ok = np.isfinite(d[:, j])
        if ok.sum() > 4:
            both, w = np.column_stack([d[ok, j], felt[ok, j]]), weight[ok, j, None]
            both -= basis[ok] @ np.linalg.lstsq(w * basis[ok], w * both, rcond=None)[0]
            out[ok, j], moved[ok, j] = both[:, 0] * np.sqrt(ok.sum() / (ok.sum() - 2)), both[:, 1:]
    known = np.isfinite(out)
    w = weight[known]
    return out - moved @ np.linalg.lstsq(w[:, None] * moved[known], w * out[known], rcond=None)[0]


def _scales(d: np.ndarray, member: np.ndarray) -> np.ndarray:
    """Robust spread (n_group,) of differences d (n, m), by group."""
    median = [np.nanmedian(np.abs(d[:, member == g])) for g in range(member.max() + 1)]
    return np.maximum(1.4826 * np.array(median), 1e-9)


def _likeliest(
    d: np.ndarray, G: np.ndarray, member: np.ndarray, n_group: int, reading: np.ndarray, *, drive: np.ndarray | None = None,
    sigma: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Maximum-likelihood sigma per group and that of the inputs, a common multiple of `reading` (n_tendon,), for differences
    d (n, m) ~ N(0, diag sigma^2 + G diag sigma_u^2 G'). Where sigma is sought, rows whose |z|^2 noise exceeds in one of a
    million are left out, again and again until none is left: a body that snaps over an obstacle from row to row is not noisy."""
    present = np.isfinite(d)
    unlikely = chi2.isf(OUTLYING, np.maximum(present.sum(axis=1), 1))
    scale = _scales(d, member)
    d, G = np.where(present, d, 0.0), G * present[:, :, None]  # what is missing says nothing, of no channel and no input

    def unpack(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = sigma if sigma is not None else (scale * np.exp(x[:n_group]))[member]
        return s, drive if drive is not None else reading * np.exp(x[-1])

    def of_rows(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Each row's |z|^2 and the logarithm of its covariance's determinant."""
        s, s_u = unpack(x)
        A, r = s_u * G / s[:, None], d / s
        inner = np.eye(G.shape[2]) + np.einsum("nmt,nms->nts", A, A)
        b = np.einsum("nmt,nm->nt", A, r)
        square = (r**2).sum(axis=1) - np.einsum("nt,nt->n", b, np.linalg.solve(inner, b[..., None])[..., 0])
        return square, np.linalg.slogdet(inner)[1] + 2.0 * present @ np.log(s)

    def minus_log_likelihood(x: np.ndarray) -> float:
        square, log_determinant = of_rows(x)
        return 0.5 * float((square + log_determinant)[usual].sum())

    x = np.zeros((0 if sigma is not None else n_group) + (drive is None))
    usual, outlying = np.zeros(len(d), dtype=bool), np.zeros(len(d), dtype=bool)
    while x.size and not np.array_equal(usual, ~outlying):
        usual = ~outlying
        x = minimize(minus_log_likelihood, x, method="L-BFGS-B", bounds=[(-3.0, 3.0)] * x.size).x
        outlying |= (of_rows(x)[0] > unlikely) & (sigma is None)
    return unpack(x)


def _correlation(noise: Noise, d: Sequence[np.ndarray], G: Sequence[np.ndarray], member: np.ndarray) -> np.ndarray:
    """Lag-1 correlation per group of the whitened differences; zero unless it is clearly there (3 standard errors)."""
    white = Whitener(noise, d, G, [np.zeros((len(g), g.shape[2])) for g in G])
    z = [white.trial(k, x) for k, x in enumerate(d)]
    rho = np.zeros(member.size)
    for g in range(member.max() + 1):
        columns = member == g
        product = sum(float((x[1:, columns] * x[:-1, columns]).sum()) for x in z)
        power = sum(float((x[:, columns] ** 2).sum()) for x in z)
        count = sum(x[1:, columns].size for x in z)
        if power > 0 and product / power > 3.0 / np.sqrt(count):
            rho[columns] = min(product / power, 0.9)
    return rho
