"""The noise model on data whose noise is known: white, correlated, with a robot that changed between repeats, and made white."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from twin.diagnosis.noise.estimate import estimate_noise, repeats
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import ROW_SYNCHRONY, SLACK_READING, Whitener
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import PreparedRecording, prepare
from twin.robots import load

ROBOT = load("continuum")
N, SIGMA = 400, 2e-4  # samples a trial; m
TIME = np.linspace(0.0, 40.0, N)
PULL = np.stack([1.0 + np.sin(0.5 * TIME), 0.5 + 0.01 * TIME, 0.3 * np.cos(TIME) ** 2], axis=1)  # N
CHANNELS = (
    *(Channel(f"tendon_{i}_tension", "input", "N", 0.01) for i in (1, 2, 3)),
    *(Channel(f"disk_8_{a}", "output", "mm") for a in "xyz"),
)
DEAF = [np.zeros((N, 3, 3))] * 2  # outputs that do not feel the inputs


def bench(
    *, payload: float = 0.0, further: float = 0.0, slower: float = 1.0, channels: tuple[Channel, ...] = CHANNELS
) -> PreparedRecording:
    """Two trials with the same commands, the second with a payload, its tensions `further` (N) and `slower` by a factor."""
    trials = []
    for k, (mass, more, pace) in enumerate([(0.0, 0.0, 1.0), (payload, further, slower)]):
        values = {c.name: np.zeros(N) for c in CHANNELS} | {f"tendon_{i + 1}_tension": PULL[:, i] + more for i in range(3)}
        trials.append(Trial(f"{k}.csv", pace * TIME, values, {"tip_payload": mass}, start=100.0 * k))
    return prepare(Recording("continuum", "made", "simulation: none", np.zeros(3), channels, tuple(trials)), ROBOT)


TWO = bench()


def coloured(rng: np.random.Generator, rho: float, n: int = N) -> np.ndarray:
    """AR(1) noise (n, 3) of unit variance, from its stationary start."""
    x = rng.normal(size=(n, 3))
    for i in range(1, n):
        x[i] = rho * x[i - 1] + np.sqrt(1 - rho**2) * x[i]
    return x


def estimated(residual: list[np.ndarray], G: list[np.ndarray] = DEAF) -> Noise:
    return estimate_noise(TWO, [0, 1], residual, G)[0]


def test_the_noise_is_found_with_its_memory() -> None:
    """1,200 differences of two trials: sigma to 2 % for white noise (1 / sqrt(2 n)), three times that where ten neighbours are
    alike; rho to 2 % beside the 1 / N a line taken out costs."""
    rng = np.random.default_rng(0)
    for rho in (0.0, 0.5, 0.8):
        noise = estimated([SIGMA * coloured(rng, rho) for _ in range(2)])
        np.testing.assert_allclose(noise.sigma, SIGMA, rtol=0.06 if rho < 0.6 else 0.15)
        np.testing.assert_allclose(noise.rho, rho, atol=0.06)
        np.testing.assert_array_equal(noise.drive, 0.01)  # as declared
        assert noise.source == "1 pairs of repeated trials"


def test_what_lasts_is_told_from_what_is_white_beside_it() -> None:
    """Six tenths of the noise remember by 0.85, the rest is white: rho 0.51 and fade 0.85, each to 0.06 of 3,600 numbers ten of
    which are alike. All of it AR(1), it stays that in all but 1 of 741 days a sensor (of 40 at most one)."""
    rng = np.random.default_rng(21)
    n = len(TIME)
    found = [
        estimated([SIGMA * (np.sqrt(0.6) * coloured(rng, 0.85) + np.sqrt(0.4) * rng.normal(size=(n, 3))) for _ in range(2)])
        for _ in range(12)
    ]
    np.testing.assert_allclose([f.rho for f in found], 0.51, atol=0.12)
    np.testing.assert_allclose([f.lasting[1] for f in found], 0.85, atol=0.12)
    np.testing.assert_allclose(np.mean([f.rho for f in found]), 0.51, atol=0.03)
    np.testing.assert_allclose(np.mean([f.lasting[0] for f in found]), 0.6, atol=0.06)
    alone = [estimated([SIGMA * coloured(rng, 0.6) for _ in range(2)]) for _ in range(40)]
    assert sum(f.lasting[0][0] < 1.0 for f in alone) <= 1


def test_noise_of_a_mean_is_that_of_the_sum_of_its_covariance() -> None:
    """1' C 1 / n^2 with C the whole covariance of 2,000 rows; the ends of a trial tell of it to a row's memory in 2,000."""
    n, sigma = 2000, np.array([2.0, 2.0, 2.0])
    rho, fade = np.array([0.0, 0.5, 0.3]), np.array([0.0, 0.5, 0.9])
    noise = Noise(sigma, np.zeros(1), rho, "made", fade)
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    for j in range(3):
        C = np.where(lag == 0, 1.0, rho[j] * fade[j] ** np.maximum(lag - 1.0, 0.0)) * sigma[j] ** 2
        assert noise.in_means(n)[j] == pytest.approx(np.sqrt(C.sum()) / n, rel=0.01)


def test_white_noise_is_called_correlated_no_oftener_than_three_standard_errors_are_exceeded() -> None:
    """One-sided, 1 in 741: of 150 days at most two (more: 1 in 1,000). Noise correlated by six standard errors is caught always but
    for 1 in 741 (one of three below); a bar at 30 or at 0.3 standard errors fails here."""
    rng = np.random.default_rng(1)
    white = sum(estimated([SIGMA * rng.normal(size=(N, 3)) for _ in range(2)]).rho[0] > 0.0 for _ in range(150))
    assert white <= 2
    rho = 6.0 / np.sqrt(3 * N)
    caught = sum(estimated([SIGMA * coloured(rng, rho) for _ in range(2)]).rho[0] > 0.0 for _ in range(40))
    assert caught >= 38


def test_what_changed_between_repeats_is_not_noise() -> None:
    """The second time each channel starts elsewhere and drifts, each load cell has another zero and the robot another stiffness: a
    hundred times the noise, and it is taken out; sigma is what was drawn, to its own 2 % and the nine numbers spent of 1,200."""
    rng = np.random.default_rng(2)
    G = rng.normal(size=(N, 3, 3)) * 1e-3 * (1.0 + 0.3 * np.sin(np.outer(TIME, [0.2, 0.3, 0.4])))[:, :, None]
    changed = 0.02 * np.outer(TIME / 40.0, [1.0, -1.0, 0.5]) + 0.01
    changed += np.einsum("nmt,nt->nm", G, np.array([3.0, -2.0, 1.0]) + 5.0 * PULL)
    residual = [SIGMA * rng.normal(size=(N, 3)), SIGMA * rng.normal(size=(N, 3)) + changed]
    assert np.std(changed) > 30 * SIGMA
    # The load cells' declared 0.01 N reach the markers as 0.01 sqrt(3) mm through G, some 1e-5 m of the 2e-4 drawn.
    np.testing.assert_allclose(estimated(residual, [G, G]).sigma, SIGMA, rtol=0.06)


def test_tensions_that_lengths_hold_do_not_say_alone_what_inputs_did() -> None:
    """Lengths drive, with 0.02 mm of noise; three tensions and a marker are logged. In a tenth of the rows the twin's tendons hold
    each other, and a tension changes by 1e5 N/m; the real ones give way, and it changes by a hundredth of that. The zeros of the
    drives moved between the repeats, by which the marker is off by 1.4 of its sigmas. Every sigma is what was drawn, to 2 % (1,080
    and 1,200 differences), the tensions' less some for the rows that are believed to be noisier than they are."""
    channels = (
        *(Channel(f"tendon_{i}_displacement", "input", "mm", 2e-5) for i in (1, 2, 3)),
        *(Channel(f"tendon_{i}_tension", "output", "N") for i in (1, 2, 3)),
        *(Channel(f"disk_8_{a}", "output", "mm") for a in "xyz"),
    )
    values = {c.name: np.zeros(N) for c in channels} | {f"tendon_{i + 1}_displacement": 5e-3 * PULL[:, i] for i in range(3)}
    trials = tuple(Trial(f"{k}.csv", TIME, values, {"tip_payload": 0.0}, start=100.0 * k) for k in range(2))
    held = prepare(Recording("continuum", "made", "simulation: none", np.zeros(3), channels, trials), ROBOT)
    rng = np.random.default_rng(7)
    G = np.concatenate([rng.normal(size=(N, 3, 3)) * 5.0, rng.normal(size=(N, 3, 3)) * 5.0], axis=1)
    G[::10, :3] = 1e5 * np.sign(rng.normal(size=(N // 10, 3, 3)))
    sigma = np.repeat([0.02, SIGMA], 3)
    real = np.where(np.abs(G) > 1e4, 0.01 * G, G)
    moved = [2e-5 * rng.normal(size=(N, 3)) + zero for zero in ([0.0, 0.0, 0.0], [5e-5, -2.5e-5, 1e-5])]
    residual = [np.einsum("nmt,nt->nm", real, m) + sigma * rng.normal(size=(N, 6)) for m in moved]
    assert [o.group for o in held.outputs] == ["tension"] * 3 + ["marker"] * 3
    noise, _ = estimate_noise(held, [0, 1], residual, [G, G])
    np.testing.assert_allclose(noise.sigma, sigma, rtol=0.06)
    assert (noise.rho == 0.0).all()


def test_a_missing_sample_is_no_noise() -> None:
    rng = np.random.default_rng(3)
    residual = [SIGMA * rng.normal(size=(N, 3)) for _ in range(2)]
    residual[0][::3, 1] = np.nan
    np.testing.assert_allclose(estimated(residual).sigma, SIGMA, rtol=0.06)


def test_without_repeats_noise_is_read_off_second_differences_and_said() -> None:
    """A residual that is smooth and a hundred times the noise is none of it."""
    lone = bench(payload=0.01)
    rng = np.random.default_rng(4)
    smooth = 100 * SIGMA * np.sin(0.3 * TIME)[:, None]
    residual = [SIGMA * rng.normal(size=(N, 3)) + smooth for _ in range(2)]
    noise, notes = estimate_noise(lone, [0, 1], residual, DEAF)
    np.testing.assert_allclose(noise.sigma, SIGMA, rtol=0.06)  # 2,400 second differences, each kin to four others
    np.testing.assert_array_equal(noise.rho, 0.0)
    assert "second differences" in noise.source
    assert len(notes) == 1


def test_outputs_without_noise_are_known_to_a_hundred_thousandth_of_their_range() -> None:
    """A rollout's own: smooth but for rounding. The widest channel of a group counts, 0.21 m; noise that is declared stands."""
    lone = bench(payload=0.01)
    path = np.stack([np.linspace(0.0, 0.2, N), np.linspace(0.0, 0.1, N), np.full(N, np.nan)], axis=1)
    exact = replace(lone, measured=(path, path + 0.01))
    residual = [1e-9 * np.sin(TIME)[:, None] * np.ones(3)] * 2
    np.testing.assert_allclose(estimate_noise(exact, [0], residual[:1], DEAF[:1])[0].sigma, 2.1e-6)
    fine = (*CHANNELS[:3], *(replace(c, noise=1e-9) for c in CHANNELS[3:]))
    declared = replace(bench(payload=0.01, channels=fine), measured=exact.measured)
    np.testing.assert_array_equal(estimate_noise(declared, [0], residual[:1], DEAF[:1])[0].sigma, 1e-9)


def test_a_robot_that_snaps_from_row_to_row_is_not_noisy() -> None:
    """A body that slips over an obstacle in every twentieth row, by twenty to fifty sigma; what is noise is cut in one row of a
    million. Cells whose noise nobody declared are found beside it, where they move markers by up to twice the markers' own."""
    lone = bench(payload=0.01)
    rng = np.random.default_rng(9)
    snaps = np.where(np.arange(N) % 20 == 0, SIGMA * rng.uniform(20.0, 50.0, size=N), 0.0)[:, None]
    residual = [SIGMA * rng.normal(size=(N, 3)) for _ in range(2)]
    residual[1] = residual[1] + snaps
    noise, _ = estimate_noise(lone, [0, 1], residual, DEAF)
    np.testing.assert_allclose(noise.sigma, SIGMA, rtol=0.06)
    silent = (*(Channel(f"tendon_{i}_tension", "input", "N") for i in (1, 2, 3)), *CHANNELS[3:])
    G = np.tile(SIGMA / 0.01 * np.eye(3), (N, 1, 1)) * (1.0 + np.sin(0.2 * TIME))[:, None, None]
    felt = [r + np.einsum("nij,nj->ni", G, 0.01 * rng.normal(size=(N, 3))) for r in residual]
    noise, _ = estimate_noise(bench(payload=0.01, channels=silent), [0, 1], felt, [G, G])
    np.testing.assert_allclose(noise.sigma, SIGMA, rtol=0.1)
    np.testing.assert_allclose(noise.drive, 0.01, rtol=0.1)  # told from the markers' own by how they vary: less surely


def test_repeats_have_the_same_loads_and_the_same_commands_but_for_noise() -> None:
    assert repeats(TWO) == [(0, 1)]
    assert repeats(bench(payload=1e-3)) == []
    # Commands span 2 N: 3 % of it, 0.06 N, is within what repeats differ by.
    assert repeats(bench(further=0.05)) == [(0, 1)]
    assert repeats(bench(further=0.08)) == []
    # The same way at another pace shows what depends on the rate; clocks and hands differ by less than 3 %.
    assert repeats(bench(slower=1.02)) == [(0, 1)]
    assert repeats(bench(slower=1.04)) == repeats(bench(slower=0.5)) == []


def test_whitened_noise_is_white_whatever_drives_and_wherever_samples_lack() -> None:
    """Marker noise with memory, and that of load cells through G, each drawn by its own recipe: unit variance, no correlation
    between rows or channels."""
    rng = np.random.default_rng(5)
    n, rho, cell = 20000, 0.6, 0.02
    G = rng.normal(size=(n, 3, 3)) * 0.01
    sigma = np.array([1e-4, 2e-4, 3e-4])
    for kind in ("memory", "cells"):
        noise = Noise(sigma, np.full(3, cell if kind == "cells" else 1e-9), np.full(3, rho if kind == "memory" else 0.0), "made")
        x = sigma * (coloured(rng, rho, n) if kind == "memory" else rng.normal(size=(n, 3)))
        if kind == "cells":
            x = x + np.einsum("nmt,nt->nm", G, cell * rng.normal(size=(n, 3)))
        x[rng.random((n, 3)) < 0.2] = np.nan
        z = Whitener(noise, [x], [G], [np.zeros((n, 3))]).trial(0, x)
        seen = np.isfinite(x)
        assert np.all(z[~seen] == 0.0)
        np.testing.assert_allclose([np.mean(z[seen[:, j], j] ** 2) for j in range(3)], 1.0, atol=0.04)  # 16,000 squares: 1.1 %
        both = seen[:, 0] & seen[:, 1]
        assert abs(np.mean(z[both, 0] * z[both, 1])) < 0.04
        assert abs(np.mean(z[1:] * z[:-1])) < 0.02


def test_whitening_turns_the_covariance_into_one_exactly() -> None:
    """W C W' = 1: of rows, C_ij = sigma^2 rho^|i - j| with any of them missing; of channels, C = sigma^2 + G s s' G' with
    s^2 = drive^2 + (ROW_SYNCHRONY times the larger of the command's changes before and after the row)^2."""
    n, rho, sigma = 6, 0.6, 2.0
    rows = np.arange(n)
    for lacking in ([], [0], [2], [2, 3], [0, 1], [5]):
        y = np.where(np.isin(rows, lacking), np.nan, 0.0)[:, None]
        noise = Noise(np.array([sigma]), np.array([1e-9]), np.array([rho]), "made")
        whitener = Whitener(noise, [y], [np.zeros((n, 1, 1))], [np.zeros((n, 1))])
        W = np.column_stack([whitener.trial(0, e[:, None])[:, 0] for e in np.eye(n)])
        one = W @ (sigma**2 * rho ** np.abs(rows[:, None] - rows)) @ W.T
        np.testing.assert_allclose(one, np.diag(np.isfinite(y[:, 0]).astype(float)), atol=1e-12)
    rng = np.random.default_rng(7)
    command = np.array([[0.0], [0.0], [1.0], [3.0], [3.0], [3.0]])
    G, sigmas, drive = rng.normal(size=(n, 3, 1)), rng.uniform(1.0, 2.0, 3), 0.1
    whitener = Whitener(Noise(sigmas, np.array([drive]), np.zeros(3), "made"), [np.zeros((n, 3))], [G], [command])
    W = np.stack([whitener.trial(0, np.broadcast_to(e, (n, 3))) for e in np.eye(3)], axis=2)
    for i, change in enumerate([0.0, 1.0, 2.0, 2.0, 0.0, 0.0]):
        C = np.diag(sigmas**2) + G[i] @ G[i].T * (drive**2 + (ROW_SYNCHRONY * change) ** 2)
        np.testing.assert_allclose(W[i] @ C @ W[i].T, np.eye(3), atol=1e-12)


def test_readings_noise_beside_noise_that_remembers_is_made_one_exactly() -> None:
    """W C W' = 1 for C = sigma sigma' rho^|i - j| + G_i s s' G_i' at i = j alone; with channels that lack rows to a hundredth, what
    is left of an earlier reading's noise being told as each one's own. As if what inputs add remembered too, it is not white."""
    n, m, rho, rng = 7, 4, 0.6, np.random.default_rng(12)
    G, sigma, drive = rng.normal(size=(n, m, 2)), rng.uniform(1.0, 2.0, m), np.array([0.9, 1.7])
    noise = Noise(sigma, drive, np.full(m, rho), "made")
    rows = np.arange(n)
    C = np.einsum("ij,kl->ikjl", rho ** np.abs(rows[:, None] - rows), np.diag(sigma**2))
    for i in rows:
        C[i, :, i, :] += (G[i] * drive**2) @ G[i].T
    C = C.reshape(n * m, n * m)

    def matrix(whitener: Whitener) -> np.ndarray:
        return np.column_stack([whitener.trial(0, e.reshape(n, m)).ravel() for e in np.eye(n * m)])

    whole = matrix(Whitener(noise, [np.zeros((n, m))], [G], [np.zeros((n, 2))]))
    np.testing.assert_allclose(whole @ C @ whole.T, np.eye(n * m), atol=1e-9)
    np.testing.assert_allclose(np.triu(whole.reshape(n, m, n, m).sum(axis=(1, 3)), 1), 0.0, atol=1e-12)  # from the past alone
    lacking = np.zeros((n, m))
    lacking[2, 0] = lacking[4, 1:3] = np.nan
    holed = matrix(Whitener(noise, [lacking], [G], [np.zeros((n, 2))]))
    np.testing.assert_allclose(holed @ C @ holed.T, np.diag(np.isfinite(lacking).ravel().astype(float)), atol=0.05)
    apart = matrix(Whitener(replace(noise, rho=np.zeros(m)), [np.zeros((n, m))], [G], [np.zeros((n, 2))]))
    both = np.kron(np.linalg.inv(np.linalg.cholesky(rho ** np.abs(rows[:, None] - rows))), np.eye(m)) @ apart
    assert np.abs(both @ C @ both.T - np.eye(n * m)).max() > 0.3


def test_noise_that_lasts_beside_white_noise_is_made_one() -> None:
    """Exactly where no reading's noise is felt, whatever rows lack; to 4 % where one is, whose memory in rows before the last is
    told as if they felt it as the last does. As AR(1) of the same correlation it is not: 20 % are left at the next rows."""
    n, m, share, fade, rng = 12, 4, 0.6, 0.85, np.random.default_rng(14)
    rows = np.arange(n)
    own = np.where(np.eye(n) > 0, 1.0, share * fade ** np.abs(rows[:, None] - rows))
    sigma, drive, G = rng.uniform(1.0, 2.0, m), np.array([0.9, 1.7]), rng.normal(size=(m, 2))
    every, still = [np.broadcast_to(G, (n, m, 2))], [np.zeros((n, 2))]

    def left(noise: Noise, measured: np.ndarray) -> np.ndarray:
        whitener = Whitener(noise, [measured], every, still)
        W = np.column_stack([whitener.trial(0, e.reshape(n, m)).ravel() for e in np.eye(n * m)])
        C = np.kron(own, np.diag(sigma**2)) + np.kron(np.eye(n), (G * noise.drive**2) @ G.T)
        return np.abs(W @ C @ W.T - np.diag(np.isfinite(measured).ravel().astype(float)))

    lacking = np.zeros((n, m))
    lacking[2, 0] = lacking[4, 1:3] = lacking[0, 3] = lacking[11, 3] = np.nan
    lasting = Noise(sigma, np.zeros(2), np.full(m, share * fade), "made", np.full(m, fade))
    assert left(lasting, lacking).max() < 1e-9
    assert left(replace(lasting, drive=drive), np.zeros((n, m))).max() < 0.04
    assert left(replace(lasting, fade=None), np.zeros((n, m))).max() > 0.2


def test_what_a_taut_tendon_hears_is_the_square_of_its_whitened_noise() -> None:
    """s g' C^-1 g s for a row's noise s of one reading, C the whole trial's covariance: rows white and 0.6 alike, channels that
    share both."""
    n, m, rng = 30, 3, np.random.default_rng(9)
    G, taut, sigma, drive = (rng.normal(size=(m, 2)), rng.normal(size=(m, 2)), rng.uniform(1.0, 2.0, m), np.array([0.3, 0.8]))
    rows = np.arange(n)
    for rho in (0.0, 0.6):
        noise = Noise(sigma, drive, np.full(m, rho), "made")
        every, empty = np.broadcast_to(taut, (n, m, 2)), [np.zeros((n, m))]
        whitener = Whitener(noise, empty, [np.broadcast_to(G, (n, m, 2))], [np.zeros((n, 2))], [every])
        own = (rho ** np.abs(rows[:, None] - rows)) if rho else np.eye(n)
        inverse = np.linalg.inv(np.kron(own, np.diag(sigma**2)) + np.kron(np.eye(n), (G * drive**2) @ G.T)).reshape(n, m, n, m)
        within = inverse[rows, :, rows, :]
        expected = np.einsum("mt,nmk,kt->nt", drive * taut, within, drive * taut)
        np.testing.assert_allclose(whitener.input_noise_energy[0], expected, rtol=1e-6)
        np.testing.assert_array_equal(whitener.of([0]).input_noise_energy[0], whitener.input_noise_energy[0])
    blind = Whitener(noise, [np.full((n, m), np.nan)], [every], [np.zeros((n, 2))])
    np.testing.assert_array_equal(blind.input_noise_energy[0], 0.0)


def test_a_false_law_that_silences_a_tendon_does_not_win_by_it() -> None:
    """A tendon rests at 0.1 N under a cell of 0.03 N, and bends a linear robot by S. To call it slack, beside a robot that is bent
    by S 0.1 N anyhow, takes the noise off |z|^2: g^2 / (1 + g^2) a row, g^2 = 10.4 being what it adds in squared sigmas; 3,650
    in all. What that noise adds put back, the two are alike, to within three standard errors of a sum of 4,000 squares."""
    n, m, sigma, drive, rng = 4000, 3, 1e-4, 0.03, np.random.default_rng(10)
    S = np.array([[4e-3], [-6e-3], [8e-3]])
    read = 0.1 + drive * rng.normal(size=(n, 1))
    measured = 0.1 * S.T + sigma * rng.normal(size=(n, m))
    noise = Noise(np.full(m, sigma), np.array([drive]), np.zeros(m), "made")
    whitener = Whitener(noise, [measured], [np.broadcast_to(S, (n, m, 1))], [np.zeros((n, 1))])
    taut, slack = (whitener.trial(0, measured - u @ S.T) for u in (read, np.full((n, 1), 0.1)))
    won = float((taut**2).sum() - (slack**2).sum())
    heard = float(whitener.input_noise_energy[0].sum())
    assert heard == pytest.approx(n * 10.44 / 11.44)
    assert won > 0.8 * n
    assert abs(won - heard) < 3.0 * np.sqrt(2.0 * n)


def test_the_noise_that_slack_cuts_off_is_the_share_of_readings_that_it_silences() -> None:
    """Var max(0, x + e), e ~ N(0, 1), is (x^2 + 1) P + x p - (x P + p)^2, P and p the normal law's at x: what it lacks of 1 is
    P(x + e < 0.4) to 0.03, where counting the slack alone, P(x + e < 0), lacks 0.16 of it at the boundary."""
    x = np.linspace(-4.0, 4.0, 81)
    P, p = norm.cdf(x), norm.pdf(x)
    cut = 1.0 - ((x**2 + 1.0) * P + x * p - (x * P + p) ** 2)
    np.testing.assert_allclose(norm.cdf(SLACK_READING - x), cut, atol=0.03)
    assert np.abs(norm.cdf(-x) - cut).max() > 0.15
    e = np.random.default_rng(11).normal(size=400_000)  # the closed form, to four standard errors of a variance
    for at in (-1.0, 0.0, 1.0):
        assert 1.0 - np.var(np.maximum(0.0, at + e)) == pytest.approx(np.interp(at, x, cut), abs=4.0 * np.sqrt(2.0 / e.size))


def test_noise_with_a_long_memory_is_taken_for_nine_tenths() -> None:
    rng = np.random.default_rng(8)
    np.testing.assert_array_equal(estimated([SIGMA * coloured(rng, 0.98) for _ in range(2)]).rho, 0.9)


def test_the_floor_is_the_cameras_noise_and_that_of_the_cells() -> None:
    """RMS distance of a marker: sqrt(sum over x, y, z of sigma^2 + sum over tendons (G sigma_T)^2)."""
    noise = Noise(np.array([1e-4, 2e-4, 2e-4]), np.array([0.01, 0.0, 0.02]), np.zeros(3), "made")
    G = np.zeros((N, 3, 3))
    G[:, 0, 0], G[:, 1, 2], G[:, 2, 1] = 0.04, 0.01, 5.0
    expected = np.sqrt(1e-8 + 4e-8 + 4e-8 + (4e-4) ** 2 + (2e-4) ** 2)
    assert noise.floor(TWO, [G, G])["marker"] == pytest.approx(expected)


def test_load_cells_of_which_one_says_nothing_are_all_estimated_and_that_is_said() -> None:
    """Noise of 0.05 N a cell, felt through G by three outputs whose own is far less: found to some 5 % (3,600 numbers, with the
    outputs' own to be told from it), whatever two of the cells declare."""
    rng = np.random.default_rng(6)
    silent = (*CHANNELS[:2], Channel("tendon_3_tension", "input", "N"), *CHANNELS[3:])
    G = rng.normal(size=(N, 3, 3)) * 0.04
    felt = [np.einsum("nmt,nt->nm", G, 0.05 * rng.normal(size=(N, 3))) + SIGMA * rng.normal(size=(N, 3)) for _ in range(2)]
    noise, notes = estimate_noise(bench(channels=silent), [0, 1], felt, [G, G])
    np.testing.assert_allclose(noise.drive, 0.05, rtol=0.1)
    assert any(re.search(r"no noise declared for the inputs: estimated as (\d+(\.\d+)? mN(, | from)){3}", n) for n in notes)
    assert estimate_noise(TWO, [0, 1], felt, [G, G])[0].drive.tolist() == [0.01] * 3


def test_what_is_declared_is_used_and_what_is_not_is_found() -> None:
    """Without repeats: markers that all declare their noise have it, and that of silent cells is found beside it (2,400 numbers,
    each kin to four others: 4 %); where one of the markers is silent all are estimated."""
    rng = np.random.default_rng(9)
    told = tuple(Channel(c.name, "output", "mm", 2 * SIGMA) for c in CHANNELS[3:])
    cells = tuple(Channel(c.name, "input", "N") for c in CHANNELS[:3])
    G = np.repeat(rng.normal(size=(1, 3, 3)) * 0.04, N, axis=0)
    noises = [2 * SIGMA * rng.normal(size=(N, 3)) for _ in range(2)]
    felt = [x + np.einsum("nmt,nt->nm", G, 0.05 * rng.normal(size=(N, 3))) for x in noises]
    noise, _ = estimate_noise(bench(payload=0.01, channels=(*cells, *told)), [0, 1], felt, [G, G])
    assert noise.source == "as declared"
    np.testing.assert_array_equal(noise.sigma, 2 * SIGMA)
    np.testing.assert_allclose(noise.drive, 0.05, rtol=0.12)
    partly = (*CHANNELS[:3], told[0], *CHANNELS[4:])
    noise, _ = estimate_noise(bench(payload=0.01, channels=partly), [0, 1], noises, DEAF)
    np.testing.assert_allclose(noise.sigma, 2 * SIGMA, rtol=0.06)
