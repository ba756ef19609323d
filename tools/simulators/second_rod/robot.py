"""The robot as described (nominal.md, from Peng's Table 2), and as built within the tolerances that nominal.md tells to expect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from tools.simulators.second_rod import loom
from tools.simulators.second_rod.mechanics import contact, fields
from tools.simulators.second_rod.mechanics.equilibrium import Model
from tools.simulators.second_rod.mechanics.rod import INTERVALS, make_rod, middles
from tools.simulators.second_rod.mechanics.tendons import Tendons, rest_lengths

YOUNGS_MODULUS = 77.59e9  # Pa
POISSON_RATIO = 0.33
BACKBONE_RADIUS = 0.4e-3  # m
BACKBONE_MASS = 0.6e-3  # kg
ROD_LENGTH = 0.12  # m
DISK_MASS = 0.63e-3  # kg
HOLE_RADIUS = 8e-3  # m
TENDON_ANGLES = np.deg2rad([0.0, 120.0, 240.0])
DRIVE_COMPLIANCE = 3e-6  # m/N: 0.01 mm at 3 N, below the noise of a displacement; a drive without any would have no Jacobian
FUNCTIONS = 7  # Legendre polynomials per curvature: within 5 um of ten, in free bending and against a post

Array = np.ndarray


@dataclass(frozen=True)
class Robot:
    """A robot as it stands on the bench; what effects change on it starts as nothing. SI units, angles in rad.

    asymmetry (a, angle): bending stiffness 1 + a about the material axis at that angle from x, 1 - a about the one across.
    stiffness_profile: (PIECES,) s / L -> factor on all stiffnesses.
    outboard (mass, lever): a point mass beyond the tip disk.
    """

    youngs_modulus: float = YOUNGS_MODULUS
    poisson_ratio: float = POISSON_RATIO
    disk_positions: Array = field(default_factory=lambda: ROD_LENGTH / INTERVALS * np.arange(1, INTERVALS + 1))  # (INTERVALS,)
    backbone_mass: float = BACKBONE_MASS
    backbone_taper: float = 0.0  # radius at the tip over that at the base, less one
    disk_mass: float = DISK_MASS
    hole_radius: float = HOLE_RADIUS
    hole_taper: float = 0.0  # hole radius at the tip over that at the base, less one
    hole_angles: Array = field(default_factory=lambda: TENDON_ANGLES.copy())  # (TENDONS,)
    marker_offsets: Array = field(default_factory=lambda: np.zeros(INTERVALS))  # (INTERVALS,) along each disk's axis
    compliance: float = DRIVE_COMPLIANCE  # m/N, of a drive by displacement and its tendon
    stiffening: float = 0.0  # 1/m
    friction: float = 0.0
    least_wrap: float = 0.0
    sliding_length: float = 1e-4
    asymmetry: tuple[float, float] = (0.0, 0.0)
    stiffness_profile: Callable[[Array], Array] = np.ones_like
    outboard: tuple[float, float] = (0.0, 0.0)
    obstacle: contact.Obstacle = contact.NO_OBSTACLE
    magnet: fields.Magnet = fields.NO_MAGNET
    jet: fields.Jet = fields.NO_JET
    loom: loom.Loom = loom.NO_LOOM

    def holes(self) -> Array:
        """(TENDONS, INTERVALS + 1, 2) in each plate's plane, base plate first, m."""
        along = np.concatenate([[0.0], self.disk_positions]) / self.disk_positions[-1]
        radius = self.hole_radius * (1 + self.hole_taper * (along - 0.5))
        directions = np.stack([np.cos(self.hole_angles), np.sin(self.hole_angles)], axis=-1)
        return np.ascontiguousarray(radius[None, :, None] * directions[:, None, :])

    def model(self, by_displacement: bool, functions: int = FUNCTIONS) -> Model:
        """E I and G J with G = E / 2 (1 + nu), for the compiled functions."""
        middle = middles(self.disk_positions) / self.disk_positions[-1]
        radius = BACKBONE_RADIUS * (1 + self.backbone_taper * (middle - 0.5))
        stiffness = self.youngs_modulus * np.pi * radius**4 / 4 * self.stiffness_profile(middle)
        extra, angle = self.asymmetry
        cos, sin = np.cos(angle), np.sin(angle)
        stiff, soft = 1 + extra, 1 - extra
        planes = [stiff * cos**2 + soft * sin**2, (stiff - soft) * cos * sin, stiff * sin**2 + soft * cos**2]
        rod = make_rod(
            self.disk_positions, functions, stiffness[:, None] * np.array(planes), stiffness / (1 + self.poisson_ratio),
            self.backbone_mass,
        )  # fmt: skip
        holes = self.holes()
        tendons = Tendons(
            holes, rest_lengths(holes, self.disk_positions).sum(1), by_displacement, self.compliance, self.stiffening,
            self.friction, self.least_wrap, self.sliding_length,
        )  # fmt: skip
        disks = np.full(INTERVALS, self.disk_mass)
        return Model(rod, tendons, disks, np.array(self.outboard), self.obstacle, self.magnet, self.jet, self.loom)


def within(random: np.random.Generator, deviation: float, limit: float) -> float:
    """A normal draw cut at a limit either way."""
    return float(np.clip(random.normal(0, deviation), -limit, limit))


def built(random: np.random.Generator) -> Robot:
    """A robot within nominal.md's tolerances: E, holes, disks' mass and places, markers along their disks' axes, radius taper."""
    spacing = 1 + np.clip(random.normal(0, 0.01, INTERVALS), -0.02, 0.02)
    length = ROD_LENGTH * (1 + within(random, 0.0006, 0.001))
    return Robot(
        youngs_modulus=YOUNGS_MODULUS * (1 + within(random, 0.05, 0.1)),
        poisson_ratio=POISSON_RATIO + within(random, 0.01, 0.03),
        disk_positions=np.cumsum(spacing) * length / np.sum(spacing),
        backbone_taper=random.uniform(-0.005, 0.005),
        disk_mass=DISK_MASS * (1 + within(random, 0.03, 0.06)),
        hole_radius=HOLE_RADIUS * (1 + within(random, 0.01, 0.018)),
        hole_taper=random.uniform(-0.005, 0.005),
        marker_offsets=random.uniform(-0.2e-3, 0.2e-3, INTERVALS),
    )


NUMBERS = (
    "youngs_modulus", "poisson_ratio", "backbone_taper", "disk_mass", "hole_radius", "hole_taper", "compliance", "disk_positions",
    "marker_offsets",
)  # fmt: skip


def numbers(robot: Robot) -> dict[str, float | list[float]]:
    """What was drawn of a robot, for its truth."""
    return {name: np.asarray(getattr(robot, name)).tolist() for name in NUMBERS}
