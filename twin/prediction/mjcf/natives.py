"""Effects as MuJoCo's own attributes, and back: what of them an MJCF can say, exactly or as the nearest law that MuJoCo has.

    drive_zero        biasprm[0] + gain zero, ctrlrange - zero     exact
    time_delay        delay, straight between steps                exact between steps; a log that runs ahead cannot be written
    actuator_lag      dyntype filterexact                          its first order, of commands held from step to step
    joint_friction    frictionloss, stiff                          without pre-sliding and Stribeck's part; `viscous` is damping

Effects that edit the body or its loads are numbers of the compiled model already (`twin.mechanics.mjcf.written`).
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from twin.effects import Effect
from twin.mechanics.mjcf import SCALAR_JOINTS

LINEAR = 1  # interpolation of delayed commands
STIFF_FRICTION = ((0.004, 1.0), (0.999, 0.9999, 0.001, 0.5, 2.0))  # solref, solimp: what sticks creeps a thousandth as fast
_NO_DYNAMICS, _FILTER = mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTEREXACT
_SIMPLE_BIASES = (mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE)
CARRIED = frozenset(
    {
        "actuator_lag", "camera_misalignment", "drive_zero", "encoder_offset", "joint_friction", "load_dependent_friction",
        "tendon_friction", "time_delay",
    }
)  # fmt: skip
FILTERED = "filtered"  # the number (nu,) that says which actuators have a filter of the twin's


def takes_zero(spec: mujoco.MjSpec) -> bool:
    """Return whether each actuator's force is gain c + bias, so that a zero of its command is a bias."""
    return all(a.gaintype == mujoco.mjtGain.mjGAIN_FIXED and a.biastype in _SIMPLE_BIASES for a in spec.actuators)


def write_zero(spec: mujoco.MjSpec, effect: Effect) -> None:
    """Write a drive's zero: gain (c + zero) + bias, of a control limited to [low - zero, high - zero]."""
    for actuator, zero in zip(spec.actuators, effect.per_tendon_values("zero"), strict=True):
        bias = np.array(actuator.biasprm)
        bias[0] += actuator.gainprm[0] * zero
        actuator.biasprm, actuator.biastype = bias, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.ctrlrange = np.array(actuator.ctrlrange) - zero


def write_delay(spec: mujoco.MjSpec, delay: float) -> None:
    """Write a delay (s) of all actuators' commands."""
    for actuator in spec.actuators:
        actuator.delay += delay
        actuator.nsample = max(int(actuator.nsample), math.ceil(actuator.delay / spec.option.timestep) + 2)
        actuator.interp = LINEAR


def write_lag(spec: mujoco.MjSpec, lag: float) -> np.ndarray:
    """Write a lag (s) as a filter of all actuators without dynamics; return (nu,) which have it now."""
    filtered = np.array([a.dyntype == _NO_DYNAMICS for a in spec.actuators], float)
    for actuator, now in zip(spec.actuators, filtered, strict=True):
        if now:
            constants = np.zeros(len(actuator.dynprm))
            constants[0] = lag
            actuator.dyntype, actuator.dynprm = _FILTER, constants
    return filtered


def write_friction(spec: mujoco.MjSpec, torque: tuple[float, ...]) -> None:
    """Write a friction (n_joint,) N m or N of the joints with one axis."""
    for joint, more in zip(_scalar_joints(spec), torque, strict=True):
        if more > 0.0 and joint.frictionloss == 0.0:
            joint.solref_friction, joint.solimp_friction = STIFF_FRICTION
        joint.frictionloss += more


def without_natives(spec: mujoco.MjSpec, effects: tuple[Effect, ...], filtered: np.ndarray) -> None:
    """Take out of a written spec what stands there in place of laws that are stepped."""
    for effect in effects:
        if effect.id == "time_delay":
            for actuator in spec.actuators:
                actuator.delay -= effect["delay"]
                actuator.nsample = actuator.nsample if actuator.delay > 0.0 else 0
        if effect.id == "joint_friction":
            for joint, less in zip(_scalar_joints(spec), effect.per_joint_values("torque"), strict=True):
                joint.frictionloss -= less
                damping = np.array(joint.damping)
                damping[0] -= effect["viscous"] * less
                joint.damping = damping
    for actuator, made in zip(spec.actuators, filtered, strict=False):
        if made:
            actuator.dyntype = _NO_DYNAMICS


def _scalar_joints(spec: mujoco.MjSpec) -> list[mujoco.MjsJoint]:
    return [j for j in sorted(spec.joints, key=lambda j: j.id) if int(j.type) in SCALAR_JOINTS]
