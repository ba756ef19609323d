"""Joint friction as the nearest that MuJoCo has: a stiff `frictionloss`, without pre-sliding and Stribeck's part, and damping.

Other effects write themselves (`Effect.write`); those that edit the body or its loads are numbers of the compiled model already.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from twin.body import Rubbing
from twin.mechanics.mjcf import SCALAR_JOINTS

STIFF_FRICTION = ((0.004, 1.0), (0.999, 0.9999, 0.001, 0.5, 2.0))  # solref, solimp: what sticks creeps a thousandth as fast


def write_friction(spec: mujoco.MjSpec, rubbing: Rubbing) -> None:
    """Add friction of the joints with one axis to a compiled spec."""
    for joint, torque in _joints(spec, rubbing.torque):
        if torque > 0.0 and joint.frictionloss == 0.0:
            joint.solref_friction, joint.solimp_friction = STIFF_FRICTION
        joint.frictionloss += torque
    _add_damping(spec, rubbing.viscous, 1.0)


def erase_friction(spec: mujoco.MjSpec, rubbing: Rubbing) -> None:
    """Take it out again."""
    for joint, torque in _joints(spec, rubbing.torque):
        joint.frictionloss -= torque
    _add_damping(spec, rubbing.viscous, -1.0)


def _add_damping(spec: mujoco.MjSpec, viscous: Sequence[float], sign: float) -> None:
    for joint, more in _joints(spec, viscous):
        damping = np.array(joint.damping)
        damping[0] += sign * more
        joint.damping = damping


def _joints(spec: mujoco.MjSpec, values: Sequence[float]) -> list[tuple[mujoco.MjsJoint, float]]:
    joints = [j for j in sorted(spec.joints, key=lambda j: j.id) if int(j.type) in SCALAR_JOINTS]
    return list(zip(joints, values, strict=True)) if values else []
