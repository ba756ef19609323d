"""A slender elastic backbone pulled by tendons through holes, as a chain of MuJoCo joints.

Each interval between two disks has two joint sets (backbone.py says where and how stiff). A set is three hinges with stiffness
EI/h, EI/h, GJ/h, h half the interval; the order of the two bending hinges alternates from set to set, because three
successive rotations in one fixed order bend unequally in 3D. A body that stretches has a slide of stiffness EA/h beside them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco
import numpy as np

from twin.body import Frame, marker_senses, tendon_ports, tendon_senses
from twin.dynamics import Dynamics
from twin.equilibrium import Equilibrium
from twin.hinges import HingeChain, JointSet
from twin.quantities import each
from twin.robots.backbone import BODIES, Backbone, Piece
from twin.robots.continuum_schema import SCHEMA, Continuum

__all__ = ["SCHEMA", "build", "dynamics", "statics"]

ALUMINIUM = [0.72, 0.74, 0.78, 1.0]
NITI = [0.35, 0.38, 0.44, 1.0]
TIMESTEP = 1e-3  # s


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> HingeChain:
    """The robot of `structure` (counts) and `values` (SI, by parameter name) as an editable MuJoCo model.

    Base frame: origin on the backbone at the base hole plate, +z along the straight robot, angles from +x towards +y.
    What `structure` and `values` hold is in continuum_schema.py.
    """
    shape = Continuum.model_validate(dict(structure))
    n_disk, n_tendon, end = shape.disks, shape.tendons, shape.tendons_end or shape.disks
    on_disk = None if shape.markers == "disk" else list(shape.markers)
    disk_z = np.concatenate([[0.0], np.cumsum(each(values, "disks.pitch", n_disk))])
    length = float(disk_z[-1])
    backbone = BODIES[shape.body](values, disk_z)
    spec = _world()
    angles = list(each(values, "tendons.angle", n_tendon))
    tendons = [[f"tendon_{i}_hole_{k}" for k in range(end + 1)] for i in range(1, n_tendon + 1)]
    _drill(spec.worldbody, backbone.hole_radius(0.0), angles, 0, 0.0)
    plate = 1.3 * (values["disks.radius"] if not backbone.in_channels else backbone.radius(0.0))
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[plate, 1.5e-3, 0], pos=[0, 0, -1.5e-3],
        rgba=NITI, contype=0, conaffinity=0, mass=0,
    )  # fmt: skip

    joints, parent, before = [], spec.worldbody, 0.0
    for j, piece in enumerate(backbone.pieces()):
        z = piece.place
        body = parent.add_body(name=f"link_{j + 1}", pos=[0, 0, z - before])
        joints.append(_joint_set(body, j, piece, length, backbone, values["damping.time"]))
        disk = j // 2 + 1 if j % 2 else None
        _add_mass(body, piece, float(disk_z[disk]) if disk else None, backbone, values, n_disk, first=j == 0)
        if disk is not None:
            at = float(disk_z[disk] - z)
            if disk <= end:
                _drill(body, backbone.hole_radius(float(disk_z[disk])), angles, disk, at)
            body.add_site(name=f"disk_{disk}_centre", pos=[0, 0, at], size=[5e-4, 0, 0])
            for name, offset in _glued(shape, disk, values):
                body.add_site(name=name, pos=[*offset[:2], at + offset[2]], size=[1.2e-3, 0, 0], rgba=[0.9, 0.2, 0.2, 1])
        parent, before = body, z
    for i, sites in enumerate(tendons, 1):
        _thread(spec, i, sites)
    markers = (
        [f"disk_{k}" for k in range(1, n_disk + 1)] if on_disk is None else [f"marker_{m}" for m in range(1, len(on_disk) + 1)]
    )
    tip = f"disk_{n_disk}" if on_disk is None else f"disk_{n_disk}_centre"
    return HingeChain(
        spec=spec,
        n_tendon=n_tendon,
        parts=frozenset(
            {"weight", "elasticity", "backbone", "markers", "load cells", "planes", "length", "holes", "surface", "viscosity"}
        ),
        drives=tendon_ports(n_tendon, values.get("springs.resistance", 1.0)),
        senses=tendon_senses(n_tendon) | marker_senses([*markers, "tip"]),
        frame=Frame.of(values),
        joints=tuple(joints),
        tendons=tuple(tuple(s) for s in tendons),
        markers=(*markers, tip),
        disks=tuple(f"disk_{k}_centre" for k in range(1, n_disk + 1)),
        tip=f"disk_{n_disk}_centre",
        length=length,
        bows=not backbone.in_channels,
        stiffening=values.get("backbone.stiffening", 0.0),
    )


def _glued(shape: Continuum, disk: int, values: Mapping[str, float]) -> list[tuple[str, list[float]]]:
    """Names of the markers on a disk, and where they sit from its centre (m)."""
    if shape.markers == "disk":
        return [(f"disk_{disk}", [0.0, 0.0, float(each(values, "markers.axial_offset", shape.disks)[disk - 1])])]
    offsets = np.stack([each(values, f"markers.offset_{a}", len(shape.markers)) for a in "xyz"], axis=1)
    return [(f"marker_{m + 1}", offsets[m].tolist()) for m, k in enumerate(shape.markers) if k == disk]


def _world() -> mujoco.MjSpec:
    """`discrete` is the one integrator implicit in position, which a 0.4 mm NiTi rod needs at millisecond steps."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    return spec


def _joint_set(body: mujoco.MjsBody, j: int, piece: Piece, length: float, backbone: Backbone, damping_time: float) -> JointSet:
    stiffness = backbone.stiffness(piece)
    hinges = ("bend_x", "bend_y", "twist") if j % 2 == 0 else ("bend_y", "bend_x", "twist")
    slide = ("slide",) if math.isfinite(stiffness.stretch) else ()
    kinds = (*hinges, *slide) if j % 2 == 0 else (*slide, *hinges)  # slides in the link between: hinges stay at their holes
    names = {kind: f"{kind}_{j + 1}" for kind in kinds}
    axes = {"bend_x": [1, 0, 0], "bend_y": [0, 1, 0], "twist": [0, 0, 1], "slide": [0, 0, 1]}
    each = {"bend_x": stiffness.bend, "bend_y": stiffness.bend, "twist": stiffness.twist, "slide": stiffness.stretch}
    for kind, name in names.items():
        shape = mujoco.mjtJoint.mjJNT_SLIDE if kind == "slide" else mujoco.mjtJoint.mjJNT_HINGE
        joint = body.add_joint(name=name, type=shape, axis=axes[kind])
        joint.stiffness = [each[kind], 0, 0]
        joint.damping = [damping_time * each[kind], 0, 0]
    return JointSet(
        names["bend_x"], names["bend_y"], names["twist"], piece.place / length, piece.end - piece.start, names.get("slide")
    )


def _add_mass(
    body: mujoco.MjsBody, piece: Piece, disk_z: float | None, backbone: Backbone, values: Mapping[str, float], n_disk: int,
    *, first: bool,
) -> None:  # fmt: skip
    """The link's piece of backbone and, where it carries one, its disk, as one inertia about their common centre."""
    start, end = piece.tail - piece.place, piece.head - piece.place
    span, middle = end - start, 0.5 * (start + end)
    own, radius = backbone.mass(piece.tail, piece.head), backbone.radius(0.5 * (piece.tail + piece.head))
    parts = [(own, middle, own * (span**2 / 12.0 + radius**2 / 4.0), 0.5 * own * radius**2)]  # m, z, Ixx, Izz
    if disk_z is not None and not backbone.in_channels:
        m, r, at = values["disks.mass"] / n_disk, values["disks.radius"], disk_z - piece.place
        parts.append((m, at, m * r**2 / 4.0, m * r**2 / 2.0))
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[r, 7.5e-4, 0], pos=[0, 0, at],
            rgba=ALUMINIUM, contype=0, conaffinity=0, mass=0,
        )  # fmt: skip
    mass = sum(p[0] for p in parts)
    centre = sum(p[0] * p[1] for p in parts) / mass
    across = sum(p[2] + p[0] * (p[1] - centre) ** 2 for p in parts)
    body.mass, body.ipos, body.explicitinertial = mass, [0, 0, centre], True
    body.inertia = [across, across, sum(p[3] for p in parts)]
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, 0, 0], fromto=[0, 0, -piece.place if first else start, 0, 0, end],
        rgba=NITI, contype=0, conaffinity=0, mass=0,
    )  # fmt: skip


def _drill(body: mujoco.MjsBody, radius: float, angles: list[float], disk: int, z: float) -> None:
    for i, angle in enumerate(angles, 1):
        at = [radius * math.cos(angle), radius * math.sin(angle), z]
        body.add_site(name=f"tendon_{i}_hole_{disk}", pos=at, size=[5e-4, 0, 0])


def _thread(spec: mujoco.MjSpec, i: int, sites: list[str]) -> None:
    """One two-site tendon and one motor per segment, so that tension may differ along the tendon; ctrl = tension in N."""
    for d in range(len(sites) - 1):
        name = f"tendon_{i}_segment_{d + 1}"
        tendon = spec.add_tendon(name=name, width=2.5e-4, rgba=[0.85, 0.6, 0.15, 1])
        tendon.wrap_site(sites[d])
        tendon.wrap_site(sites[d + 1])
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
        motor.gear = [-1, 0, 0, 0, 0, 0]


def statics(body: HingeChain) -> Equilibrium:
    return Equilibrium(body)


def dynamics(body: HingeChain) -> Dynamics:
    return Dynamics(body)
