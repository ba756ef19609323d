"""Bumpers: a joint's stop of a given stiffness and damping, as MuJoCo's own constraint.

MuJoCo pushes a joint that is r into its stop with f = (a* - a) / (A + R), a its acceleration without the stop and A its inverse
inertia. A spring K and a damper D in steps h of second order, stable for any K,

    f = -K (r + h^2 / 4 a') - D (v + h / 2 a'),    a' = a + A f,

is the same with 1 / R = g = K h^2 / 4 + D h / 2 and a* = -(K r + D v) / g. R is set by `solimp` and the model's own inverse inertia
A0 as (1 - d) / d A0, a* by `solref` (-S, -B) as -(S r + B v) / d.

Source: MuJoCo's documentation, "Solver parameters"; Newmark's mean acceleration.
"""

from __future__ import annotations

import mujoco
import numpy as np

from twin.body import Bumpers
from twin.mechanics.mjcf.body import ModelBody

IMPEDANCES = (1e-4, 0.9999)  # that MuJoCo takes


def soften_stops(model: mujoco.MjModel, body: ModelBody, bumpers: Bumpers, h: float) -> None:
    """Set the stops of a model that is stepped by h s: those of `bumpers`, and the body's own at other joints."""
    model.jnt_solref[:], model.jnt_solimp[:] = body.model.jnt_solref, body.model.jnt_solimp
    if bumpers.give == 0.0:
        return
    K = 1.0 / bumpers.give
    D = bumpers.loss * K
    g = 0.25 * K * h * h + 0.5 * D * h
    for joint in np.array(body.joints)[np.array(bumpers.joints)]:
        inverse_inertia = float(model.dof_invweight0[model.jnt_dofadr[joint]])
        d = float(np.clip(inverse_inertia * g / (1.0 + inverse_inertia * g), *IMPEDANCES))
        model.jnt_solref[joint] = -d * K / g, -d * D / g
        model.jnt_solimp[joint, :2] = d
