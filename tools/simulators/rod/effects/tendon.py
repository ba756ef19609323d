"""Effects of the tendons and their drives by tension or by length."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tools.simulators.rod.effects.effect import Effect, Situation


@dataclass(frozen=True)
class ActuatorLag(Effect):
    """The tension follows its command as a second-order system: tau^2 T'' + 2 zeta tau T' + T = c, tau = 0.1 s strength.

    The logged input is the command. Integrated with Heun steps on the fine grid, from rest at the first command.
    """

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


@dataclass(frozen=True)
class ActuatorSaturation(Effect):
    """The drive runs into its limit softly: it delivers (c^-p + L^-p)^(-1/p) of c. The logged input is the command.

    Of tensions L = 5 N - 0.6 N strength, all drives; of lengths L = 16 mm - 1.6 mm strength, one drive or all of them; they pay out
    freely.
    """

    id: ClassVar[str] = "actuator_saturation"
    most: ClassVar[float] = 6.0
    logs_command: ClassVar[bool] = True

    sharpness: float  # p
    stops: tuple[bool, ...] = (True, True, True)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> ActuatorSaturation:
        sharpness, alone = float(rng.uniform(10, 25)), np.arange(3) == rng.integers(3)
        return cls(1.0, sharpness, tuple(map(bool, alone if rng.random() < 0.5 else np.ones(3, bool))))

    def _within(self, command: np.ndarray, limit: float) -> np.ndarray:
        if self.strength == 0.0:
            return command
        return command / (1 + (np.maximum(command, 0.0) / limit) ** self.sharpness) ** (1 / self.sharpness)

    def deliver(self, time: np.ndarray, command: np.ndarray) -> np.ndarray:
        return self._within(command, 5.0 - 0.6 * self.strength)

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        return np.where(np.array(self.stops), self._within(displacement, 16e-3 - 1.6e-3 * self.strength), displacement)


SWAP = 2e-5  # m


@dataclass(frozen=True)
class TendonBacklash(Effect):
    """Play between drive and tendon: the motor leads by half the gap in the direction of travel, gap = 0.1 mm strength. One drive
    is worn, or all three are alike.

    The lead p swaps sides with the tendon's travel d over SWAP: dp = (gap/2 sign(dd) - p) (1 - exp(-|dd| / SWAP)).
    Driven by tension, only the logged displacement shows it; driven by length, the tendon lags the motor by p.
    """

    id: ClassVar[str] = "tendon_backlash"
    seen_in: ClassVar[str] = "displacement"

    worn: tuple[float, ...] = (1.0, 1.0, 1.0)  # share of the gap, a drive

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TendonBacklash:
        """All drives as often as one of them."""
        one = np.eye(3)[rng.integers(3)]
        return cls(1.0, tuple(map(float, one if rng.random() < 0.5 else np.ones(3))))

    def _lead(self, travelled: np.ndarray) -> np.ndarray:
        half = 0.5e-4 * self.strength * np.array(self.worn)
        lead = np.zeros_like(travelled)
        for n, travel in enumerate(np.diff(travelled, axis=0), start=1):
            lead[n] = lead[n - 1] + (half * np.sign(travel) - lead[n - 1]) * -np.expm1(-np.abs(travel) / SWAP)
        return lead

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement + self._lead(displacement)

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        return displacement - self._lead(displacement)


@dataclass(frozen=True)
class TendonElasticity(Effect):
    """The tendon stretches: motor-side displacement = path displacement + strength (0.05 mm/N T + toe T / (T + T_b)).

    Half of them have a toe, of 0.2 mm. Driven by tension, only the displacement shows it.
    """

    id: ClassVar[str] = "tendon_elasticity"
    seen_in: ClassVar[str] = "displacement"

    toe: float  # m
    half: float  # N, T_b

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TendonElasticity:
        return cls(1.0, float(rng.choice([0.0, 0.2e-3])), float(rng.uniform(0.3, 1.0)))

    def mount(self, situation: Situation) -> None:
        situation.stretch = 0.05e-3 * self.strength
        situation.bedding = (self.toe * self.strength, self.half)

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement + self.strength * (0.05e-3 * tension + self.toe * tension / (tension + self.half))


@dataclass(frozen=True)
class TendonFriction(Effect):
    """Capstan friction at the holes of the inner disks with Iwan pre-sliding; the law itself is in
    `tools/simulators/rod/mechanics/tendons.py`.

    mu = 0.1 strength; `stroke` is the mean slip before a hole slides.
    """

    id: ClassVar[str] = "tendon_friction"
    most: ClassVar[float] = 8.0  # mu 0.8; dry metal on metal is at 0.6

    stroke: float  # m

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TendonFriction:
        return cls(1.0, float(np.exp(rng.uniform(np.log(2e-5), np.log(2e-4)))))

    def mount(self, situation: Situation) -> None:
        situation.mu = 0.1 * self.strength
        situation.stroke = self.stroke


@dataclass(frozen=True)
class TendonRouting(Effect):
    """One tendon's holes sit elsewhere on every disk: 3 degrees strength further around and 2 % strength further out, in shares."""

    id: ClassVar[str] = "tendon_routing"
    most: ClassVar[float] = 10.0

    tendon: int  # from 0
    around: float
    out: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TendonRouting:
        mix = rng.uniform(-np.pi / 2, np.pi / 2)
        return cls(1.0, int(rng.integers(3)), float(np.cos(mix) * rng.choice([-1, 1])), float(np.sin(mix)))

    def mount(self, situation: Situation) -> None:
        angle, radius = situation.rod.hole_angle.copy(), situation.rod.hole_radius.copy()
        angle[:, self.tendon] += np.radians(3.0) * self.strength * self.around
        radius[:, self.tendon] *= 1 + 0.02 * self.strength * self.out
        situation.rod = replace(situation.rod, hole_angle=angle, hole_radius=radius)


@dataclass(frozen=True)
class TimeDelay(Effect):
    """Outputs are logged 0.1 s strength after the inputs of the same time stamp: y(t) = y_true(t - delay)."""

    id: ClassVar[str] = "time_delay"

    def mount(self, situation: Situation) -> None:
        situation.latency = 0.1 * self.strength


GUIDE = 0.04  # m
INVERSE_ROUNDS = 40  # of the inverse; each takes off the error's slope, below a half


@dataclass(frozen=True)
class TransmissionError(Effect):
    """A drum whose axis is off its centre, 0.1 mm times strength, draws in more or less tendon than its turning says.

    The tendon leaves the drum (radius R) on its tangent through a guide g 40 mm away. With its centre at c = e (cos(theta + p),
    sin(theta + p)) the piece from guide to drum is sqrt(|g - c|^2 - R^2) and touches the drum at angle(g - c) + arccos(R / |g -
    c|). The drive takes R theta for what is drawn in; the drum draws in R theta and what both pieces change by. Drums are alike but
    for p.
    """

    id: ClassVar[str] = "transmission_error"
    most: ClassVar[float] = 10.0
    seen_in: ClassVar[str] = "displacement"
    driven_by_length: ClassVar[bool] = True

    radius: float  # m
    phases: tuple[float, ...]  # rad
    share: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> TransmissionError:
        phases, share = rng.uniform(-np.pi, np.pi, 3), rng.uniform(0.3, 1.0, 3)
        return cls(1.0, float(rng.uniform(2.5e-3, 5e-3)), tuple(map(float, phases)), tuple(map(float, share)))

    def _led(self, theta: np.ndarray) -> np.ndarray:
        """Tendon (m) between guide and the drum's own zero mark, but for R theta."""
        e = 1e-4 * self.strength * np.array(self.share)
        angle = theta + np.array(self.phases)
        x, y = GUIDE - e * np.cos(angle), -e * np.sin(angle)
        distance = np.hypot(x, y)
        return np.sqrt(distance**2 - self.radius**2) - self.radius * (np.arctan2(y, x) + np.arccos(self.radius / distance))

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        theta = displacement / self.radius
        return displacement + self._led(theta) - self._led(0.0 * theta)

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        motor = displacement
        for _ in range(INVERSE_ROUNDS):
            motor = displacement - (self.pull(motor) - motor)
        return motor


@dataclass(frozen=True)
class DriveZero(Effect):
    """Motors whose zeros are off: each tendon is longer than its motor says by up to 0.1 mm times strength."""

    id: ClassVar[str] = "drive_zero"
    driven_by_length: ClassVar[bool] = True

    share: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> DriveZero:
        return cls(1.0, tuple(map(float, rng.uniform(0.3, 1.0, 3))))

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        return displacement - 1e-4 * self.strength * np.array(self.share)

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement + 1e-4 * self.strength * np.array(self.share)


@dataclass(frozen=True)
class ActuatorGain(Effect):
    """Spools smaller than described, each by up to 2 % times strength."""

    id: ClassVar[str] = "actuator_gain"
    most: ClassVar[float] = 10.0
    driven_by_length: ClassVar[bool] = True

    share: tuple[float, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> ActuatorGain:
        return cls(1.0, tuple(map(float, rng.uniform(0.0, 1.0, 3))))

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        return displacement * (1.0 - 0.02 * self.strength * np.array(self.share))

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        return displacement / (1.0 - 0.02 * self.strength * np.array(self.share))
