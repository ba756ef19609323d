"""The heat balance of a spring that carries a current: Joule heat in, convection out.

    c dT/dt = R I^2 - h (T - T_a)
    h = (h_0 + h_1 x + h_2 x^2 + p_1 y + p_2 y^2 + q x y) (1 + k (T_a - 23 degC)),   x = T - T_a,   y = elongation / coils

    x+ = (R/h) (1 - exp(-h dt/c)) I^2 + exp(-h dt/c) x,   h at the step's start

exact while h stays what it is, so stable at any step. No latent heat, and a resistance that does not change.

Source: Kolyvas and Tzes, J. Intell. Mater. Syst. Struct. 2018, doi 10.1177/1045389X18770880, fitted there to a 0.51 mm NiTi
spring of eight coils.
"""

from __future__ import annotations

import numpy as np

from twin.compiled import jit
from twin.springs.spring import Spring

LEAST_LOSS = 1e-5  # W/K: the fitted polynomial falls below zero some 200 K above ambient; hot springs there heat on, finitely
WARM = 40.0  # K, half way to the end of the phase change
REFERENCE = 296.15  # K, of the surroundings the loss is quoted in


@jit
def loss(spring, t, above, elongation, ambient):
    """Heat loss (W/K) of spring t of the `Spring.records`, `above` (K) the surroundings at `ambient` (K), at an elongation (m)."""
    y = elongation / spring[t].coils
    h = spring[t].loss + above * (spring[t].loss_warm + above * spring[t].loss_warm_2 + y * spring[t].loss_warm_open)
    h += y * (spring[t].loss_open + y * spring[t].loss_open_2)
    return max(LEAST_LOSS, h * (1.0 + spring[t].loss_surroundings * (ambient - REFERENCE)))


def memory(spring: Spring) -> np.ndarray:
    """Time (s) over which each spring averages its heat, WARM above the surroundings: capacity over loss."""
    of = spring.records
    h = [loss(of, t, WARM, float(spring.initial_elongation[t]), REFERENCE) for t in range(len(spring.capacity))]
    return spring.capacity / np.array(h)


@jit
def heated(spring, t, temperature, elongation, current, ambient, dt):
    """Temperature (K) of spring t after dt (s) under a constant current (A) in surroundings at `ambient` (K)."""
    above = temperature - ambient
    h = loss(spring, t, above, elongation, ambient)
    keep = np.exp(-h * dt / spring[t].capacity)
    return ambient + spring[t].resistance / h * (1.0 - keep) * current * current + keep * above
