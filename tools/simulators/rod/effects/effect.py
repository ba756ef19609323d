"""The places at which an effect may reach into the bench: all do nothing unless an effect says otherwise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tools.simulators.rod.mechanics.rod import NO_FIELDS, Rod
from tools.simulators.rod.mechanics.springs import Springs


@dataclass
class Situation:
    """One trial's mechanics, as the bench is truly set up; effects change it in place."""

    rod: Rod
    gravity: np.ndarray  # (3,) m/s^2
    payload: float  # kg
    start: float  # s on the common clock
    mu: float = 0.0
    stroke: float = 1e-4  # m
    creep: tuple[np.ndarray, np.ndarray] | None = None  # shares, times (s)
    fields: np.ndarray = field(default_factory=NO_FIELDS.copy)
    latency: float = 0.0  # s by which outputs are logged late
    stretch: float = 0.0  # m/N, felt where the motor drives by length
    bedding: tuple[float, float] = (0.0, 1.0)  # m, and N at half of it; felt there too
    springs: Springs = field(default_factory=Springs)  # that pull where the day is driven by currents


@dataclass(frozen=True)
class Effect:
    """Base of all effects. `strength` scales the law: 0 is off, 1 a drawn, plausible size, `most` the largest allowed."""

    strength: float

    id: ClassVar[str]
    in_catalogue: ClassVar[bool] = True
    most: ClassVar[float] = 20.0
    seen_in: ClassVar[str] = "marker"  # the output whose change sets the amplitude: marker | displacement
    seen_by_length: ClassVar[str] = "marker"  # the same where the motors command displacements: marker | tension
    needs_ambient: ClassVar[bool] = False
    driven_by_current: ClassVar[bool] = False  # seen only where springs pull
    driven_by_length: ClassVar[bool] = False  # bends the robot only where motors command displacements
    logs_command: ClassVar[bool] = False  # the input logged is the commanded tension, not the load cell

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Effect:
        """An instance of strength 1 with everything else drawn."""
        return cls(1.0)

    def mount(self, situation: Situation) -> None:
        """Change robot, loads or tendons of one trial."""

    def deliver(self, time: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Delivered base tension (n, T) from the commanded one on a fine time grid (n,)."""
        return command

    def soften(self, clock: np.ndarray, ambient: np.ndarray) -> np.ndarray | float:
        """Factor (n,) on the backbone's compliance at session times `clock` (s) and `ambient` degC."""
        return 1.0

    def read(self, clock: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Load-cell reading (n, T) of the true base tension."""
        return tension

    def observe(self, clock: np.ndarray, ambient: np.ndarray, markers: np.ndarray) -> np.ndarray:
        """Marker positions (n, N, 3) as the camera reports them."""
        return markers

    def encode(self, displacement: np.ndarray, tension: np.ndarray) -> np.ndarray:
        """Motor-side tendon displacement (n, T) from the path's displacement (m) and the base tension (N)."""
        return displacement

    def pull(self, displacement: np.ndarray) -> np.ndarray:
        """Tendon displacement (n, T) that the motor's displacement (m) causes, where the motor drives by length."""
        return displacement


def unit_vector(rng: np.random.Generator, size: int = 3) -> np.ndarray:
    v = rng.normal(size=size)
    return v / np.linalg.norm(v)


def rotation(vector: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector (rad), Rodrigues."""
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)
