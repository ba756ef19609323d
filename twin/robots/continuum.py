"""A slender elastic backbone with rigid disks and tendons straight between the disks' holes, as a MuJoCo hinge chain.

Each interval between two disks has two joint sets, at 1/6 and 5/6 of it, so that the mean height of the polyline over the
chord equals the arc's (the tendon's moment arm is then right to second order). A set is three hinges with stiffness
EI/h, EI/h, GJ/h, h half the interval; the order of the two bending hinges alternates from set to set, because three
successive rotations in one fixed order bend unequally in 3D.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco
import numpy as np

from twin.errors import DataError
from twin.robots.body import Body, JointSet

PLACES = (1.0 / 6.0, 5.0 / 6.0)  # of a disk interval
ALUMINIUM = [0.72, 0.74, 0.78, 1.0]
NITI = [0.35, 0.38, 0.44, 1.0]
TIMESTEP = 1e-3  # s


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> Body:
    """The robot of `structure` (counts) and `values` (SI, by parameter name) as an editable MuJoCo model.

    Base frame: origin on the backbone at the base hole plate, +z along the straight robot, angles from +x towards +y.
    """
    n_disk, n_tendon = int(structure["disks"]), int(structure["tendons"])  # type: ignore[call-overload]
    _check(n_disk, n_tendon, values)
    pitch = np.array([values[f"disks.pitch_{k}"] for k in range(1, n_disk + 1)])
    disk_z = np.concatenate([[0.0], np.cumsum(pitch)])
    length = float(disk_z[-1])
    place = [disk_z[k] + f * pitch[k] for k in range(n_disk) for f in PLACES]
    spec = _world()
    holes = [(values["tendons.radius"], values[f"tendons.angle_{i}"]) for i in range(1, n_tendon + 1)]
    tendons = [[f"tendon_{i}_hole_{k}" for k in range(n_disk + 1)] for i in range(1, n_tendon + 1)]
    _drill(spec.worldbody, holes, 0, 0.0)
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[1.3 * values["disks.radius"], 1.5e-3, 0], pos=[0, 0, -1.5e-3],
        rgba=NITI, contype=0, conaffinity=0, mass=0,
    )  # fmt: skip

    joints, parent, ends = [], spec.worldbody, [*place[1:], length]
    for j, (z, end) in enumerate(zip(place, ends, strict=True)):
        k = j // 2  # the interval, from disk k to disk k + 1
        body = parent.add_body(name=f"link_{j + 1}", pos=[0, 0, z - (place[j - 1] if j else 0.0)])
        joints.append(_joint_set(body, j, 0.5 * pitch[k], z / length, values))
        carries_disk = k + 1 if j % 2 else None
        _add_mass(body, z, end, disk_z, carries_disk, values, n_disk, first=j == 0)
        if carries_disk is not None:
            at = float(disk_z[carries_disk] - z)
            _drill(body, holes, carries_disk, at)
            body.add_site(name=f"disk_{carries_disk}_centre", pos=[0, 0, at], size=[5e-4, 0, 0])
            offset = values[f"markers.axial_offset_{carries_disk}"]
            body.add_site(name=f"disk_{carries_disk}", pos=[0, 0, at + offset], size=[1.2e-3, 0, 0], rgba=[0.9, 0.2, 0.2, 1])
        parent = body
    for i, sites in enumerate(tendons, 1):
        _thread(spec, i, sites)
    return Body(
        spec=spec,
        joints=tuple(joints),
        tendons=tuple(tuple(s) for s in tendons),
        markers={**{f"disk_{k}": f"disk_{k}" for k in range(1, n_disk + 1)}, "tip": f"disk_{n_disk}"},
        disks=tuple(f"disk_{k}_centre" for k in range(1, n_disk + 1)),
        tip=f"disk_{n_disk}_centre",
        length=length,
    )


LISTS = {"disks.pitch": "m", "markers.axial_offset": "m", "tendons.angle": "rad"}
SCALARS = {
    "backbone.radius": "m", "backbone.mass": "kg", "backbone.youngs_modulus": "Pa", "backbone.poisson_ratio": "1",
    "backbone.radius_taper": "1", "disks.mass": "kg", "disks.radius": "m", "tendons.radius": "m", "damping.time": "s",
}  # fmt: skip
UNITS = LISTS | SCALARS  # of the parameters this family is built from


def _check(n_disk: int, n_tendon: int, values: Mapping[str, float]) -> None:
    """Raises DataError for counts and parameters this family cannot be built from."""
    if n_disk < 1 or n_tendon < 1:
        raise DataError(f"disks = {n_disk}, tendons = {n_tendon}; at least one of each is needed")
    length = dict.fromkeys(LISTS, n_disk) | {"tendons.angle": n_tendon}
    needed = {*SCALARS, *(f"{name}_{k}" for name, n in length.items() for k in range(1, n + 1))}
    if missing := sorted(needed - set(values)):
        raise DataError(f"parameter {missing[0]!r} is missing; {n_disk} disks and {n_tendon} tendons need it")


def _world() -> mujoco.MjSpec:
    """`discrete` is the one integrator implicit in position, which a 0.4 mm NiTi rod needs at millisecond steps."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    return spec


def _joint_set(body: mujoco.MjsBody, j: int, h: float, arclength: float, values: Mapping[str, float]) -> JointSet:
    radius = values["backbone.radius"] * (1.0 + values["backbone.radius_taper"] * (0.5 - arclength))
    bending = values["backbone.youngs_modulus"] * math.pi * radius**4 / 4.0  # EI, N m^2
    twisting = bending / (1.0 + values["backbone.poisson_ratio"])  # GJ, N m^2
    names = {"x": f"bend_x_{j + 1}", "y": f"bend_y_{j + 1}", "z": f"twist_{j + 1}"}
    axes = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
    for axis in "xyz" if j % 2 == 0 else "yxz":
        stiffness = (twisting if axis == "z" else bending) / h
        joint = body.add_joint(name=names[axis], type=mujoco.mjtJoint.mjJNT_HINGE, axis=axes[axis])
        joint.stiffness = [stiffness, 0, 0]
        joint.damping = [values["damping.time"] * stiffness, 0, 0]
    return JointSet(names["x"], names["y"], names["z"], arclength, h)


def _add_mass(
    body: mujoco.MjsBody, z: float, end: float, disk_z: np.ndarray, disk: int | None, values: Mapping[str, float],
    n_disk: int, *, first: bool,
) -> None:  # fmt: skip
    """The link's piece of wire and, where it carries one, its disk, as one inertia about their common centre."""
    span = end - z
    wire = values["backbone.mass"] * span / disk_z[-1]
    parts = [(wire, 0.5 * span, wire * span**2 / 12.0, 0.5 * wire * values["backbone.radius"] ** 2)]  # m, z, Ixx, Izz
    if disk is not None:
        m, r = values["disks.mass"] / n_disk, values["disks.radius"]
        parts.append((m, float(disk_z[disk]) - z, m * r**2 / 4.0, m * r**2 / 2.0))
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[r, 7.5e-4, 0], pos=[0, 0, float(disk_z[disk]) - z],
            rgba=ALUMINIUM, contype=0, conaffinity=0, mass=0,
        )  # fmt: skip
    mass = sum(p[0] for p in parts)
    centre = sum(p[0] * p[1] for p in parts) / mass
    across = sum(p[2] + p[0] * (p[1] - centre) ** 2 for p in parts)
    body.mass, body.ipos, body.explicitinertial = mass, [0, 0, centre], True
    body.inertia = [across, across, sum(p[3] for p in parts)]
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[values["backbone.radius"], 0, 0], fromto=[0, 0, -z if first else 0, 0, 0, span],
        rgba=NITI, contype=0, conaffinity=0, mass=0,
    )  # fmt: skip


def _drill(body: mujoco.MjsBody, holes: list[tuple[float, float]], disk: int, z: float) -> None:
    for i, (radius, angle) in enumerate(holes, 1):
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
