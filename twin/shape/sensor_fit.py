"""R0 and kappa of all sensors from strains that are known up to a covariance, by generalised least squares:

    sqrt(R) = sqrt(R0) (1 + kappa+ max(eps, 0) + kappa- min(eps, 0)),       eps = eps_shape + e,  e ~ N(0, C) in every sample

C ties the sensors together: of a shape seen from one side the length is known worst, which shifts all strains alike; so the fit
goes by their differences there, and by all of them where tendons of known length give the shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from twin.quantities import Fitted, Parameter
from twin.twin import Twin

FREE, PUSHED = 4e-4, 1e-3  # what strains of shapes by tendons and by clouds are wrong by besides: the twin's own error
OHM = 0.3  # noise of a resistance
UNKNOWN = 1e3  # of a strain that is not there
NAMES = ("resistance", "stretch", "compression")


@dataclass(frozen=True)
class Known:
    """Strains (n, s) that shapes have, resistances (n, s) ohm measured there, NaN where missing, covariance (n, s, s) of
    strains."""

    strain: np.ndarray
    resistance: np.ndarray
    covariance: np.ndarray


def fit_sensors(known: Known, twin: Twin) -> dict[str, Fitted]:
    """The sensors' numbers by their parameters' names; of sensors that say nothing none."""
    priors, s = {p.name: p for p in twin.robot.nuisance}, known.strain.shape[1]
    mine = [priors[f"sensors.{name}_{i + 1}"] for name in NAMES for i in range(s)]
    there = np.isfinite(known.resistance)
    values, stds = _fit(known, there, mine)
    return {
        p.name: Fitted(float(value), float(std), p.unit)
        for k, (p, value, std) in enumerate(zip(mine, values, stds, strict=True)) if there[:, k % s].any()
    }  # fmt: skip


def _fit(known: Known, there: np.ndarray, priors: Sequence[Parameter]) -> tuple[np.ndarray, np.ndarray]:
    mean, spread = np.array([p.value for p in priors]), np.array([p.std or np.inf for p in priors])
    low, high = np.array([p.low for p in priors]), np.array([p.high for p in priors])
    eps, root = known.strain, np.sqrt(np.where(there, known.resistance, 1.0))
    noise = np.where(there, OHM / (2.0 * root**2), UNKNOWN)
    diagonal = np.arange(eps.shape[1])
    covariance = known.covariance.copy()
    covariance[:, diagonal, diagonal] += noise**2
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))

    def residual(x: np.ndarray) -> np.ndarray:
        rest, stretch, compression = x.reshape(3, -1)
        away = np.sqrt(rest) * (1.0 + np.where(eps > 0.0, stretch, compression) * eps) / root - 1.0
        return np.einsum("nij,nj->ni", whiten, np.where(there, away, 0.0)).ravel()

    start = mean.copy()
    calm = np.abs(eps).max(axis=1) < np.quantile(np.abs(eps).max(axis=1), 0.1)
    with np.errstate(all="ignore"):
        at_rest = np.nanmedian(np.where(calm[:, None], known.resistance, np.nan), axis=0)
    start[: eps.shape[1]] = np.where(np.isfinite(at_rest), at_rest, start[: eps.shape[1]])
    found = least_squares(
        lambda x: np.r_[residual(x), (x - mean) / spread], np.clip(start, low, high), loss="soft_l1", f_scale=2.0, x_scale=spread,
        bounds=(low, high),
    )  # fmt: skip
    wrong = max(1.0, float((residual(found.x) ** 2).mean()))
    return found.x, np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)) * wrong)
