"""Writes the numbers of a changed compiled model back into the MJCF that it came from, by name, and proves that they arrived."""

from __future__ import annotations

import mujoco
import numpy as np

from twin.foundation.errors import DataError
from twin.mechanics.mjcf.loading import SCALAR_JOINTS, LoadedModel
from twin.mechanics.mjcf.xml.precise import WrittenModel, self_contained

ROUNDING = 1e-10  # relative, of numbers that MuJoCo computes in another order from a file than from a changed model
_INERTIA = ("body_mass", "body_inertia", "body_ipos", "body_iquat")
# What decides a motion: of these arrays a written model must have the same numbers.
_PHYSICS = (
    "body_pos", "body_quat", *_INERTIA, "jnt_pos", "jnt_axis", "jnt_range", "jnt_stiffness", "jnt_margin", "jnt_solref",
    "jnt_solimp", "dof_damping", "dof_armature", "dof_frictionloss", "qpos0", "qpos_spring", "geom_pos", "geom_quat", "geom_size",
    "geom_friction", "site_pos", "site_quat", "tendon_stiffness", "tendon_damping", "tendon_frictionloss", "tendon_armature",
    "tendon_lengthspring", "tendon_range", "wrap_prm", "actuator_gainprm", "actuator_biasprm", "actuator_dynprm", "actuator_gear",
    "actuator_forcerange", "actuator_ctrlrange", "actuator_damping", "actuator_armature", "actuator_delay", "eq_data", "key_qpos",
    "key_qvel", "key_ctrl",
)  # fmt: skip


def written_model(loaded: LoadedModel, wanted: mujoco.MjModel) -> tuple[mujoco.MjSpec, WrittenModel]:
    """Return the described MJCF with the numbers of `wanted`, a changed copy of its model, for further edits, and its files.

    Raises DataError where a number cannot be written.
    """
    spec = loaded.spec.copy()
    spec.compile()
    described = self_contained(spec, loaded.path.parent)
    spec = described.spec()
    spec.compile()  # numbers the elements
    _write_bodies(spec, loaded.model, wanted)
    _write_joints(spec, loaded.model, wanted)
    _write_places(spec, loaded.model, wanted)
    _write_tendons(spec, loaded.model, wanted)
    _write_actuators(spec, loaded.model, wanted)
    spec.option.gravity = wanted.opt.gravity
    spec.option.integrator = wanted.opt.integrator
    check_same(spec.compile(), wanted, loaded.path.name)
    return spec, described


def check_same(written: mujoco.MjModel, wanted: mujoco.MjModel, name: str) -> None:
    """Raise DataError, with the element, where a written model is another than the one wanted."""
    for field in _PHYSICS:
        a, b = (np.array(getattr(model, field), float) for model in (written, wanted))
        if field == "geom_size" and a.shape == b.shape:  # a sphere has one size, whatever stands in the others
            a, b = (np.where(_sizes(wanted), sizes, 0.0) for sizes in (a, b))
        if a.shape != b.shape or not np.allclose(a, b, rtol=ROUNDING, atol=1e-14):
            where = np.argwhere(~np.isclose(a, b, rtol=ROUNDING, atol=1e-14))[0] if a.shape == b.shape else ()
            at = f"[{', '.join(map(str, where))}]" if len(where) else ""
            raise DataError(
                f"model {name!r} cannot be written with its new numbers: {field}{at} would be another; say in the MJCF what the "
                "compiler works out by itself (inertial instead of settotalmass or balanceinertia)"
            )


def _sizes(model: mujoco.MjModel) -> np.ndarray:
    """Return (ngeom, 3) which sizes a geom of its type has."""
    G = mujoco.mjtGeom
    few = {int(G.mjGEOM_SPHERE): 1, int(G.mjGEOM_CAPSULE): 2, int(G.mjGEOM_CYLINDER): 2}
    return np.arange(3) < np.array([few.get(int(kind), 3) for kind in model.geom_type]).reshape(-1, 1)


def name_element(spec: mujoco.MjSpec, loaded: LoadedModel, kind: str, name: str) -> None:
    """Give an element of a compiled spec, if it has none, the name by which it is addressed."""
    elements = {
        "body": spec.bodies, "joint": spec.joints, "site": spec.sites, "geom": spec.geoms, "tendon": spec.tendons,
        "actuator": spec.actuators,
    }[kind]  # fmt: skip
    element = next(e for e in elements if e.id == loaded.names(kind).index(name))
    element.name = element.name or name


def _write_bodies(spec: mujoco.MjSpec, old: mujoco.MjModel, new: mujoco.MjModel) -> None:
    """Write positions of bodies, and masses with their inertias as an <inertial> where they changed."""
    changed = np.any([_changed(old, new, field) for field in _INERTIA], axis=0)
    if _changed(old, new, "geom_pos").any():  # what a geom weighs stays where it was
        changed[old.geom_bodyid[_changed(old, new, "geom_pos")]] = True
    always_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    if (spec.compiler.settotalmass > 0.0 or always_geoms) and changed.any():
        spec.compiler.settotalmass = -1.0
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
        changed[1:] = True
    for body in spec.bodies:
        k = body.id
        if k > 0 and changed[k]:
            body.explicitinertial = True
            body.mass, body.ipos, body.inertia = float(new.body_mass[k]), new.body_ipos[k], new.body_inertia[k]
            body.iquat, body.fullinertia = new.body_iquat[k], np.full(6, np.nan)
        if k > 0 and _changed(old, new, "body_pos")[k]:
            body.pos = body.pos + _in_frames(body.frame, new.body_pos[k] - old.body_pos[k])


def _write_joints(spec: mujoco.MjSpec, old: mujoco.MjModel, new: mujoco.MjModel) -> None:
    for joint in spec.joints:
        k = joint.id
        dof, qpos = int(new.jnt_dofadr[k]), int(new.jnt_qposadr[k])
        joint.armature, joint.frictionloss = float(new.dof_armature[dof]), float(new.dof_frictionloss[dof])
        damping, stiffness = np.array(joint.damping), np.array(joint.stiffness)
        damping[0], stiffness[0] = new.dof_damping[dof], new.jnt_stiffness[k]
        joint.damping, joint.stiffness = damping, stiffness
        if new.jnt_type[k] in SCALAR_JOINTS:
            joint.springref = float(new.qpos_spring[qpos])
        if (old.jnt_range[k] != new.jnt_range[k]).any() or old.jnt_limited[k] != new.jnt_limited[k]:
            joint.range, joint.limited = new.jnt_range[k], int(new.jnt_limited[k])
            joint.solref_limit, joint.solimp_limit = new.jnt_solref[k], new.jnt_solimp[k]
        joint.pos = joint.pos + _in_frames(joint.frame, new.jnt_pos[k] - old.jnt_pos[k])


def _write_places(spec: mujoco.MjSpec, old: mujoco.MjModel, new: mujoco.MjModel) -> None:
    for site in spec.sites:
        site.pos = site.pos + _in_frames(site.frame, new.site_pos[site.id] - old.site_pos[site.id])
    for geom in spec.geoms:
        geom.pos = geom.pos + _in_frames(geom.frame, new.geom_pos[geom.id] - old.geom_pos[geom.id])


def _write_tendons(spec: mujoco.MjSpec, old: mujoco.MjModel, new: mujoco.MjModel) -> None:
    for tendon in spec.tendons:
        k = tendon.id
        tendon.frictionloss, tendon.armature = float(new.tendon_frictionloss[k]), float(new.tendon_armature[k])
        damping, stiffness = np.array(tendon.damping), np.array(tendon.stiffness)
        damping[0], stiffness[0] = new.tendon_damping[k], new.tendon_stiffness[k]
        tendon.damping, tendon.stiffness = damping, stiffness
        tendon.springlength = new.tendon_lengthspring[k]


def _write_actuators(spec: mujoco.MjSpec, old: mujoco.MjModel, new: mujoco.MjModel) -> None:
    for actuator in spec.actuators:
        k = actuator.id
        for field in ("gainprm", "biasprm", "dynprm", "forcerange"):
            if _changed(old, new, f"actuator_{field}")[k]:
                setattr(actuator, field, getattr(new, f"actuator_{field}")[k])
        if new.actuator_forcelimited[k] != old.actuator_forcelimited[k]:
            actuator.forcelimited = bool(new.actuator_forcelimited[k])
        damping = np.array(actuator.damping)
        damping[0] = new.actuator_damping[k]
        actuator.damping, actuator.armature = damping, float(new.actuator_armature[k])


def _changed(old: mujoco.MjModel, new: mujoco.MjModel, field: str) -> np.ndarray:
    """Return (n,) whether the numbers of each element differ."""
    a, b = getattr(old, field), getattr(new, field)
    return np.array([np.any(x != y) for x, y in zip(a, b, strict=True)], bool)


def _in_frames(frame: mujoco.MjsFrame | None, shift: np.ndarray) -> np.ndarray:
    """Return a shift (3,) m in a body's frame as seen in the nested `frame` in which an element is written."""
    if not np.any(shift):
        return np.zeros(3)
    turns = []
    while frame is not None:
        turns.append(np.array(frame.quat))
        frame = frame.frame
    for quat in reversed(turns):  # outermost first
        out, back = np.empty(3), np.empty(4)
        mujoco.mju_negQuat(back, quat)
        mujoco.mju_rotVecQuat(out, np.asarray(shift, float), back)
        shift = out
    return shift
