"""Fit R0 and kappa of all sensors to strains that are known up to a covariance, by generalised least squares:

    sqrt(R) = sqrt(R0) (1 + kappa+ max(eps, 0) + kappa- min(eps, 0)),       eps = eps_shape + e,  e ~ N(0, C) in every sample

C couples the sensors: of a shape seen from one side the length is known worst, which shifts all strains alike. The fit therefore
uses their differences there, and all of them where tendons of known length give the shape.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from twin.foundation.parameters import FittedValue, Parameter
from twin.prediction.twin import Twin

TENDON_STRAIN_ERROR, CLOUD_STRAIN_ERROR = 4e-4, 1e-3  # error of strains of shapes by tendons, and by clouds: the twin's own error
ASSUMED_RESISTANCE_NOISE = 0.3  # ohm
MISSING_READING_NOISE = 1e3  # of a missing strain, which so has no weight
SENSOR_PARAMETERS = ("resistance", "stretch", "compression")


@dataclass(frozen=True)
class StrainSamples:
    """Strains (n, s) of known shapes, resistances (n, s) ohm measured there, NaN where missing, and covariance (n, s, s) of
    strains."""

    strain: np.ndarray
    resistance: np.ndarray
    covariance: np.ndarray


def fit_sensors(samples: StrainSamples, twin: Twin) -> dict[str, FittedValue]:
    """Return the sensors' numbers by parameter name; none for dead sensors."""
    priors, s = {p.name: p for p in twin.robot.nuisance}, samples.strain.shape[1]
    parameters = [priors[f"sensors.{name}_{i + 1}"] for name in SENSOR_PARAMETERS for i in range(s)]
    finite = np.isfinite(samples.resistance)
    values, stds = _fit_parameters(samples, finite, parameters)
    return {
        p.name: FittedValue(float(value), float(std), p.unit)
        for k, (p, value, std) in enumerate(zip(parameters, values, stds, strict=True)) if finite[:, k % s].any()
    }  # fmt: skip


def _fit_parameters(samples: StrainSamples, finite: np.ndarray, priors: Sequence[Parameter]) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of the parameters and their standard errors."""
    mean, spread = np.array([p.value for p in priors]), np.array([p.std or np.inf for p in priors])
    low, high = np.array([p.low for p in priors]), np.array([p.high for p in priors])
    eps, root = samples.strain, np.sqrt(np.where(finite, samples.resistance, 1.0))
    noise = np.where(finite, ASSUMED_RESISTANCE_NOISE / (2.0 * root**2), MISSING_READING_NOISE)
    diagonal = np.arange(eps.shape[1])
    covariance = samples.covariance.copy()
    covariance[:, diagonal, diagonal] += noise**2
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))

    def residual(x: np.ndarray) -> np.ndarray:
        rest, stretch, compression = x.reshape(3, -1)
        away = np.sqrt(rest) * (1.0 + np.where(eps > 0.0, stretch, compression) * eps) / root - 1.0
        return np.einsum("nij,nj->ni", whiten, np.where(finite, away, 0.0)).ravel()

    start = mean.copy()
    small = np.abs(eps).max(axis=1) < np.quantile(np.abs(eps).max(axis=1), 0.1)
    with np.errstate(all="ignore"):
        at_rest = np.nanmedian(np.where(small[:, None], samples.resistance, np.nan), axis=0)
    start[: eps.shape[1]] = np.where(np.isfinite(at_rest), at_rest, start[: eps.shape[1]])
    fit = least_squares(
        lambda x: np.r_[residual(x), (x - mean) / spread], np.clip(start, low, high), loss="soft_l1", f_scale=2.0, x_scale=spread,
        bounds=(low, high),
    )  # fmt: skip
    misfit = max(1.0, float((residual(fit.x) ** 2).mean()))
    return fit.x, np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)) * misfit)
