"""Family "continuum": a slender elastic backbone pulled by tendons through holes, as a chain of MuJoCo joints.

Each piece of the backbone between two disks has two joint sets (backbone.py gives their places and stiffness). A set is three
hinges with stiffness EI/h, EI/h, GJ/h, h half the piece. The order of the two bending hinges alternates from set to set, because
three successive rotations in one fixed order bend unequally in 3D. A body that stretches also has a slide of stiffness EA/h.

A tendon runs straight from hole to hole and ends where it enters its last disk. The hole of a thick disk runs from face to face
along its axis; the tendon turns at both faces.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from twin.body import Drive, Frame, Port, marker_senses, tendon_ports, tendon_senses, turn_senses
from twin.body.hinge_chain import HingeChain, JointSet
from twin.foundation.parameters import parameter_array
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.drawing import ChainFigure
from twin.mechanics.rod.dynamics import Dynamics
from twin.robots.families.backbone import BACKBONES, Backbone, Piece
from twin.robots.schemas.continuum import CONTINUUM_SCHEMA as SCHEMA
from twin.robots.schemas.continuum import Continuum, disk_masses, hole_places
from twin.robots.schemas.motor_rows import motor_ports, motor_senses

__all__ = ["SCHEMA", "build", "chain", "dynamics", "figure", "hand", "silicone", "statics"]

DISK_COLOUR = [0.72, 0.74, 0.78, 1.0]
BACKBONE_COLOUR = [0.35, 0.38, 0.44, 1.0]
CHAIN_TIMESTEP = 1e-3  # s
MIN_INERTIA = 1e-14  # kg m^2: MuJoCo refuses less than 1e-15; a millionth of a small disk's
MIN_DRAWN_THICKNESS = 1.5e-3  # m, of a drawn disk
CONTINUUM_FEATURES = frozenset({
    "weight", "elasticity", "rest shape", "markers", "load cells", "drives that saturate", "planes", "length", "holes", "surface",
    "viscosity", "drive zeros", "lines",
})  # fmt: skip
PULLING, PUSHING = frozenset({"rope", "slack"}), frozenset({"rods"})  # features of its tendons


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> HingeChain:
    """Build an editable MuJoCo model from `structure` and `values` (SI, by parameter name; see `twin.robots.schemas.continuum`).

    Base frame: origin on the backbone at the base hole plate, +z along the straight robot, angles from +x towards +y.
    """
    shape = Continuum.model_validate(dict(structure))
    n_disk, n_tendon = shape.disks, shape.tendons
    disk_z = np.concatenate([[0.0], np.cumsum(parameter_array(values, "disks.pitch", n_disk))])
    length = float(disk_z[-1])
    backbone = BACKBONES[shape.body](values, disk_z, shape.divided())
    disks = _disks(shape, values, disk_z)
    spec = _new_spec()
    tendons: list[list[str]] = [[] for _ in range(n_tendon)]
    _add_holes(spec.worldbody, disks[0], 0.0, tendons)
    plate = 1.3 * (values["disks.radius"] if not backbone.in_channels else backbone.radius(0.0))
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[plate, 1.5e-3, 0], pos=[0, 0, -1.5e-3],
        rgba=BACKBONE_COLOUR, contype=0, conaffinity=0, mass=0,
    )  # fmt: skip

    joints, parent, before = [], spec.worldbody, 0.0
    for j, piece in enumerate(backbone.pieces()):
        z = piece.place
        body = parent.add_body(name=f"link_{j + 1}", pos=[0, 0, z - before])
        joints.append(_add_joint_set(body, j, piece, length, backbone, values["damping.time"]))
        disk = disks[piece.disk] if piece.disk is not None else None
        _add_mass(body, piece, disk if not backbone.in_channels else None, backbone, first=j == 0)
        if disk is not None:
            at = disk.z - z
            _add_holes(body, disk, at, tendons)
            body.add_site(name=f"disk_{disk.number}_centre", pos=[0, 0, at], size=[5e-4, 0, 0])
            for name, offset, turn in _markers_on_disk(shape, disk.number, values):
                place = [*offset[:2], at + offset[2]]
                body.add_site(name=name, pos=place, quat=turn, size=[1.2e-3, 0, 0], rgba=[0.9, 0.2, 0.2, 1])
            for m in (m for m, k in enumerate(shape.imus) if k == disk.number):
                turn = _turn(values, "imus", m, len(shape.imus))
                body.add_site(name=f"imu_{m + 1}", pos=[0, 0, at], quat=turn, size=[5e-4, 0, 0])
        parent, before = body, z
    for i, sites in enumerate(tendons, 1):
        add_segments(spec, i, sites)
    return _assemble_body(shape, values, spec, tuple(joints), tuple(tuple(s) for s in tendons), length)


def _assemble_body(
    shape: Continuum, values: Mapping[str, float], spec: mujoco.MjSpec, joints: tuple[JointSet, ...],
    tendons: tuple[tuple[str, ...], ...], length: float,
) -> HingeChain:  # fmt: skip
    """Return the body of a finished model, with the names of its joints and sites."""
    n_disk, n_tendon, listed = shape.disks, shape.tendons, shape.markers != "disk"
    markers = [f"marker_{m}" for m in range(1, len(shape.markers) + 1)] if listed else [f"disk_{k}" for k in range(1, n_disk + 1)]
    tip = f"disk_{n_disk}_centre"
    return HingeChain(
        spec=spec,
        n_tendon=n_tendon,
        features=CONTINUUM_FEATURES | (PUSHING if shape.rods else PULLING),
        ports=_ports(shape, values),
        dynamic_drives=frozenset({Drive.TENSION, Drive.DISPLACEMENT, Drive.CURRENT}),
        senses=tendon_senses(n_tendon)
        | motor_senses(len(shape.motors or ()), values)
        | marker_senses([*markers, "tip"])
        | turn_senses([*markers, "tip"], len(shape.imus)),
        frame=Frame.from_values(values),
        damping_time=values["damping.time"],
        joints=joints,
        tendon_sites=tendons,
        marker_sites=(*markers, tip if listed else f"disk_{n_disk}"),
        imu_sites=tuple(f"imu_{m + 1}" for m in range(len(shape.imus))),
        disks=tuple(f"disk_{k}_centre" for k in range(1, n_disk + 1)),
        tip=tip,
        length=length,
        straight_tendons=shape.body == "wire",
        stiffening=values.get("backbone.stiffening", 0.0),
    )


def _ports(shape: Continuum, values: Mapping[str, float]) -> tuple[tuple[Port, ...], ...]:
    own = tendon_ports(shape.tendons, values.get("springs.resistance", 1.0))
    wound = motor_ports(shape.motors or (), values, shape.tendons)
    return tuple((*ports, *wound.get(t, ())) for t, ports in enumerate(own))


@dataclass(frozen=True)
class _Disk:
    """A disk (SI); the base plate is number 0."""

    number: int
    z: float  # of its centre
    mass: float
    radius: float
    thickness: float
    holes: list[tuple[float, float, bool] | None]  # of each tendon: x, y, whether it goes on beyond; None if it ended before


def _disks(shape: Continuum, values: Mapping[str, float], disk_z: np.ndarray) -> list[_Disk]:
    n, wire = shape.disks, shape.body == "wire"
    mass, thickness = np.zeros(n + 1), np.zeros(n + 1)
    if wire:
        mass[1:], thickness[1:] = disk_masses(values, n), parameter_array(values, "disks.thickness", n)
    radius, angle = hole_places(shape, values)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    ends, rim = shape.ends(), values.get("disks.radius", 0.0)
    return [
        _Disk(
            k, float(disk_z[k]), float(mass[k]), rim, float(thickness[k]),
            [(float(x[t, k]), float(y[t, k]), k < end) if k <= end else None for t, end in enumerate(ends)],
        )
        for k in range(n + 1)
    ]  # fmt: skip


def _markers_on_disk(shape: Continuum, disk: int, values: Mapping[str, float]) -> list[tuple[str, list[float], list[float]]]:
    """Return the names of the markers on a disk, their offsets (m) from its centre, and the quaternions of their axes."""
    if shape.markers == "disk":
        offset = [0.0, 0.0, float(parameter_array(values, "markers.axial_offset", shape.disks)[disk - 1])]
        return [(f"disk_{disk}", offset, _turn(values, "markers", disk - 1, shape.disks))]
    n = len(shape.markers)
    offsets = np.stack([parameter_array(values, f"markers.offset_{a}", n) for a in "xyz"], axis=1)
    return [
        (f"marker_{m + 1}", offsets[m].tolist(), _turn(values, "markers", m, n)) for m, k in enumerate(shape.markers) if k == disk
    ]


def _turn(values: Mapping[str, float], what: str, m: int, n: int) -> list[float]:
    """Return the quaternion of the m-th of n axes, from the rotation vector `what`.turn_x, turn_y, turn_z."""
    vector = [parameter_array(values, f"{what}.turn_{a}", n)[m] for a in "xyz"]
    return Rotation.from_rotvec(vector).as_quat(scalar_first=True).tolist()


def _new_spec() -> mujoco.MjSpec:
    """Return an empty model. Only the `discrete` integrator is implicit in position, as a 0.4 mm NiTi rod needs at 1 ms steps."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = CHAIN_TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    return spec


def _add_joint_set(body: mujoco.MjsBody, j: int, piece: Piece, length: float, backbone: Backbone, damping_time: float) -> JointSet:
    stiffness = backbone.stiffness(piece)
    hinges = ("bend_x", "bend_y", "twist") if j % 2 == 0 else ("bend_y", "bend_x", "twist")
    slide = ("slide",) if math.isfinite(stiffness.stretch) else ()
    kinds = (
        (*hinges, *slide) if j % 2 == 0 else (*slide, *hinges)
    )  # slides are in the link between two sets, so that hinges stay at their holes
    names = {kind: f"{kind}_{j + 1}" for kind in kinds}
    axes = {"bend_x": [1, 0, 0], "bend_y": [0, 1, 0], "twist": [0, 0, 1], "slide": [0, 0, 1]}
    values = {"bend_x": stiffness.bend_x, "bend_y": stiffness.bend_y, "twist": stiffness.twist, "slide": stiffness.stretch}
    for kind, name in names.items():
        joint_type = mujoco.mjtJoint.mjJNT_SLIDE if kind == "slide" else mujoco.mjtJoint.mjJNT_HINGE
        joint = body.add_joint(name=name, type=joint_type, axis=axes[kind])
        joint.stiffness = [values[kind], 0, 0]
        joint.damping = [damping_time * values[kind], 0, 0]
    return JointSet(
        names["bend_x"], names["bend_y"], names["twist"], piece.place / length, piece.end - piece.start, names.get("slide")
    )


def _add_mass(body: mujoco.MjsBody, piece: Piece, disk: _Disk | None, backbone: Backbone, *, first: bool) -> None:
    """Set the inertia of a link's piece of backbone and of its disk, if any, about their common centre."""
    start, end = piece.tail - piece.place, piece.head - piece.place
    span, middle = end - start, 0.5 * (start + end)
    own, radius = backbone.mass(piece.tail, piece.head), backbone.radius(0.5 * (piece.tail + piece.head))
    parts = [(own, middle, own * (span**2 / 12.0 + radius**2 / 4.0), 0.5 * own * radius**2)]  # m, z, Ixx, Izz
    if disk is not None:
        m, r, at = disk.mass, disk.radius, disk.z - piece.place
        parts.append((m, at, m * (r**2 / 4.0 + disk.thickness**2 / 12.0), m * r**2 / 2.0))
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[r, 0.5 * max(disk.thickness, MIN_DRAWN_THICKNESS), 0], pos=[0, 0, at],
            rgba=DISK_COLOUR, contype=0, conaffinity=0, mass=0,
        )  # fmt: skip
    mass = sum(p[0] for p in parts)
    centre = sum(p[0] * p[1] for p in parts) / mass
    across = max(MIN_INERTIA, sum(p[2] + p[0] * (p[1] - centre) ** 2 for p in parts))
    body.mass, body.ipos, body.explicitinertial = mass, [0, 0, centre], True
    body.inertia = [across, across, max(MIN_INERTIA, sum(p[3] for p in parts))]
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, 0, 0], fromto=[0, 0, -piece.place if first else start, 0, 0, end],
        rgba=BACKBONE_COLOUR, contype=0, conaffinity=0, mass=0,
    )  # fmt: skip


def _add_holes(body: mujoco.MjsBody, disk: _Disk, z: float, tendons: list[list[str]]) -> None:
    """Add the disk's holes, at height z of its link, as sites to the tendons' lists; a thick disk has one at each face."""
    half = 0.5 * disk.thickness
    for i, hole in enumerate(disk.holes, 1):
        if hole is None:
            continue
        x, y, goes_on = hole
        for suffix, at in (("", -half), ("_far", half)) if half > 0.0 and goes_on else (("", -half),):
            name = f"tendon_{i}_hole_{disk.number}{suffix}"
            body.add_site(name=name, pos=[x, y, z + at], size=[5e-4, 0, 0])
            tendons[i - 1].append(name)


def add_segments(spec: mujoco.MjSpec, i: int, sites: Sequence[str]) -> None:
    """Add a two-site tendon and a motor for each segment, so that tension may differ along the tendon; ctrl = tension in N."""
    for d in range(len(sites) - 1):
        name = f"tendon_{i}_segment_{d + 1}"
        tendon = spec.add_tendon(name=name, width=2.5e-4, rgba=[0.85, 0.6, 0.15, 1])
        tendon.wrap_site(sites[d])
        tendon.wrap_site(sites[d + 1])
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
        motor.gear = [-1, 0, 0, 0, 0, 0]


statics, dynamics = Equilibrium, Dynamics


def figure(body: HingeChain) -> ChainFigure:
    return ChainFigure(body, statics(body))


def chain(body: HingeChain) -> HingeChain:
    return body


silicone = hand = None
