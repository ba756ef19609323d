"""Motors that wind the rod's tendons: what turns an angle into the length of a tendon's far end.

    d_i = w_i r_m a_m - w_i r_m a0_m + c T0,    path_i = straight_i - d_i + c T_i

with a motor's angle a_m (rad) and zero a0_m, its spool's radius r_m (m), w_i = +-1 the way it winds tendon i, and a spring of c
(m/N) in series, which holds T0 (N) where the robot is straight and the motor at its zero. What commands the motors is the drawn
length of the described spool, r a, so that only what is built differently changes anything here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects import Effect, Situation

SPOOL = 10e-3  # m, as described
SPRING = 0.5e-3  # m/N, as described
PRETENSION = 1.0  # N, as described
RADIUS_SPREAD, SPRING_SPREAD, PRETENSION_SPREAD = 0.02, 0.1, 0.15  # shares of these, one standard deviation


@dataclass(frozen=True)
class Winding:
    """Which motor winds which tendon: `motor` (from 0) and `way` (+1 pulls in as the angle grows) of each tendon."""

    motor: tuple[int, ...]
    way: tuple[int, ...]
    zero_spread: float  # rad, one standard deviation of a motor's zero

    @property
    def motors(self) -> int:
        return max(self.motor) + 1

    def first_of(self, motor: int) -> int:
        """Return the first tendon that a motor winds."""
        return self.motor.index(motor)


PAIRS = Winding((0, 1, 0, 1), (1, 1, -1, -1), np.radians(4.0))  # four tendons at right angles, two motors
ALONE = Winding((0, 1, 2), (1, 1, 1), np.radians(1.5))  # three tendons, three motors
WINDINGS = {"pairs": PAIRS, "alone": ALONE}


@dataclass(frozen=True)
class DriveTrain(Effect):
    """The built motors. It is on the bench whatever else is wrong, and no effect: a description with tolerances has it."""

    id: ClassVar[str] = "drive_train"

    winding: Winding
    radius: tuple[float, ...]  # of each motor, over the described one
    zero: tuple[float, ...]  # rad
    spring: float = SPRING
    pretension: tuple[float, ...] = ()  # N, of each tendon

    @classmethod
    def built(cls, rng: np.random.Generator, winding: Winding, spread: float) -> DriveTrain:
        """Draw the motors of one robot; `spread` widens every tolerance."""

        def normal(size: int) -> np.ndarray:
            return spread * np.clip(rng.normal(size=size), -2.0, 2.0)

        m, t = winding.motors, len(winding.motor)
        radius = np.full(m, 1.0 + RADIUS_SPREAD * normal(1)[0])  # spools are turned alike
        pretension = PRETENSION * (1.0 + PRETENSION_SPREAD * normal(t))
        zero = winding.zero_spread * normal(m)
        spring = float(SPRING * (1.0 + SPRING_SPREAD * normal(1)[0]))
        return cls(1.0, winding, tuple(map(float, radius)), tuple(map(float, zero)), spring, tuple(map(float, pretension)))

    def mount(self, situation: Situation) -> None:
        situation.stretch += self.spring

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        motor, way = np.array(self.winding.motor), np.array(self.winding.way)
        radius = np.array(self.radius)[motor]
        zero = way * radius * SPOOL * np.array(self.zero)[motor]
        return displacement * radius - zero + self.spring * np.array(self.pretension)

    def moved(self) -> list[tuple[DriveTrain, float]]:
        """Return trains with one number moved at a time, and the move as a share of its standard deviation."""
        w, out = self.winding, []
        out.append((replace(self, radius=tuple(1.01 * r for r in self.radius)), 0.01 / RADIUS_SPREAD))
        out.append((replace(self, spring=self.spring + 0.05 * SPRING), 0.05 / SPRING_SPREAD))
        for m in range(w.motors):
            zero = tuple(a + (0.25 * w.zero_spread if i == m else 0.0) for i, a in enumerate(self.zero))
            out.append((replace(self, zero=zero), 0.25))
        for t in range(len(w.motor)):
            held = tuple(T + (0.05 * PRETENSION if i == t else 0.0) for i, T in enumerate(self.pretension))
            out.append((replace(self, pretension=held), 0.05 / PRETENSION_SPREAD))
        return out
