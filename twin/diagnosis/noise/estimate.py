"""The estimate of the noise of a robot's sensors and driving readings, from measured - predicted."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize
from scipy.stats import chi2

from twin.body import Drive
from twin.diagnosis.noise.autocorrelation import autocorrelation
from twin.diagnosis.noise.model import DECLARED, Noise
from twin.prediction.prepared import Inputs, PreparedRecording

INPUT_NOISE_RATIO = 10.0  # times the spread of differences: an output that the noise of its inputs alone would move by more
CORRELATION_LAGS = (1, 2, 3, 4)  # rows, at which the correlation of noise is estimated from repeats
CLEAR_CORRELATION = 3.0  # standard errors of a clear correlation
LARGEST_CORRELATION = 0.9  # correlation from row to row: beyond it noise is a drift
LARGEST_FADE = 0.97  # the same, of the correlated part beside white noise
OUTLIER_PROBABILITY = 1e-6  # probability: rows that noise makes less often are not noise
# Of the range of a group of outputs: solvers and steps are not exact. A rollout's channels without noise are known no better.
PRECISION_SHARE = 1e-5
SMALLEST_NOISE = 1e-9  # SI, of an output that never changes
# Two trials repeat each other if their inputs differ by less than this share of their range (RMS), or by two readings' noise.
REPEAT_DIFFERENCE = 0.03


def repeats(prepared: PreparedRecording) -> list[tuple[int, int]]:
    """Return pairs of trials that repeat each other: same loads, same sample times, same commands but for noise."""
    pairs = []
    for a in range(len(prepared.inputs)):
        for b in range(a + 1, len(prepared.inputs)):
            A, B = prepared.inputs[a], prepared.inputs[b]
            same_loads = (
                np.allclose(A.loads.gravity, B.loads.gravity)
                and A.loads.hung == B.loads.hung
                and A.loads.payloads == B.loads.payloads
                and np.allclose(A.loads.force, B.loads.force)
            )
            if not same_loads or len(A.time) != len(B.time):
                continue
            if np.abs((A.time - A.time[0]) - (B.time - B.time[0])).max() > REPEAT_DIFFERENCE * np.ptp(A.time):
                continue  # the same path at another rate
            torque = np.broadcast_arrays(A.loads.torque, B.loads.torque)
            if np.sqrt(np.mean((torque[0] - torque[1]) ** 2)) > REPEAT_DIFFERENCE * np.abs(torque).max():
                continue
            a_u, b_u = A.pull / prepared.pull_resolution, B.pull / prepared.pull_resolution
            if np.sqrt(np.mean((a_u - b_u) ** 2)) < max(REPEAT_DIFFERENCE * np.ptp(a_u), 2.0):
                pairs.append((a, b))
    return pairs


def estimate_noise(
    prepared: PreparedRecording, trials: Sequence[int], residual: Sequence[np.ndarray], sensitivity: Sequence[np.ndarray]
) -> tuple[Noise, list[str]]:
    """Return the noise model of the listed trials, and its assumptions in words.

    From repeats among the trials (differences cancel what the model lacks), else as declared, else from second differences along
    each trial (which cancel what is smooth), its correlation from what channels do not share. Tension noise as declared, else by
    maximum likelihood from the same differences. `residual` and `sensitivity` follow `trials`.
    """
    place = {k: i for i, k in enumerate(trials)}
    pairs = [(place[a], place[b]) for a, b in repeats(prepared) if a in place and b in place]
    # The same readings again, noise included, are a copy and no repeat.
    pairs = [(a, b) for a, b in pairs if np.nan_to_num(residual[a] - residual[b]).any()]
    declared = np.array([o.channel.noise or np.nan for o in prepared.outputs])
    cells = np.array([c.noise or np.nan for c in prepared.drivers]) * np.abs(prepared.pull)
    cells = np.where(prepared.driven_by(Drive.CONTROL), 0.0, cells)  # known exactly
    drive = cells if np.isfinite(cells).all() else None
    notes = []
    member = _members(prepared)
    rho = np.zeros(member.size)
    if pairs:
        reading = prepared.reading if drive is None else drive
        d = [
            _detrended((residual[a] - residual[b]) / np.sqrt(2.0), prepared.inputs[trials[a]], sensitivity[a], member, reading)
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
            notes.append(f"no repeated trials: the noise floor is estimated from second differences and taken as {in_time}")
    D, G_all = np.concatenate(d), np.concatenate(G)
    least = _least(prepared, member)
    if source == DECLARED:
        sigma = declared
        if drive is None:
            drive = _likeliest(D, G_all, member, least, prepared.reading, sigma=declared)[1]
    else:
        sigma, fitted = _likeliest(D, G_all, member, least, prepared.reading, drive=drive)
        drive = fitted if drive is None else drive
    noise = Noise(sigma, drive, np.zeros(len(sigma)), source)
    rho, fade = _remembered(noise, d, G, member) if pairs else (rho, rho)
    noise = replace(noise, rho=rho, fade=fade)
    if not np.isfinite(cells).all():
        units = ["mm" if d is Drive.DISPLACEMENT else f"m{d.display_unit[0]}" for d in prepared.drives]
        estimates = ", ".join(f"{1e3 * d:.3g} {unit}" for d, unit in zip(drive, units, strict=True))
        notes.append(f"no noise declared for the inputs: estimated as {estimates} from the data")
    return noise, notes


def row_noise(
    prepared: PreparedRecording, residual: Sequence[np.ndarray], sensitivity: Sequence[np.ndarray], drive: np.ndarray
) -> Noise:
    """Return the noise model of rows within trials, beside the inputs' noise `drive` (n_tendon,).

    From second differences, whatever repeats show or the file declares. Outputs that were never measured have infinite noise.
    """
    d, G = (np.concatenate(x) for x in _along_rows(residual, sensitivity, np.zeros(residual[0].shape[1])))
    seen = np.isfinite(d).any(axis=0)
    sigma = np.full(d.shape[1], np.inf)
    if np.any(seen):
        member = _members(prepared)
        groups, own = np.unique(member[seen], return_inverse=True)
        sigma[seen] = _likeliest(d[:, seen], G[:, seen], own, _least(prepared, member)[groups], prepared.reading, drive=drive)[0]
    return Noise(sigma, drive, np.zeros(len(sigma)), "rows of a trial")


def _along_rows(
    residual: Sequence[np.ndarray], sensitivity: Sequence[np.ndarray], rho: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return second differences and the sensitivities that belong to them.

    They are scaled to the variance of noise with the lag-1 correlation rho (n_output,).
    """
    size = np.sqrt(6.0 - 8.0 * rho + 2.0 * rho**2)
    shrunk = np.sqrt(6.0) / size[:, None]
    return [(r[:-2] - 2 * r[1:-1] + r[2:]) / size for r in residual], [g[1:-1] * shrunk for g in sensitivity]


def _least(prepared: PreparedRecording, member: np.ndarray) -> np.ndarray:
    """Return the least noise (n_group,) of each group of outputs: `PRECISION_SHARE` of its widest channel's range."""
    whole = np.concatenate(prepared.measured)
    span = np.nan_to_num(np.fmax.reduce(whole, axis=0) - np.fmin.reduce(whole, axis=0))
    return np.array([max(PRECISION_SHARE * span[member == g].max(), SMALLEST_NOISE) for g in range(member.max() + 1)])


def _members(prepared: PreparedRecording) -> np.ndarray:
    """Return each output's group (n_output,), by its place in the order of groups."""
    groups = list(dict.fromkeys(o.group for o in prepared.outputs))
    return np.array([groups.index(o.group) for o in prepared.outputs])


def _detrended(d: np.ndarray, inputs: Inputs, G: np.ndarray, member: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Return differences of repeats d (n, m) less what may have changed between the two.

    That is a line in time in each channel, and an offset and a gain of each input, through its sensitivities G (n, m, n_tendon).
    All gains together act as a stiffness: a robot that was warmer, or older, the second time is not noise. Each is weighted by its
    expected scatter: its group's spread and the inputs' `reading` (n_tendon,). NaN where the inputs' share is `INPUT_NOISE_RATIO`
    times the spread: there tendons hold each other, a tenth of a millimetre is newtons to the twin, and the robot's compliance is
    not known.
    """
    t = (inputs.time - inputs.time[0]) / max(inputs.time[-1] - inputs.time[0], 1e-9) - 0.5
    basis = np.stack([np.ones_like(t), t], axis=1)
    felt = np.concatenate([G, G * inputs.pull[:, None, :]], axis=2)
    scale, noise = _scales(d, member)[member], np.sqrt(((G * reading) ** 2).sum(axis=2))  # (m,), (n, m)
    weight = 1.0 / np.hypot(scale, noise)
    locked = noise >= INPUT_NOISE_RATIO * scale
    d = np.where(locked & ~locked.all(axis=0), np.nan, d)  # a channel that would be left out entirely is kept
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
    """Return the robust spread (n_group,) of differences d (n, m), by group."""
    median = [np.nanmedian(np.abs(d[:, member == g])) for g in range(member.max() + 1)]
    return np.maximum(1.4826 * np.array(median), SMALLEST_NOISE)


def _likeliest(
    d: np.ndarray, G: np.ndarray, member: np.ndarray, least: np.ndarray, reading: np.ndarray, *, drive: np.ndarray | None = None,
    sigma: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return the maximum-likelihood sigma by group, at least `least` (n_group,), and that of the inputs.

    The latter is a common multiple of `reading` (n_tendon,).

    Differences are d (n, m) ~ N(0, diag sigma^2 + G diag sigma_u^2 G'). Where sigma is sought, rows whose |z|^2 noise exceeds with
    a probability below one in a million are left out, repeatedly until none is left: a body that snaps over an obstacle from row to
    row is not noisy.
    """
    present = np.isfinite(d)
    unlikely = chi2.isf(OUTLIER_PROBABILITY, np.maximum(present.sum(axis=1), 1))
    scale = np.maximum(_scales(d, member), least)
    d, G = np.where(present, d, 0.0), G * present[:, :, None]  # missing samples have no weight

    def unpack(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = sigma if sigma is not None else np.maximum(scale * np.exp(x[: len(least)]), least)[member]
        return s, drive if drive is not None else reading * np.exp(x[-1])

    def of_rows(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return each row's |z|^2 and the logarithm of its covariance's determinant."""
        s, s_u = unpack(x)
        A, r = s_u * G / s[:, None], d / s
        inner = np.eye(G.shape[2]) + np.einsum("nmt,nms->nts", A, A)
        b = np.einsum("nmt,nm->nt", A, r)
        square = (r**2).sum(axis=1) - np.einsum("nt,nt->n", b, np.linalg.solve(inner, b[..., None])[..., 0])
        return square, np.linalg.slogdet(inner)[1] + 2.0 * present @ np.log(s)

    def minus_log_likelihood(x: np.ndarray) -> float:
        square, log_determinant = of_rows(x)
        return 0.5 * float((square + log_determinant)[usual].sum())

    x = np.zeros((0 if sigma is not None else len(least)) + (drive is None))
    usual, outlying = np.zeros(len(d), dtype=bool), np.zeros(len(d), dtype=bool)
    while x.size and not np.array_equal(usual, ~outlying):
        usual = ~outlying
        x = minimize(minus_log_likelihood, x, method="L-BFGS-B", bounds=[(-3.0, 3.0)] * x.size).x
        outlying |= (of_rows(x)[0] > unlikely) & (sigma is None)
    return unpack(x)


def _remembered(
    noise: Noise, d: Sequence[np.ndarray], G: Sequence[np.ndarray], member: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the correlation of differences by group: `rho` and `fade` of a Noise, zero unless clear (3 standard errors).

    Rows x in sigmas, of the covariance C across channels, have the lagged covariances g_k I, where g_k is a sensor's own: input
    noise is independent from row to row. Those of y = C^-1 x are g_k C^-2, so that directions dominated by input noise have little
    weight, as in the score of the likelihood. Noise is AR(1) unless g_2 is clearly more than g_1^2; then s f^k is fitted to g_1 ..
    g_4.
    """
    A = [noise.drive * g / noise.sigma[:, None] * np.isfinite(x)[:, :, None] for g, x in zip(G, d, strict=True)]
    inner = [np.linalg.inv(np.eye(a.shape[2]) + a.transpose(0, 2, 1) @ a) for a in A]
    inverse = [
        np.isfinite(x)[:, :, None] * np.eye(member.size) - a @ i @ a.transpose(0, 2, 1) for x, a, i in zip(d, A, inner, strict=True)
    ]
    y = [(C @ np.nan_to_num(x / noise.sigma)[:, :, None])[:, :, 0] for x, C in zip(d, inverse, strict=True)]
    rho, fade = np.zeros(member.size), np.zeros(member.size)
    for g in range(member.max() + 1):
        own = member == g
        weight = sum(float((C[:, own] ** 2).sum()) for C in inverse)  # trace of C^-2
        spread = np.sqrt(sum(float((C[:, own][:, :, own] ** 2).sum()) for C in inverse))
        alone = sum(float(C[:, own, own].sum()) for C in inverse)  # the sensors' own part of the squares
        if not alone > 0.0:  # never measured
            continue
        power = sum(float((x[:, own] ** 2).sum()) for x in y) / alone
        lagged = np.array([sum(float((x[k:, own] * x[:-k, own]).sum()) for x in y) for k in CORRELATION_LAGS]) / (weight * power)
        sure = CLEAR_CORRELATION * spread / weight
        if lagged[0] > sure:
            rho[own] = fade[own] = min(lagged[0], LARGEST_CORRELATION)
            if lagged[1] - lagged[0] ** 2 > sure * np.sqrt(1.0 + 4.0 * lagged[0] ** 2):
                rho[own], fade[own] = _fading(lagged)
    return rho, fade


def _fading(lagged: np.ndarray) -> tuple[float, float]:
    """Return s f and f of the s f^k, s at most 1, that are nearest to the correlations `lagged` at `CORRELATION_LAGS`."""
    fade = np.linspace(max(lagged[0], 0.01), LARGEST_FADE, 200)
    powers = fade[:, None] ** np.array(CORRELATION_LAGS)
    share = np.clip(powers @ lagged / (powers**2).sum(axis=1), 0.0, 1.0)
    best = int(np.argmin(((lagged - share[:, None] * powers) ** 2).sum(axis=1)))
    return float(share[best] * fade[best]), float(fade[best])
