"""What can be wrong with tendons, drives and instruments; the other half of the effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from tools.simulators.articulated.bench import channels
from tools.simulators.articulated.effects import SESSION, Columns, Effect, mechanical, one_of
from tools.simulators.articulated.plant import Plant
from tools.simulators.articulated.robots import Robot


@dataclass(frozen=True)
class TendonFriction(Effect):
    """Tendons rub at their via points: T' = T exp(-mu sum theta z), mu = strength x share, z after Dahl; robots with tendons."""

    share: np.ndarray

    id = "tendon_friction"
    acts_on = "winches"
    most = 2.0

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.05, rng.uniform(0.85, 1.15, len(robot.winches)))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        return plant._replace(tendons=plant.tendons._replace(mu=plant.tendons.mu + self.strength * self.share))


@dataclass(frozen=True)
class TendonElasticity(Effect):
    """One tendon stretches between drum and robot: `strength` mm/N; robots with tendons."""

    tendon: np.ndarray

    id = "tendon_elasticity"
    acts_on = "winches"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        tendon = one_of(len(robot.winches), rng)
        return cls(200.0 / robot.winches[int(np.argmax(tendon))].kp, tendon)

    def on_plant(self, plant: Plant, start: float) -> Plant:
        compliance = plant.tendons.compliance + 1e-3 * self.strength * self.tendon
        return plant._replace(tendons=plant.tendons._replace(compliance=compliance))


@dataclass(frozen=True)
class TendonBacklash(Effect):
    """One drum follows its motor only after a play of `strength` mm; robots with tendons."""

    drive: np.ndarray

    id = "tendon_backlash"
    acts_on = "winches"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.2, _some_winch(robot, rng))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        play = plant.commands.play + 1e-3 * self.strength * self.drive
        return plant._replace(commands=plant.commands._replace(play=play))


@dataclass(frozen=True)
class DriveZero(Effect):
    """One winch counts its command from `strength` mm elsewhere; its reading is true; robots with tendons."""

    drive: np.ndarray

    id = "drive_zero"
    acts_on = "winches"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.3, rng.choice([-1.0, 1.0]) * _some_winch(robot, rng))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        zero = plant.commands.zero + 1e-3 * self.strength * self.drive
        return plant._replace(commands=plant.commands._replace(zero=zero))


@dataclass(frozen=True)
class ActuatorGain(Effect):
    """One drive delivers the share 1 - strength of its tension or torque, which is what is logged."""

    servo: np.ndarray  # per joint
    tendon: np.ndarray

    id = "actuator_gain"
    most = 0.9

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.1, *_some_drive(robot, rng)[1:])

    def on_plant(self, plant: Plant, start: float) -> Plant:
        servos = plant.servos._replace(gain=plant.servos.gain * (1.0 - self.strength * self.servo))
        tendons = plant.tendons._replace(gain=plant.tendons.gain * (1.0 - self.strength * self.tendon))
        return plant._replace(servos=servos, tendons=tendons)


@dataclass(frozen=True)
class ActuatorSaturation(Effect):
    """One drive ends at the share 1 - strength of what the day asks of it (`peak`, N or N m)."""

    servo: np.ndarray  # per joint
    tendon: np.ndarray
    peak: float

    id = "actuator_saturation"
    most = 0.95

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        drive, servo, tendon = _some_drive(robot, rng)
        return cls(0.3, servo, tendon, robot.drives[drive].peak)

    def on_plant(self, plant: Plant, start: float) -> Plant:
        if self.strength == 0.0:
            return plant
        limit = (1.0 - self.strength) * self.peak
        servos = plant.servos._replace(limit=np.where(self.servo > 0.0, limit, plant.servos.limit))
        tendons = plant.tendons._replace(limit=np.where(self.tendon > 0.0, limit, plant.tendons.limit))
        return plant._replace(servos=servos, tendons=tendons)


@dataclass(frozen=True)
class ActuatorLag(Effect):
    """All drives follow their commands through a first-order filter of `strength` ms."""

    id = "actuator_lag"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(5.0)

    def on_plant(self, plant: Plant, start: float) -> Plant:
        return plant._replace(commands=plant.commands._replace(lag=plant.commands.lag + 1e-3 * self.strength))


@dataclass(frozen=True)
class TimeDelay(Effect):
    """All outputs are logged `strength` ms after they were, against the commands."""

    id = "time_delay"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(3.0)

    def on_plant(self, plant: Plant, start: float) -> Plant:
        return plant._replace(delay=plant.delay + 1e-3 * self.strength)


@dataclass(frozen=True)
class EncoderOffset(Effect):
    """One joint encoder shows `strength` degrees more or less."""

    channel: str
    side: float

    id = "encoder_offset"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.5, f"{rng.choice(robot.encoders)}_angle", rng.choice([-1.0, 1.0]))

    def on_columns(self, columns: Columns, clock: np.ndarray) -> Columns:
        return columns | {self.channel: columns[self.channel] + self.side * self.strength}


@dataclass(frozen=True)
class SensorDrift(Effect):
    """One output other than the camera's walks off by strength size (1 - exp(-t / time)), size its noise."""

    channel: str
    size: float  # in the channel's unit
    time: float  # s

    id = "sensor_drift"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        listed = channels(robot, camera=False)
        channel = listed[rng.integers(len(listed))]
        size = rng.choice([-1.0, 1.0]) * robot.instruments[channel.instrument].sigma
        return cls(5.0, channel.name, size, rng.uniform(0.2, 1.0) * SESSION)

    def on_columns(self, columns: Columns, clock: np.ndarray) -> Columns:
        walked = self.strength * self.size * (1.0 - np.exp(-clock / self.time))
        return columns | {self.channel: columns[self.channel] + walked}


@dataclass(frozen=True)
class CameraMisalignment(Effect):
    """The camera's frame is turned in the plane by `strength` rad and shifted by strength x offset (mm); robots with a camera."""

    tip: str
    side: float
    offset: np.ndarray  # (2,) x, z

    id = "camera_misalignment"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        reach = 1e3 * sum(link.length for link in robot.links)
        return cls(0.01, robot.tip, rng.choice([-1.0, 1.0]), rng.uniform(-0.5, 0.5, 2) * reach)

    def on_columns(self, columns: Columns, clock: np.ndarray) -> Columns:
        c, s = np.cos(self.side * self.strength), np.sin(self.side * self.strength)
        x, z = columns[f"{self.tip}_x"], columns[f"{self.tip}_z"]
        dx, dz = self.strength * self.offset
        return columns | {f"{self.tip}_x": c * x - s * z + dx, f"{self.tip}_z": s * x + c * z + dz}


def _some_winch(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    """Return a one at a winch among the drives."""
    winches = [i for i, d in enumerate(robot.drives) if d in robot.winches]
    return np.eye(len(robot.drives))[rng.choice(winches)]


def _some_drive(robot: Robot, rng: np.random.Generator) -> tuple[int, np.ndarray, np.ndarray]:
    """Return a drive's number, and ones where it acts: among the joints, among the tendons."""
    drive = int(rng.integers(len(robot.drives)))
    target = robot.drives[drive].target
    on_joint = np.array([float(j.name == target) for j in robot.joints])
    return drive, on_joint, np.array([float(w.target == target) for w in robot.winches])


def all_effects() -> dict[str, type[Effect]]:
    """Return every effect by its name."""
    here: list[type[Effect]] = [
        TendonFriction, TendonElasticity, TendonBacklash, DriveZero, ActuatorGain, ActuatorSaturation, ActuatorLag, TimeDelay,
        EncoderOffset, SensorDrift, CameraMisalignment,
    ]  # fmt: skip
    return {effect.id: effect for effect in [*mechanical(), *here]}
