"""The reference model of Peng et al. 2025 (Soft Science 5, 38): a rod under a tip wrench, its weight spread along it.

Kirchhoff rod, base clamped, s from 0 to l:

    p' = R e_z,   R' = R u^,   m' = -p' x n,   n(s) = (l - s) rho A g + payload g + F
    m = R K u,  K = diag(EI, EI, GJ),   m(l) = R(l) L_0 sum_i F_i (-sin phi_i, cos phi_i, 0)        (their Eqs 1-7)

Tendons act at the tip alone, on a lever arm L_0, without friction; all mass counts as the backbone's (their equivalent density). It
is kept for comparison: published errors are against it. Solved as there, by shooting for m(0).
"""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from twin.body import Loads
from twin.foundation.errors import DataError, SolveError
from twin.foundation.parameters import Values, parameter_array
from twin.robots import Robot
from twin.robots.schemas.continuum import ROUND_SECTION, Continuum, disk_masses, hole_places

TOLERANCE = 1e-8  # of the integration, m and rad


def tip_wrench(robot: Robot, tension: np.ndarray, loads: Loads, values: Values | None = None) -> np.ndarray:
    """Backbone positions (n_disk, 3) m at the disks under base tensions (n_tendon,) N.

    Raises DataError for a robot that is no round wire with straight tendons to its tip, SolveError where shooting finds no
    moment at the base.
    """
    v = {p.name: p.value for p in robot.parameters} | dict(values or {})
    shape = Continuum.model_validate(dict(robot.structure))
    places = hole_places(shape, v)
    if not shape.kinds() >= ROUND_SECTION or min(shape.ends()) < shape.disks or any(np.ptp(x, axis=1).any() for x in places):
        raise DataError(f"the tip-wrench rod is a round wire with straight tendons to its tip; robot {robot.name!r} is another")
    s = np.cumsum(parameter_array(v, "disks.pitch", shape.disks))
    length = float(s[-1])
    bending = v["backbone.youngs_modulus"] * math.pi * v["backbone.radius"] ** 4 / 4.0
    stiffness = np.array([bending, bending, bending / (1.0 + v["backbone.poisson_ratio"])])
    pull, angle = np.asarray(tension, float) * places[0][:, 0], places[1][:, 0]
    moment = np.array([-(pull * np.sin(angle)).sum(), (pull * np.cos(angle)).sum(), 0.0])
    at_tip = loads.payload * loads.gravity + loads.force
    weight = (v["backbone.mass"] + disk_masses(v, shape.disks).sum()) * loads.gravity

    def slope(x: float, y: np.ndarray) -> np.ndarray:
        R, m = y[3:12].reshape(3, 3), y[12:]
        u = R.T @ m / stiffness
        n = (1.0 - x / length) * weight + at_tip
        skew = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
        return np.concatenate([R[:, 2], (R @ skew).ravel(), -np.cross(R[:, 2], n)])

    def shot(m0: np.ndarray, at: np.ndarray) -> np.ndarray:
        y0 = np.concatenate([np.zeros(3), np.eye(3).ravel(), m0])
        return solve_ivp(slope, (0.0, length), y0, "RK45", at, rtol=TOLERANCE, atol=TOLERANCE).y

    def miss(m0: np.ndarray) -> np.ndarray:
        end = shot(m0, np.array([length]))[:, -1]
        return (end[12:] - end[3:12].reshape(3, 3) @ moment) / bending

    found = root(miss, moment)
    if not found.success or np.abs(found.fun).max() > 1e-6:
        raise SolveError(f"the tip-wrench rod has no shape for tensions {np.round(tension, 3).tolist()} N: {found.message}")
    return shot(found.x, s)[:3].T
