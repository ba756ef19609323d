"""What a fitted model would do on each of its own trials, had it been fitted to the others."""

from __future__ import annotations

import itertools

import numpy as np

from twin.calibrate import Fit, Objective, prior_weight


def left_out(objective: Objective, fit: Fit) -> float:
    """Mean square (sigma^2) of the residual on trials left out in turn, to first order.

    Without trial g the fit moves by d = (sum_(k != g) J_k' J_k + P)^-1 J_g' z_g and z_g becomes z_g + J_g d: no fit is repeated.
    Parameters at an end of their range stay there. Allen (1974), PRESS, by trials.
    """
    moving = np.flatnonzero(~fit.at_bound())
    J = fit.J[:, moving]
    prior = np.diag(prior_weight(fit.model)[moving] ** 2) + 1e-9 * np.eye(len(moving))
    ends = np.cumsum([0, *(objective.bench.measured[k].size for k in objective.trials)])
    parts = [(J[start:end], fit.z[start:end]) for start, end in itertools.pairwise(ends)]
    information = np.stack([rows.T @ rows for rows, _ in parts])
    total = 0.0
    for k, (rows, z) in enumerate(parts):
        others = np.delete(information, k, axis=0).sum(axis=0) + prior  # summed, not subtracted: a trial may alone show something
        total += float(((z + rows @ np.linalg.solve(others, rows.T @ z)) ** 2).sum())
    return total / objective.n
