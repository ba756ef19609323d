"""Resistive strain sensors: cords of incompressible conductive rubber, L A = const, R = rho L / A.

    R = R0 (1 + kappa strain)^2,          kappa: one number for stretch, another for compression

kappa is 1 for an ideal cord; a constant error of its length changes it, for example if the cord is not straight at first.
Simulation, calibration and estimators all convert strain and resistance here.

Source: KineSoft (Yoo et al. 2025, arXiv 2503.01078), appendix: sqrt(R/R0) - 1 = kappa strain.
"""

from typing import NamedTuple

import numpy as np


class Cords(NamedTuple):
    """The strain sensors of a body: resistance (s,) ohm at zero strain, kappa (s,) for stretch and for compression."""

    rest: np.ndarray
    stretch: np.ndarray
    compression: np.ndarray


def resistance(strain: np.ndarray, cords: Cords) -> np.ndarray:
    """Return resistances (..., s) ohm at strains (..., s).

    >>> cords = Cords(np.array([1e3]), np.array([1.0]), np.array([0.8]))
    >>> resistance(np.array([[0.1], [-0.1]]), cords).round(1).ravel().tolist()
    [1210.0, 846.4]
    """
    kappa = np.where(strain > 0.0, cords.stretch, cords.compression)
    return cords.rest * (1.0 + kappa * strain) ** 2


def strain(resistance: np.ndarray, cords: Cords) -> np.ndarray:
    """Return strains (..., s) at resistances (..., s) ohm; NaN where a resistance is missing or not above zero.

    >>> cords = Cords(np.array([1e3]), np.array([1.0]), np.array([0.8]))
    >>> strain(np.array([[1210.0], [846.4], [0.0]]), cords).round(6).ravel().tolist()
    [0.1, -0.1, nan]
    """
    with np.errstate(invalid="ignore"):
        apparent = np.sqrt(np.where(resistance > 0.0, resistance, np.nan) / cords.rest) - 1.0
    return apparent / np.where(apparent > 0.0, cords.stretch, cords.compression)
