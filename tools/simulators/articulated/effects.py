"""What can be wrong with a robot's mechanics: each effect is one dataclass whose `strength` 0 is off, drawn by a generator.

An effect changes the arrays of the equations of motion for a trial, or what the instruments show. `strength` is its main number, in
the unit that its docstring names; the rest of its numbers say where it sits. Where the robots differ, effects are sized by what a
day asks of a joint (`Joint.load`, N m) or a drive (`Drive.peak`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, Self

import numpy as np

from tools.simulators.articulated.dynamics import place
from tools.simulators.articulated.plant import Plant, plant, with_mass_at_tip
from tools.simulators.articulated.robots import Robot

Columns = dict[str, np.ndarray]
SESSION = 600.0  # s, about as long as a session lasts


@dataclass(frozen=True)
class Effect:
    """A fault of a robot or its instruments; without overrides it does nothing."""

    strength: float

    id: ClassVar[str]
    in_catalogue: ClassVar[bool] = True
    most: ClassVar[float] = np.inf  # the largest strength that makes sense
    acts_on: ClassVar[Literal["", "winches", "servos"]] = ""  # what a robot needs for it

    @classmethod
    def fits(cls, robot: Robot) -> bool:
        """Return whether the robot has what the effect acts on."""
        return not cls.acts_on or bool(getattr(robot, cls.acts_on))

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        """Return the effect at a usual strength, everything else about it drawn."""
        raise NotImplementedError

    def on_plant(self, plant: Plant, start: float) -> Plant:
        """Return the plant of a trial that starts so many seconds into the session."""
        return plant

    def on_columns(self, columns: Columns, clock: np.ndarray) -> Columns:
        """Return what is logged instead of these outputs, at these times of the session."""
        return columns


def one_of(count: int, rng: np.random.Generator) -> np.ndarray:
    """Return zeros with a one somewhere."""
    return np.eye(count)[rng.integers(count)]


def joint_loads(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    """Return the joints' usual torques, each up to a fifth more or less."""
    return np.array([j.load for j in robot.joints]) * rng.uniform(0.8, 1.2, len(robot.joints))


@dataclass(frozen=True)
class JointFriction(Effect):
    """All joints rub: torque -strength size (1 + stribeck exp(-(w/speed)^2)) z, z after Dahl, and viscous strength size w."""

    size: np.ndarray  # N m
    stribeck: float
    speed: float  # rad/s
    viscous: float  # s/rad
    give: float  # rad

    id = "joint_friction"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        viscous = rng.uniform(0.0, 0.2) * rng.integers(2)
        return cls(0.1, joint_loads(robot, rng), rng.uniform(0.0, 0.5), rng.uniform(0.05, 1.0), viscous, rng.uniform(5e-4, 1e-3))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        size, n = self.strength * self.size, len(self.size)
        rubbing = plant.rubbing._replace(
            coulomb=plant.rubbing.coulomb + size, stribeck=np.full(n, self.stribeck), speed=self.speed, give=self.give
        )
        chain = plant.chain._replace(damping=plant.chain.damping + self.viscous * size)
        return plant._replace(rubbing=rubbing, chain=chain)


@dataclass(frozen=True)
class LoadDependentFriction(Effect):
    """Gears rub with the share `strength` of the torque that they transmit; robots with servos."""

    servo: np.ndarray

    id = "load_dependent_friction"
    acts_on = "servos"
    most = 0.8

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        driven = [s.target for s in robot.servos]
        return cls(0.1, np.array([float(j.name in driven) for j in robot.joints]))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        return plant._replace(rubbing=plant.rubbing._replace(load=plant.rubbing.load + self.strength * self.servo))


@dataclass(frozen=True)
class ReflectedInertia(Effect):
    """One rotor is heavier by `strength` of what is described; robots with servos."""

    joint: np.ndarray

    id = "reflected_inertia"
    acts_on = "servos"
    most = 20.0

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(1.5, np.eye(len(robot.joints))[robot.joint(rng.choice([s.target for s in robot.servos]))])

    def on_plant(self, plant: Plant, start: float) -> Plant:
        armature = plant.chain.armature * (1.0 + self.strength * self.joint)
        return plant._replace(chain=plant.chain._replace(armature=armature))


@dataclass(frozen=True)
class JointStiffness(Effect):
    """One joint has a spring that nobody described: strength x size N m/rad about `rest` rad."""

    size: np.ndarray
    rest: float

    id = "joint_stiffness"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.3, one_of(len(robot.joints), rng) * joint_loads(robot, rng), rng.uniform(-0.5, 0.5))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        old, more = plant.chain.stiffness, self.strength * self.size
        both = old + more
        rest = np.where(both > 0.0, (old * plant.chain.rest + more * self.rest) / np.where(both > 0.0, both, 1.0), 0.0)
        return plant._replace(chain=plant.chain._replace(stiffness=both, rest=rest))


@dataclass(frozen=True)
class JointStop(Effect):
    """One joint ends `strength` rad before the farthest angle of the day."""

    joint: np.ndarray
    reach: float  # rad

    id = "joint_stop"
    most = 1.5

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        joint = one_of(len(robot.joints), rng)
        return cls(0.1, joint, robot.joints[int(np.argmax(joint))].reach)

    def on_plant(self, plant: Plant, start: float) -> Plant:
        if self.strength == 0.0:
            return plant
        high = np.where(self.joint > 0.0, self.reach - self.strength, plant.chain.high)
        return plant._replace(chain=plant.chain._replace(high=high))


@dataclass(frozen=True)
class TipPayload(Effect):
    """A mass of `strength` kg is fixed to the tip in every trial."""

    id = "tip_payload"

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.05 * robot.links[-1].mass)

    def on_plant(self, plant: Plant, start: float) -> Plant:
        return plant._replace(chain=with_mass_at_tip(plant.chain, self.strength))


@dataclass(frozen=True)
class BaseTilt(Effect):
    """The base is turned in the plane, so that gravity is by `strength` rad, either way."""

    side: float

    id = "base_tilt"
    most = 1.5

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.05, rng.choice([-1.0, 1.0]))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        c, s = np.cos(self.strength * self.side), np.sin(self.strength * self.side)
        gravity = np.array([[c, -s], [s, c]]) @ plant.chain.gravity
        return plant._replace(chain=plant.chain._replace(gravity=gravity))


@dataclass(frozen=True)
class Cogging(Effect):
    """One joint catches: torque -strength size sin(teeth q + phase) N m. In no catalogue."""

    size: np.ndarray
    teeth: int
    phase: float

    id = "cogging"
    in_catalogue = False

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        size = one_of(len(robot.joints), rng) * joint_loads(robot, rng)
        return cls(0.1, size, int(rng.integers(10, 31)), rng.uniform(0.0, 2.0 * np.pi))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        n = len(self.size)
        rubbing = plant.rubbing._replace(
            detent=self.strength * self.size, teeth=np.full(n, float(self.teeth)), phase=np.full(n, self.phase)
        )
        return plant._replace(rubbing=rubbing)


@dataclass(frozen=True)
class QuadraticDamping(Effect):
    """All joints are braked with the square of their speed: torque -strength size |w| w, size N m s^2/rad^2. In no catalogue."""

    size: np.ndarray

    id = "quadratic_damping"
    in_catalogue = False

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.05, joint_loads(robot, rng))

    def on_plant(self, plant: Plant, start: float) -> Plant:
        return plant._replace(chain=plant.chain._replace(drag=plant.chain.drag + self.strength * self.size))


@dataclass(frozen=True)
class SpringSoftening(Effect):
    """The springs lose the share strength (1 - exp(-t / time)) over the session; robots with springs. In no catalogue."""

    time: float  # s

    id = "spring_softening"
    in_catalogue = False
    most = 0.9

    @classmethod
    def fits(cls, robot: Robot) -> bool:
        return any(joint.stiffness > 0.0 for joint in robot.joints)

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        return cls(0.1, rng.uniform(0.2, 0.8) * SESSION)

    def on_plant(self, plant: Plant, start: float) -> Plant:
        left = 1.0 - self.strength * (1.0 - np.exp(-start / self.time))
        return plant._replace(chain=plant.chain._replace(stiffness=left * plant.chain.stiffness))


@dataclass(frozen=True)
class TipRub(Effect):
    """The tip drags through a brush that lies below an edge: strength x size N against its travel. In no catalogue."""

    size: float  # N
    edge: float  # z, m
    width: float  # m

    id = "tip_rub"
    in_catalogue = False

    @classmethod
    def draw(cls, robot: Robot, rng: np.random.Generator) -> Self:
        made, n = plant(robot, 0.0), len(robot.joints)
        frame = np.zeros((n + 2, 4))
        place(made.chain, np.array([joint.start for joint in robot.joints]), frame)
        span = float(np.sum(made.chain.length))
        edge = float(frame[-1, 3]) + span * rng.uniform(-0.1, 0.1)
        return cls(0.1, robot.joints[0].load / span, edge, 0.03 * span)

    def on_plant(self, plant: Plant, start: float) -> Plant:
        rubbing = plant.rubbing._replace(brush=np.array([self.strength * self.size, self.edge, self.width]))
        return plant._replace(rubbing=rubbing)


def mechanical() -> list[type[Effect]]:
    """List the effects of this module."""
    return [
        JointFriction, LoadDependentFriction, ReflectedInertia, JointStiffness, JointStop, TipPayload, BaseTilt, Cogging,
        QuadraticDamping, SpringSoftening, TipRub,
    ]  # fmt: skip
