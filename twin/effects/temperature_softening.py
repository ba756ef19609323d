"""Temperature softening: the body's stiffness depends on temperature."""

from __future__ import annotations

import numpy as np

from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter

REFERENCE_TEMPERATURE = 296.15  # K, 23 degC: to which the described stiffness refers
MIN_STIFFNESS_SHARE = 0.05  # of the described stiffness: the least that softening and ageing leave


class TemperatureSoftening(Effect):
    """Stiffness K(theta) = K_23 (1 - rate (theta - 23 degC)); a negative rate stiffens (superelastic NiTi).

    Source: first-order Taylor expansion. Silicone and nylon lose 0.2-1 % per kelvin near room temperature; superelastic NiTi gains.

    >>> TemperatureSoftening(rate=0.01).soften(np.array([296.15, 306.15]), np.zeros(2)).round(3).tolist()
    [1.0, 0.9]
    """

    id = "temperature_softening"
    parameters = (Parameter("rate", 0.0, "1/K", -0.1, 0.1, "plastics near room temperature: 0.002-0.01", scale=0.003),)
    guesses = ({"rate": 0.005},)
    needs = frozenset({"elasticity"})
    moves_with = "the room's temperature"
    plot_against = "temperature"
    hidden_without = frozenset({DataNeed.TEMPERATURES, DataNeed.RANDOM_ORDER})

    def soften(self, temperature: np.ndarray, clock: np.ndarray) -> np.ndarray:
        return np.maximum(MIN_STIFFNESS_SHARE, 1.0 - self["rate"] * (temperature - REFERENCE_TEMPERATURE))
