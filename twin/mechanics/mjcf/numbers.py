"""The numbers of a compiled model by address, KIND.NAME.ATTRIBUTE: joint.pip.damping, site.x.pos, actuator.index.kp.

An inertia is one number, the largest principal moment, and all components change by one factor. kp of a servo is -biasprm[1], and
gainprm[0] and biasprm[0] change by the same factor; of a motor it is gainprm[0]. kv is -biasprm[2].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from twin.mechanics.mjcf.loading import SCALAR_JOINTS

Write = Callable[[mujoco.MjModel, int, np.ndarray], None]
Read = Callable[[mujoco.MjModel, int], np.ndarray]


@dataclass(frozen=True)
class Attribute:
    """One attribute of a kind of element: how it is read and written, its units, its least value, its usual relative std and why.

    `unit` is that of an element that turns (a hinge, or what acts on one), `sliding_unit` that of one that slides or pulls.
    """

    read: Read
    write: Write
    unit: str
    sliding_unit: str
    positive: bool = True
    relative_std: float = 0.0  # by which built robots usually differ, where nothing is declared; 0: exact
    why: str = ""  # they differ by so much


def _field(name: str, at: Callable[[mujoco.MjModel, int], object] = lambda m, k: k) -> tuple[Read, Write]:
    """Return how a number, or a vector, in an array of the model is read and written."""

    def read(model: mujoco.MjModel, k: int) -> np.ndarray:
        return np.atleast_1d(np.array(getattr(model, name)[at(model, k)], float))

    def write(model: mujoco.MjModel, k: int, value: np.ndarray) -> None:
        array, where = getattr(model, name), at(model, k)
        array[where] = value if np.ndim(array[where]) else value[0]

    return read, write


def _dof(model: mujoco.MjModel, joint: int) -> object:
    return int(model.jnt_dofadr[joint])


def _qpos(model: mujoco.MjModel, joint: int) -> object:
    return int(model.jnt_qposadr[joint])


def _read_inertia(model: mujoco.MjModel, k: int) -> np.ndarray:
    return np.array([model.body_inertia[k].max()])


def _write_inertia(model: mujoco.MjModel, k: int, value: np.ndarray) -> None:
    model.body_inertia[k] *= value[0] / max(float(model.body_inertia[k].max()), 1e-300)


def _read_kp(model: mujoco.MjModel, k: int) -> np.ndarray:
    servo = float(model.actuator_biasprm[k, 1])
    return np.array([-servo if servo else model.actuator_gainprm[k, 0]])


def _write_kp(model: mujoco.MjModel, k: int, value: np.ndarray) -> None:
    if servo := float(model.actuator_biasprm[k, 1]):
        model.actuator_gainprm[k, 0] *= value[0] / -servo
        model.actuator_biasprm[k, 0] *= value[0] / -servo
        model.actuator_biasprm[k, 1] = -value[0]
    else:
        model.actuator_gainprm[k, 0] = value[0]


def _read_kv(model: mujoco.MjModel, k: int) -> np.ndarray:
    return np.array([-model.actuator_biasprm[k, 2]])


def _write_kv(model: mujoco.MjModel, k: int, value: np.ndarray) -> None:
    model.actuator_biasprm[k, 2] = -value[0]


_WEIGHED = "parts are weighed, or drawn without screws, glue and cables"
_ONE_DENSITY = "drawn as if each part had one density"
_SPRING = "springs are sold to ten per cent"
_BY_HAND = "seldom measured; mostly chosen by hand"
_ROTOR = "a rotor's inertia times its gear ratio squared, seldom on a data sheet"
_GAIN = "a drive's units and its supply are known to some per cent"

ATTRIBUTES: dict[str, dict[str, Attribute]] = {
    "body": {
        "mass": Attribute(*_field("body_mass"), "kg", "kg", relative_std=0.03, why=_WEIGHED),
        "inertia": Attribute(_read_inertia, _write_inertia, "kg*m^2", "kg*m^2", relative_std=0.05, why=_ONE_DENSITY),
        "pos": Attribute(*_field("body_pos"), "m", "m", positive=False),
        "ipos": Attribute(*_field("body_ipos"), "m", "m", positive=False),
    },
    "joint": {
        "stiffness": Attribute(*_field("jnt_stiffness"), "N*m/rad", "N/m", relative_std=0.1, why=_SPRING),
        "damping": Attribute(*_field("dof_damping", _dof), "N*m*s/rad", "N*s/m", relative_std=0.3, why=_BY_HAND),
        "armature": Attribute(*_field("dof_armature", _dof), "kg*m^2", "kg", relative_std=0.3, why=_ROTOR),
        "frictionloss": Attribute(*_field("dof_frictionloss", _dof), "N*m", "N", relative_std=0.3, why=_BY_HAND),
        "springref": Attribute(*_field("qpos_spring", _qpos), "rad", "m", positive=False),
        "range": Attribute(*_field("jnt_range"), "rad", "m", positive=False),
        "pos": Attribute(*_field("jnt_pos"), "m", "m", positive=False),
    },
    "tendon": {
        "stiffness": Attribute(*_field("tendon_stiffness"), "N/m", "N/m", relative_std=0.1, why=_SPRING),
        "damping": Attribute(*_field("tendon_damping"), "N*s/m", "N*s/m", relative_std=0.3, why=_BY_HAND),
        "frictionloss": Attribute(*_field("tendon_frictionloss"), "N", "N", relative_std=0.3, why=_BY_HAND),
        "armature": Attribute(*_field("tendon_armature"), "kg", "kg", relative_std=0.3, why=_ROTOR),
        "springlength": Attribute(*_field("tendon_lengthspring"), "m", "m"),
    },
    "actuator": {
        "kp": Attribute(_read_kp, _write_kp, "N*m/rad", "N/m", relative_std=0.05, why=_GAIN),
        "kv": Attribute(_read_kv, _write_kv, "N*m*s/rad", "N*s/m", relative_std=0.3, why=_BY_HAND),
        "gain": Attribute(*_field("actuator_gainprm", lambda m, k: (k, 0)), "1", "1", positive=False),
        "bias": Attribute(*_field("actuator_biasprm", lambda m, k: (k, 0)), "N*m", "N", positive=False),
        "damping": Attribute(*_field("actuator_damping"), "N*m*s/rad", "N*s/m"),
        "armature": Attribute(*_field("actuator_armature"), "kg*m^2", "kg"),
        "forcerange": Attribute(*_field("actuator_forcerange"), "N*m", "N", positive=False),
        "timeconst": Attribute(*_field("actuator_dynprm", lambda m, k: (k, 0)), "s", "s"),
    },
    "site": {"pos": Attribute(*_field("site_pos"), "m", "m", positive=False)},
    "geom": {"pos": Attribute(*_field("geom_pos"), "m", "m", positive=False)},
}  # fmt: skip


def slides(model: mujoco.MjModel, kind: str, k: int) -> bool:
    """Return whether an element slides or pulls (units of force and length) and does not turn."""
    slide = int(mujoco.mjtJoint.mjJNT_SLIDE)
    if kind == "joint":
        return bool(model.jnt_type[k] == slide)
    if kind == "actuator":
        on_joint = model.actuator_trntype[k] in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
        return not on_joint or bool(model.jnt_type[model.actuator_trnid[k, 0]] == slide)
    return True


def si_unit(model: mujoco.MjModel, kind: str, k: int, attribute: Attribute) -> str:
    """Return the SI unit of an element's attribute."""
    return attribute.sliding_unit if slides(model, kind, k) else attribute.unit


def applies(model: mujoco.MjModel, kind: str, k: int, name: str) -> bool:
    """Return whether the element has this attribute.

    Joints of several axes have no angle, damping or spring here; a muscle has no kp, and only an affine bias has a kv.
    """
    if kind == "actuator" and name in ("kp", "kv"):
        fixed = model.actuator_gaintype[k] == int(mujoco.mjtGain.mjGAIN_FIXED)
        return bool(fixed and (name == "kp" or model.actuator_biastype[k] == int(mujoco.mjtBias.mjBIAS_AFFINE)))
    return kind != "joint" or name == "pos" or model.jnt_type[k] in SCALAR_JOINTS
