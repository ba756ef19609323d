"""Heat balance of a spring that carries a current: Joule heating and convection.

    c dT/dt = R I^2 - h (T - T_a)
    h = (h_0 + h_1 x + h_2 x^2 + p_1 y + p_2 y^2 + q x y) (1 + k (T_a - 23 degC)),   x = T - T_a,   y = elongation / coils

    x+ = (R/h) (1 - exp(-h dt/c)) I^2 + exp(-h dt/c) x,   h at the step's start

The step is exact for constant h, and so stable at any step size. Latent heat and changes of resistance are neglected.

Source: Kolyvas and Tzes, J. Intell. Mater. Syst. Struct. 2018, doi 10.1177/1045389X18770880, fitted there to a 0.51 mm NiTi spring
of eight coils.
"""

import numpy as np

from twin.body.drives.spring import Spring
from twin.foundation.compiled import jit

LEAST_LOSS = 1e-5  # W/K; the fitted polynomial falls below zero some 200 K above ambient, and temperatures must stay finite
TYPICAL_EXCESS = 40.0  # K above ambient, half way to the end of the phase change
LOSS_TEMPERATURE = 296.15  # K, ambient temperature at which the loss is quoted


@jit
def heat_loss(spring, t, above, elongation, ambient):
    """Return the heat loss (W/K) of spring t of the `Spring.records`.

    The spring is `above` (K) its surroundings at `ambient` (K), at an elongation (m).
    """
    y = elongation / spring[t].coils
    h = spring[t].loss + above * (spring[t].loss_warm + above * spring[t].loss_warm_2 + y * spring[t].loss_warm_open)
    h += y * (spring[t].loss_open + y * spring[t].loss_open_2)
    return max(LEAST_LOSS, h * (1.0 + spring[t].loss_surroundings * (ambient - LOSS_TEMPERATURE)))


def thermal_time_constant(spring: Spring) -> np.ndarray:
    """Return the time constant (s) of each spring, heat capacity over loss, at TYPICAL_EXCESS above ambient."""
    of = spring.records
    h = [
        heat_loss(of, t, TYPICAL_EXCESS, float(spring.initial_elongation[t]), LOSS_TEMPERATURE) for t in range(len(spring.capacity))
    ]
    return spring.capacity / np.array(h)


@jit
def heated_temperature(spring, t, temperature, elongation, current, ambient, dt):
    """Return the temperature (K) of spring t after dt (s) under a constant current (A) in surroundings at `ambient` (K)."""
    above = temperature - ambient
    h = heat_loss(spring, t, above, elongation, ambient)
    keep = np.exp(-h * dt / spring[t].capacity)
    return ambient + spring[t].resistance / h * (1.0 - keep) * current * current + keep * above
