"""The reference robot: an inextensible Kirchhoff rod with rigid disks and tendons, solved without `twin` or MuJoCo.

    from tools.simulators.rod.mechanics.rod import Rod, solve
    shape = solve(Rod(), tension=[2.0, 0.0, 0.0], gravity=[0, 0, 9.81], payload=0.010)
    shape.disks[-1]                                      # tip, m, in the base frame

Base frame: origin at the base plate on the backbone, +z along the straight robot, tendon 1 at +x. SI units throughout.
`solve` is one equilibrium; `follow` walks a path of tensions with friction and creep. A tension is the true one at the
base end of the tendon, before the base hole.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tools.simulators.rod.mechanics.frames import gauss_mesh
from tools.simulators.rod.mechanics.heated import Heat, march_heated
from tools.simulators.rod.mechanics.march import Creep, NoEquilibrium, Path, Record, march
from tools.simulators.rod.mechanics.springs import Springs
from tools.simulators.rod.mechanics.statics import Body, Load, Problem
from tools.simulators.rod.mechanics.tendons import IWAN_SPREAD, Friction

NO_FIELDS = np.zeros((0, 10))
STIFFEST = 1e-7  # m/N: three taut inextensible tendons on a straight rod are redundant; 0.4 um at 4 N decides between them


@dataclass(frozen=True)
class Rod:
    """One built robot; the defaults are Peng's Table 2 (doi 10.20517/ss.2025.31) with an ideal assembly.

    EI(s) = E pi/4 r(s)^4 (1 + stiffness_gradient (s/L - 1/2)) stiffness_profile_k,  r(s) = r (1 + taper (1/2 - s/L));
    bending about the stiff axis carries sqrt(asymmetry), about the soft axis 1/sqrt(asymmetry) of it.
    """

    pitch: np.ndarray = field(default_factory=lambda: np.full(8, 0.015))  # (N,) m
    backbone_radius: float = 0.4e-3  # m
    radius_taper: float = 0.0  # (r(0) - r(L)) / r
    youngs_modulus: float = 77.59e9  # Pa
    poisson_ratio: float = 0.33
    backbone_mass: float = 0.6e-3  # kg
    disk_mass: np.ndarray = field(default_factory=lambda: np.full(8, 0.63e-3))  # (N,) kg
    hole_radius: np.ndarray = field(default_factory=lambda: np.full((9, 3), 0.008))  # (N+1, T) m, base plate first
    hole_angle: np.ndarray = field(default_factory=lambda: np.tile(np.radians([0.0, 120.0, 240.0]), (9, 1)))  # rad
    precurvature: np.ndarray = field(default_factory=lambda: np.zeros((8, 3)))  # (N, 3) 1/m, section frame
    stiffness_asymmetry: float = 1.0  # stiff over soft bending stiffness
    asymmetry_angle: float = 0.0  # rad from +x of the soft direction: a tip force there bends the rod most
    stiffness_gradient: float = 0.0
    stiffness_profile: np.ndarray = field(default_factory=lambda: np.ones(8))  # (N,)
    marker_offset: np.ndarray = field(default_factory=lambda: np.zeros(8))  # (N,) m, along the disk's axis

    @property
    def length(self) -> float:
        return float(self.pitch.sum())

    def holes(self) -> np.ndarray:
        """Hole positions (N+1, T, 3) in their disks' frames."""
        c, s = np.cos(self.hole_angle), np.sin(self.hole_angle)
        return np.stack([self.hole_radius * c, self.hole_radius * s, np.zeros_like(c)], axis=-1)

    def compliance(self, nodes: int) -> np.ndarray:
        """1/(N m^2), (N, G, 3, 3), in the section's frame; the third axis is twist."""
        x = (np.polynomial.legendre.leggauss(nodes)[0] + 1) / 2
        s = (np.cumsum(self.pitch) - self.pitch)[:, None] + self.pitch[:, None] * x  # (N, G)
        from_middle = s / self.length - 0.5
        area_moment = np.pi / 4 * (self.backbone_radius * (1 - self.radius_taper * from_middle)) ** 4
        factor = (1 + self.stiffness_gradient * from_middle) * self.stiffness_profile[:, None]
        bending = self.youngs_modulus * area_moment * factor
        # Bending into the direction `soft` is a rotation about the axis 90 degrees further on.
        about_soft = np.array([-np.sin(self.asymmetry_angle), np.cos(self.asymmetry_angle), 0.0])
        about_stiff = np.array([np.cos(self.asymmetry_angle), np.sin(self.asymmetry_angle), 0.0])
        root = np.sqrt(self.stiffness_asymmetry)
        in_section = root * np.outer(about_soft, about_soft) + np.outer(about_stiff, about_stiff) / root
        in_section[2, 2] = 1 + self.poisson_ratio  # GJ = EI / (1 + nu)
        return in_section / bending[..., None, None]


@dataclass(frozen=True)
class Shape:
    """Equilibria along a path; leading axis m = number of rows. `solve` returns one row without that axis."""

    disks: np.ndarray  # (m, N, 3) m
    rotations: np.ndarray  # (m, N, 3, 3) section frame to base frame
    markers: np.ndarray  # (m, N, 3) m
    path_length: np.ndarray  # (m, T) m, base hole to tip hole
    displacement: np.ndarray  # (m, T) m, path length of the straight robot minus path length
    tension: np.ndarray  # (m, N, T) N, of every segment, base to tip
    curvature: np.ndarray  # (m, N, G, 3) 1/m at the Gauss nodes
    moment: np.ndarray  # (m, N, G, 3) N m carried by the rod, base frame
    temperature: np.ndarray  # (m, T) degC, of springs; (0, T) without

    def __getitem__(self, row: int | slice) -> Shape:
        return Shape(**{name: value[row] if len(value) else value for name, value in vars(self).items()})


def straight_lengths(rod: Rod) -> np.ndarray:
    """Tendon path lengths (T,) of the straight robot."""
    hole = rod.holes()
    hole[:, :, 2] = np.concatenate([[0.0], np.cumsum(rod.pitch)])[:, None]
    return np.linalg.norm(np.diff(hole, axis=0), axis=-1).sum(axis=0)


@dataclass(frozen=True)
class Conditions:
    """What a path depends on beside its robot and drive. Rows (n,) are the drive's; a number stands for all of them."""

    gravity: ArrayLike = (0.0, 0.0, 9.81)
    payload: float = 0.0
    tip_force: ArrayLike = (0.0, 0.0, 0.0)
    fields: np.ndarray = field(default_factory=NO_FIELDS.copy)
    weight: ArrayLike = 1.0  # (n,) factor on gravity and tip force
    softness: ArrayLike = 1.0  # (n,) factor on the compliance
    dt: ArrayLike = 0.0  # (n,) s taken to reach each row
    keep: ArrayLike = True  # (n,) rows to return
    mu: float = 0.0
    stroke: float = 1e-4  # m, mean slip before a hole slides
    share: ArrayLike = 1.0  # (N, T) tension of a segment over the base tension, on top of friction
    creep: Creep | None = None  # its `delayed` state goes on from where it was
    driven_by_length: bool = False
    stretch: float = 0.0  # m/N, elasticity of a tendon between motor and tip
    bedding: tuple[float, float] = (0.0, 1.0)  # m by which it beds in, and the tension (N) at half of it
    springs: Springs | None = None  # that pull the tendons, heated by the drive's currents, each from its row to the next
    ambient: ArrayLike = 23.0  # (n,) degC, around them
    nodes: int = 4  # Gauss nodes per interval; tip within 2e-4 mm with 4, 2e-3 mm with 3, at the fullest loads

    def problem(self, rod: Rod) -> Problem:
        """Return the rod with its loads and tendons, friction at rest."""
        g, (N, T) = np.asarray(self.gravity, float), (len(rod.pitch), rod.hole_radius.shape[1])
        disk_force = rod.disk_mass[:, None] * g
        disk_force[-1] += self.payload * g + np.asarray(self.tip_force, float)
        rest = np.repeat(rod.precurvature[:, None, :], self.nodes, axis=1)
        load = Load(
            disk_force, rod.backbone_mass / rod.length * g, np.array(self.fields, float), np.zeros(T),
            _full(self.share, (N, T)), np.zeros(T), np.full(T, max(float(self.stretch), STIFFEST)), float(self.bedding[0]),
            float(self.bedding[1]), self.driven_by_length,
        )  # fmt: skip
        friction = Friction(float(self.mu), self.stroke * IWAN_SPREAD, np.zeros((N - 1, T, len(IWAN_SPREAD))), np.zeros((N - 1, T)))
        body = Body(np.array(rod.pitch, float), rod.compliance(self.nodes), rest, rod.holes())
        return Problem(gauss_mesh(self.nodes), body, load, friction)


def follow(rod: Rod, drive: ArrayLike, **conditions: Any) -> Shape:
    """Return the equilibria along a quasi-static path that starts from the unloaded robot at rest.

    `drive` (n, T): base tension in N; by length the tendon's free length minus its straight length in m; of springs the current in
    A. The others are fields of `Conditions`. Friction remembers the path, so take steps of 0.25 N or less where mu > 0. Raises
    NoEquilibrium.
    """
    given = Conditions(**conditions)
    drive = np.array(drive, float)
    n, T = drive.shape
    if given.driven_by_length:
        drive = drive + straight_lengths(rod)
    problem = given.problem(rod)
    record = Record.of(_full(given.keep, n).astype(bool), problem)
    weight, softness, dt = (_full(rows, n) for rows in (given.weight, given.softness, given.dt))
    temperature = np.zeros((0, T))
    if given.springs is None:
        march(problem, given.creep, Path(drive, weight, softness, dt), record)
    else:
        heat = Heat(drive, _full(given.ambient, n), weight, softness, dt)
        temperature = march_heated(problem, given.springs, heat, record, float(given.stretch))
    disks, rotations = record.disk_r[:, 1:], record.disk_R[:, 1:]
    markers = disks + rod.marker_offset[:, None] * rotations[..., 2]
    slack = straight_lengths(rod) - record.length
    return Shape(disks, rotations, markers, record.length, slack, record.tension, record.curvature, record.moment, temperature)


def _full(value: ArrayLike, shape: int | tuple[int, ...]) -> np.ndarray:
    return np.array(np.broadcast_to(np.asarray(value, float), shape), order="C")


def solve(rod: Rod, tension: ArrayLike = (0.0, 0.0, 0.0), **conditions: Any) -> Shape:
    """Return one frictionless equilibrium, reached from the unloaded robot in proportional steps; see `follow` for paths.

    `tension` (T,) N at the base, or (N, T) of every segment; the others are fields of `Conditions`.
    """
    tension = np.asarray(tension, float)
    base, share = tension, np.float64(1.0)
    if tension.ndim == 2:
        base = np.where(tension[0] > 0, tension[0], 1.0)
        share = tension / base
    steps = max(1, int(np.ceil(2 * np.abs(base).max())))
    weight = np.arange(1, steps + 1) / steps
    keep = np.arange(steps) == steps - 1
    return follow(rod, weight[:, None] * base, weight=weight, share=share, keep=keep, **conditions)[0]


__all__ = ["Conditions", "Creep", "NoEquilibrium", "Rod", "Shape", "follow", "solve", "straight_lengths"]
