"""A superelastic spring: martensite comes and goes with stress alone, and its coils narrow as it is pulled.

    sin a = d / L + sin a_0,   R = R_0 cos a / cos a_0,   L = sqrt(l_0^2 + (2 pi N R_0)^2),   tan a_0 = l_0 / (2 pi N R_0)
    gamma = 3/4 d r / (2 pi N R^2),   F = 2 pi r^3 tau / (3 R)
    tau = G (gamma - gamma_L xi),   1/G = xi/G_M + (1 - xi)/G_A

for an elongation d (m) and a wire of radius r. The martensite fraction xi stays where it was between two cosines of the stress
(Brinson):

    (1 - cos pi c(tau; M_s, M_f)) / 2  <=  xi  <=  (1 - cos pi c(tau; A_f, A_s)) / 2,   c(tau; a, b) = (tau - a) / (b - a) in [0, 1]

so inner loops close inside the outer one. Strain rises with stress along either, which makes the stress unique.

Source: geometry and uniform shear over the section, Smart Mater. Struct. 23 (2014) 085018; numbers in superelastic.toml. That code
keeps R once all is martensite; here it goes on narrowing, which counts beyond 100 mm for the spring there.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from twin.compiled import jit
from twin.units import unit_scale

HALVINGS = 60  # of the interval that holds the stress: to rounding


class Superelastic(NamedTuple):
    """One spring's numbers, SI, as in superelastic.toml."""

    wire_diameter: float
    coil_diameter: float
    length: float
    coils: float
    austenite_modulus: float
    martensite_modulus: float
    largest_strain: float
    martensite_start: float
    martensite_finish: float
    austenite_start: float
    austenite_finish: float


SI = dict(zip(Superelastic._fields, ("m", "m", "m", "1", "Pa", "Pa", "1", "Pa", "Pa", "Pa", "Pa"), strict=True))


def published() -> Superelastic:
    """The spring of superelastic.toml."""
    table = tomllib.loads((Path(__file__).parent / "superelastic.toml").read_text())["parameters"]
    return Superelastic(*(unit_scale(table[n]["unit"], SI[n]).to_si(float(table[n]["value"])) for n in Superelastic._fields))


@jit
def share(stress, none, all_):
    """Half a cosine from 0 at the stress `none` to 1 at `all_`."""
    return 0.5 - 0.5 * math.cos(math.pi * min(1.0, max(0.0, (stress - none) / (all_ - none))))


@jit
def fraction(spring, stress, before):
    """Martensite fraction at a shear stress (Pa), after `before`."""
    least = share(stress, spring.martensite_start, spring.martensite_finish)
    return min(max(before, least), share(stress, spring.austenite_finish, spring.austenite_start))


@jit
def coil(spring, elongation):
    """Coil radius (m) and shear strain at an elongation (m)."""
    R0, r = 0.5 * spring.coil_diameter, 0.5 * spring.wire_diameter
    around = 2.0 * math.pi * spring.coils * R0
    a0 = math.atan2(spring.length, around)
    a = math.asin(elongation / math.hypot(spring.length, around) + math.sin(a0))
    R = R0 * math.cos(a) / math.cos(a0)
    return R, 0.75 * elongation * r / (2.0 * math.pi * spring.coils * R * R)


@jit
def pulled(spring, elongation, before):
    """Force (N) and martensite fraction at an elongation (m), not negative, after the fraction `before`."""
    R, gamma = coil(spring, elongation)
    low, high = 0.0, gamma * max(spring.austenite_modulus, spring.martensite_modulus)
    for _ in range(HALVINGS):
        tau = 0.5 * (low + high)
        xi = fraction(spring, tau, before)
        compliance = xi / spring.martensite_modulus + (1.0 - xi) / spring.austenite_modulus
        if tau * compliance + spring.largest_strain * xi > gamma:
            high = tau
        else:
            low = tau
    tau = 0.5 * (low + high)
    return 2.0 * math.pi * (0.5 * spring.wire_diameter) ** 3 * tau / (3.0 * R), fraction(spring, tau, before)


@jit
def _along(spring, elongation, force, xi):
    for k in range(elongation.shape[0]):
        now = 0.0
        for i in range(elongation.shape[1]):
            force[k, i], now = pulled(spring, elongation[k, i], now)
            xi[k, i] = now


def stretch(spring: Superelastic, elongation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force (N) and martensite fraction, (m, n), of springs pulled from rest through elongations (m, n) m, not negative.

    >>> F, xi = stretch(published(), np.array([[0.0, 5e-3, 60e-3, 0.0]]))
    >>> F.round(1).tolist(), xi.round(2).tolist()
    ([[0.0, 7.1, 55.1, 0.0]], [[0.0, 0.0, 0.34, 0.0]])
    """
    out = np.empty((2, *elongation.shape))
    _along(spring, np.ascontiguousarray(elongation, float), out[0], out[1])
    return out[0], out[1]
