"""The tension follows its command as a second-order system: tau^2 T'' + 2 zeta tau T' + T = c, tau = 0.1 s strength.

The logged input is the command. Integrated with Heun steps on the fine grid, from rest at the first command.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect


@dataclass(frozen=True)
class ActuatorLag(Effect):
    id: ClassVar[str] = "actuator_lag"
    logs_command: ClassVar[bool] = True

    zeta: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> ActuatorLag:
        return cls(1.0, float(rng.uniform(0.8, 1.3)))

    def deliver(self, time: np.ndarray, command: np.ndarray) -> np.ndarray:
        tau = 0.1 * self.strength
        if tau == 0.0:
            return command
        state = np.stack([command[0], np.zeros(command.shape[1])])
        out = np.empty_like(command)
        out[0] = command[0]

        def rate(x: np.ndarray, c: np.ndarray) -> np.ndarray:
            return np.stack([x[1], ((c - x[0]) / tau - 2 * self.zeta * x[1]) / tau])

        for n in range(1, len(time)):
            # Steps of a tenth of tau keep Heun stable and accurate to 1e-3 of the command.
            parts = max(1, int(np.ceil(10 * (time[n] - time[n - 1]) / tau)))
            h = (time[n] - time[n - 1]) / parts
            for j in range(parts):
                c0 = command[n - 1] + (command[n] - command[n - 1]) * j / parts
                c1 = command[n - 1] + (command[n] - command[n - 1]) * (j + 1) / parts
                k0 = rate(state, c0)
                state = state + h / 2 * (k0 + rate(state + h * k0, c1))
            out[n] = state[0]
        return out
