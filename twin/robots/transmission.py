"""A rigid jaw at the end of a shaft, turned by two antagonist tendons that a drum at the other end pulls.

In MuJoCo the jaw is one hinge with a pulley; each tendon runs along the shaft and a quarter turn over the pulley to its anchor, so
that its moment arm is the pulley's radius from -90 to +90 deg. One motor a tendon, ctrl = tension (N) at the pulley.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco

from twin.errors import DataError
from twin.robots.body import Jaw

STEEL = [0.72, 0.74, 0.78, 1.0]
TIMESTEP = 1e-3  # s
ANCHOR = 1.001  # of the pulley's radius: an anchor inside the pulley would not be wrapped
COUNTS = ("tendons",)
UNITS = {
    "drum.radius": "m", "pulley.radius": "m", "jaw.rest": "rad", "jaw.length": "m", "jaw.mass": "kg", "shaft.length": "m",
    "tendons.wrap": "rad", "tendons.pretension": "N", "tendons.stretch": "m/N",
}  # fmt: skip


def build(structure: Mapping[str, object], values: Mapping[str, float]) -> Jaw:
    """The robot of `structure` and `values` (SI, by parameter name) as an editable MuJoCo model.

    Base frame: origin at the drum's end of the shaft, +z along it; the jaw turns about y. `structure`: tendons, 2; crossed, whether
    the jaw turns against the drum. Raises DataError for what this family cannot be built from.
    """
    crossed = structure.get("crossed", False)
    if structure["tendons"] != 2 or not isinstance(crossed, bool):
        raise DataError(f"structure: tendons = {structure['tendons']!r}, crossed = {crossed!r}; needed are 2, and true or false")
    if missing := sorted(set(UNITS) - set(values)):
        raise DataError(f"parameter {missing[0]!r} is missing; a transmission needs it")
    for name in ("drum.radius", "pulley.radius", "jaw.length", "jaw.mass", "shaft.length"):
        if not values[name] > 0.0:
            raise DataError(f"parameter {name!r} is {values[name]:g}; a number above zero is needed")
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep, spec.option.gravity = TIMESTEP, [0, 0, 0]
    radius, length = values["pulley.radius"], values["shaft.length"]
    shown = {"contype": 0, "conaffinity": 0, "mass": 0, "rgba": STEEL}
    lying = [math.sqrt(0.5), math.sqrt(0.5), 0, 0]  # a cylinder along y
    cylinder, capsule = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE
    spec.worldbody.add_geom(type=cylinder, size=[values["drum.radius"], radius, 0], quat=lying, **shown)
    spec.worldbody.add_geom(type=cylinder, size=[0.3 * radius, 0.5 * length, 0], pos=[0, 0, 0.5 * length], **shown)
    jaw = spec.worldbody.add_body(name="jaw", pos=[0, 0, length])
    jaw.add_joint(name="joint_2", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], ref=values["jaw.rest"])
    jaw.add_geom(name="pulley", type=cylinder, size=[radius, 0.5 * radius, 0], quat=lying, **shown)
    blade = {**shown, "mass": values["jaw.mass"]}
    jaw.add_geom(type=capsule, size=[0.3 * radius, 0, 0], fromto=[0, 0, 0, 0, 0, values["jaw.length"]], **blade)
    jaw.add_site(name="jaw_tip", pos=[0, 0, values["jaw.length"]], size=[5e-4, 0, 0])
    tendons = []
    for i, side in ((1, -1.0 if crossed else 1.0), (2, 1.0 if crossed else -1.0)):
        base, anchor, beside = f"tendon_{i}_base", f"tendon_{i}_anchor", f"tendon_{i}_side"
        spec.worldbody.add_site(name=base, pos=[side * radius, 0, 0], size=[5e-4, 0, 0])
        spec.worldbody.add_site(name=beside, pos=[2 * side * radius, 0, length + 2 * radius], size=[1e-4, 0, 0])
        jaw.add_site(name=anchor, pos=[0, 0, ANCHOR * radius], size=[5e-4, 0, 0])
        tendon = spec.add_tendon(name=f"tendon_{i}", width=2.5e-4, rgba=[0.85, 0.6, 0.15, 1])
        tendon.wrap_site(base)
        tendon.wrap_geom("pulley", beside)
        tendon.wrap_site(anchor)
        motor = spec.add_actuator(name=f"tendon_{i}", target=f"tendon_{i}", trntype=mujoco.mjtTrn.mjTRN_TENDON)
        motor.gear = [-1, 0, 0, 0, 0, 0]
        tendons.append((base, anchor))
    return Jaw(
        spec=spec,
        joints=(),
        tendons=tuple(tendons),
        markers={},
        disks=(),
        tip="jaw_tip",
        length=length,
        bows=False,
        pivots=("joint_2",),
        parts=frozenset({"antagonists"}),
        drum=values["drum.radius"],
        pulley=-radius if crossed else radius,
        rest=values["jaw.rest"],
        wrap=values["tendons.wrap"],
        pretension=values["tendons.pretension"],
        stretch=values["tendons.stretch"],
    )
