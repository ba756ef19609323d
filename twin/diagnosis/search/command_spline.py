"""What a command did between the rows of its log, and how surely: a smoothing spline whose stiffness is found row by row.

The command is the integral of its rate, the rate that of white noise of intensity q, one for each interval between rows; a row
reads the command with the noise of its reading. What such a spline knows of the path comes from Kalman's filter and the smoother of
Rauch, Tung and Striebel; q from expectation maximisation (Shumway and Stoffer 1982) under a prior that knows no scale, 1 / q, and a
share of it from its neighbours: stiff where a command runs evenly, loose where a ramp begins or ends. Inside, everything is in
units of a row's interval and of the reading's noise.
"""

from dataclasses import dataclass

import numpy as np

from twin.diagnosis.thresholds import LEAST_COMMAND_NOISE, LEAST_SPLINE_COMPLIANCE, MOMENTS_PER_ROW, NEIGHBOUR_WEIGHT, SPLINE_ROUNDS


@dataclass(frozen=True)
class SmoothedCommand:
    """Commands between rows: `time` (n_fine,), `mean` (n_fine, n_tendon), and the `variance` (n_fine,) of each of them."""

    time: np.ndarray
    mean: np.ndarray
    variance: np.ndarray


def smooth_command(time: np.ndarray, command: np.ndarray, noise: float) -> SmoothedCommand:
    """Of rows at `time` (n,) s with `command` (n, n_tendon), read with `noise`; `MOMENTS_PER_ROW` moments for each row."""
    n = len(command)
    unit = max(noise, LEAST_COMMAND_NOISE * float(np.ptp(command, axis=0).max()), 1e-12)
    fine = np.interp(np.arange((n - 1) * MOMENTS_PER_ROW + 1) / MOMENTS_PER_ROW, np.arange(n), time)
    interval = float(np.median(np.diff(time)))
    q = _intensity(np.diff(time) / interval, command / unit)
    found = _smooth(np.diff(fine) / interval, np.repeat(q, MOMENTS_PER_ROW), np.arange(n) * MOMENTS_PER_ROW, command / unit)
    return SmoothedCommand(fine, unit * found.state[:, 0], unit**2 * found.spread[:, 0, 0])


@dataclass(frozen=True)
class _Smoothed:
    """Command and rate (n, 2, n_column), their covariance (n, 2, 2), and that with the moment before (n, 2, 2)."""

    state: np.ndarray
    spread: np.ndarray
    across: np.ndarray


def _intensity(step: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """q (n - 1,) of every interval between rows (n, n_tendon), which are `step` long."""
    tendons = rows.shape[1]
    q = np.full(
        len(step),
        max(LEAST_SPLINE_COMPLIANCE, float(np.mean(np.diff(rows, 2, axis=0) ** 2))) if len(step) > 1 else LEAST_SPLINE_COMPLIANCE,
    )
    for _ in range(SPLINE_ROUNDS):
        found = _smooth(step, q, np.arange(len(rows)), rows)
        F, unit = _steps(step)
        went = found.state[1:] - F @ found.state[:-1]
        turn = F @ np.swapaxes(found.across[1:], 1, 2)
        spread = found.spread[1:] - turn - np.swapaxes(turn, 1, 2) + F @ found.spread[:-1] @ np.swapaxes(F, 1, 2)
        square = np.einsum("nac,nab,nbc->n", went, np.linalg.inv(unit), went)
        square += tendons * np.einsum("nab,nba->n", np.linalg.inv(unit), spread)
        square = np.convolve(
            np.pad(square, 1, mode="edge"), [NEIGHBOUR_WEIGHT, 1.0 - 2.0 * NEIGHBOUR_WEIGHT, NEIGHBOUR_WEIGHT], mode="valid"
        )
        q = np.maximum(LEAST_SPLINE_COMPLIANCE, square / (2 * tendons + 2))
    return q


def _steps(step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How command and rate go on over each step, and the covariance of what white noise of unit intensity adds (n, 2, 2)."""
    F, Q = np.tile(np.eye(2), (len(step), 1, 1)), np.empty((len(step), 2, 2))
    F[:, 0, 1] = step
    Q[:, 0, 0], Q[:, 0, 1], Q[:, 1, 1] = step**3 / 3.0, step**2 / 2.0, step
    Q[:, 1, 0] = Q[:, 0, 1]
    return F, Q


def _smooth(step: np.ndarray, q: np.ndarray, read: np.ndarray, rows: np.ndarray) -> _Smoothed:
    """Of `rows` (n_row, n_column), read with unit noise at the moments `read` of those that `step` (n - 1,) lies between."""
    F, Q = _steps(step)
    Q = q[:, None, None] * Q
    n, reading = len(step) + 1, dict(zip(read.tolist(), rows, strict=True))
    state, spread = np.zeros((n, 2, rows.shape[1])), np.zeros((n, 2, 2))
    ahead, wide = state.copy(), spread.copy()
    state[0, 0], far = rows[0], 10.0 * (1.0 + float(np.abs(rows).max()))
    spread[0] = far**2 * np.eye(2)
    for i in range(n):
        if i:
            ahead[i], wide[i] = F[i - 1] @ state[i - 1], F[i - 1] @ spread[i - 1] @ F[i - 1].T + Q[i - 1]
        else:
            ahead[0], wide[0] = state[0], spread[0]
        state[i], spread[i] = ahead[i], wide[i]
        if (row := reading.get(i)) is not None:
            gain = wide[i][:, 0] / (wide[i][0, 0] + 1.0)
            state[i] = ahead[i] + gain[:, None] * (row - ahead[i][0])
            keep = np.eye(2) - np.outer(gain, [1.0, 0.0])
            spread[i] = keep @ wide[i] @ keep.T + np.outer(gain, gain)
    across = np.zeros((n, 2, 2))
    for i in range(n - 2, -1, -1):
        back = spread[i] @ F[i].T @ np.linalg.inv(wide[i + 1])
        state[i] = state[i] + back @ (state[i + 1] - ahead[i + 1])
        across[i + 1] = spread[i + 1] @ back.T
        # P - G W G' as a sum of squares (Joseph's form): a difference of nearly equal numbers would come out below zero
        keep = np.eye(2) - back @ F[i]
        spread[i] = keep @ spread[i] @ keep.T + back @ (Q[i] + spread[i + 1]) @ back.T
    return _Smoothed(state, spread, across)
