"""Where a trial begins, and masses that hang on a model during one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import mujoco
import numpy as np

from twin.foundation.errors import DataError, did_you_mean
from twin.mechanics.mjcf.loading import SCALAR_JOINTS, LoadedModel

_FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
_ON_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))


def set_start(model: mujoco.MjModel, data: mujoco.MjData, command: np.ndarray, pose: str) -> None:
    """Set a data to where a trial is let go: the named keyframe, else the model's first, else where springs and servos rest.

    Without keyframes a joint starts at its spring's rest, or, without a spring, where the servo on it is told to be by the first
    `command` (nu,). Filters of actuators and delayed commands hold that command. Raises DataError for a keyframe that is not there.
    """
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_KEY, k) or f"key_{k + 1}" for k in range(model.nkey)]
    if pose and pose not in names:
        there = ", ".join(names) or "none"
        raise DataError(f"start_pose {pose!r}: the model has no such keyframe; it has {there}{did_you_mean(pose, names)}")
    if names:
        mujoco.mj_resetDataKeyframe(model, data, names.index(pose) if pose else 0)
    else:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = _rest(model, command)
    data.ctrl[:] = command
    for k in range(model.nu):
        if model.actuator_dyntype[k] in _FILTERS and model.actuator_actnum[k] == 1:
            data.act[model.actuator_actadr[k]] = command[k]
        if model.actuator_delay[k] > 0.0:
            mujoco.mj_initCtrlHistory(model, data, k, None, np.full(int(model.actuator_history[k, 0]), command[k]))
    mujoco.mj_forward(model, data)


def _rest(model: mujoco.MjModel, command: np.ndarray) -> np.ndarray:
    """Return where springs, and servos without any, rest (nq,)."""
    qpos = model.qpos0.copy()
    for k in range(model.nu):
        joint = int(model.actuator_trnid[k, 0])
        if model.actuator_trntype[k] in _ON_JOINT and model.jnt_type[joint] in SCALAR_JOINTS:
            gain, bias, gear = model.actuator_gainprm[k, 0], model.actuator_biasprm[k], model.actuator_gear[k, 0]
            if bias[1] < 0.0 and gear != 0.0:
                qpos[model.jnt_qposadr[joint]] = (gain * command[k] + bias[0]) / (-bias[1] * gear)
    for joint in range(model.njnt):
        if model.jnt_stiffness[joint] > 0.0 and model.jnt_type[joint] in SCALAR_JOINTS:
            qpos[model.jnt_qposadr[joint]] = model.qpos_spring[model.jnt_qposadr[joint]]
    return qpos


def contacts_at_start(loaded: LoadedModel) -> int:
    """Return how many contacts a model has where its trials are let go under controls of zero."""
    data = mujoco.MjData(loaded.model)
    set_start(loaded.model, data, np.zeros(loaded.model.nu), "")
    return int(data.ncon)


def touching_bodies(loaded: LoadedModel, q: np.ndarray) -> dict[tuple[str, str], int]:
    """Return which bodies touch in poses q (n, nq), each pair in the model's order with the first row in which it does."""
    model, names = loaded.model, loaded.names("body")
    data, found = mujoco.MjData(model), dict[tuple[str, str], int]()
    for row, pose in enumerate(q):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        for contact in data.contact:
            a, b = sorted(model.geom_bodyid[contact.geom])
            found.setdefault((names[a], names[b]), row)
    return found


def add_masses(model: mujoco.MjModel, masses: Iterable[tuple[str, float]], places: Mapping[str, tuple[int, np.ndarray]]) -> None:
    """Hang point masses (kg) at sites or bodies, whose `places` are (body, place in its frame); inertias by the parallel axes.

    Raises DataError for a name that is neither.
    """
    for name, mass in masses:
        if name not in places:
            raise DataError(
                f"payload at {name!r}: the model has no such site or body; it has {', '.join(places)}{did_you_mean(name, places)}"
            )
        if mass:
            body, point = places[name]
            _add_mass(model, body, point, mass)


def _add_mass(model: mujoco.MjModel, body: int, point: np.ndarray, mass: float) -> None:
    own, centre = float(model.body_mass[body]), model.body_ipos[body].copy()
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.body_iquat[body])
    R = R.reshape(3, 3)
    total = own + mass
    new = (own * centre + mass * point) / total
    inertia = R @ np.diag(model.body_inertia[body]) @ R.T
    for m, at in ((own, centre), (mass, point)):
        away = at - new
        inertia = inertia + m * (away @ away * np.eye(3) - np.outer(away, away))
    principal, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(axes).ravel())
    model.body_mass[body], model.body_ipos[body] = total, new
    model.body_inertia[body], model.body_iquat[body] = principal, quat
