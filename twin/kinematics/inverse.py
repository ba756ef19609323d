"""The tensions that bring the tip to a wanted point, or why none do.

The tips that tendons reach lie on a surface: two numbers, how far and in which direction the robot bends. Of the many tensions
that bend it alike, `by_sector` (Peng et al. 2025, Algorithm 2) takes the one answer in which at most two neighbouring tendons pull,
those whose bending directions enclose the point; the general search starts there and lets all pull.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from twin.equilibrium import TOLERANCE
from twin.equilibrium.move import STRIDE, refine, seek
from twin.errors import SolveError, TwinError
from twin.kinematics.robot import LoadedRobot, Shape

NEAR = 1e-6  # m: where the search stops


@dataclass(frozen=True)
class Reach:
    """An answer: load-cell readings (n_tendon,) N to pull to, the shape they give, the tip's distance (m) from the wanted point,
    and, where that is more than asked for, the reason."""

    tension: np.ndarray
    shape: Shape
    distance: float
    reason: str | None


def inverse(
    robot: LoadedRobot, tip: np.ndarray, *, limit: float = 4.0, within: float = 1e-4, by_sector: bool = True,
    resting: np.ndarray | None = None,
) -> Reach:  # fmt: skip
    """The tensions, each from 0 to `limit` N, that move the robot's tip from where it stands to `tip` (3,) m in the base frame.

    `resting` (n_tendon,) N are load-cell readings below which no tendon can go, as a cold SMA spring's: those that need not pull
    keep them, and at most two pull more. Nothing by default: slack. The robot does not move: `pull` it to the answer. A tip that is
    not found `within` (m) comes back with the nearest there is and the reason. Raises TwinError for a point that is none.
    """
    tip = np.asarray(tip, float)
    if tip.shape != (3,) or not np.isfinite(tip).all():
        raise TwinError(f"a tip position is {tip.tolist()}; three finite numbers in metres are needed")
    least = np.zeros(robot.n_tendon) if resting is None else robot.true(np.asarray(resting, float)) * robot.softness
    nearest: tuple[float, np.ndarray] | None = None
    for used, guess in _starts(robot, tip, least, limit, by_sector):
        distance, tension = _sought(robot, tip, used, guess, least, limit)
        if nearest is None or distance < nearest[0]:
            nearest = distance, tension
        if distance < within:
            break
    if nearest is None or not math.isfinite(nearest[0]):
        raise SolveError("no equilibrium was found on the way to this point; rest the robot first")
    tension = nearest[1]
    shape = _peek(robot, tension)
    distance = float(np.linalg.norm(shape.tip - tip))
    reason = None if distance < within else _reason(robot, tip, tension / robot.softness, distance, limit)
    return Reach(robot.reported(tension / robot.softness), shape, distance, reason)


def sectors(robot: LoadedRobot) -> list[tuple[float, int, int]]:
    """Neighbouring tendons (direction of i in rad, i, j), counter-clockwise: their bending directions bound a sector."""
    angle = _directions(robot)
    order = np.argsort(angle)
    return [(float(angle[i]), int(i), int(order[(k + 1) % len(order)])) for k, i in enumerate(order)]


def _directions(robot: LoadedRobot) -> np.ndarray:
    """Where each tendon's hole lies at the base, rad from +x towards +y in [0, 2 pi): the robot bends towards it."""
    chain = robot.solver.chain
    holes = chain.site[chain.hole[:, 0]]
    return np.mod(np.arctan2(holes[:, 1], holes[:, 0]) + 1e-9, 2 * np.pi)


def _starts(
    robot: LoadedRobot, tip: np.ndarray, least: np.ndarray, limit: float, by_sector: bool
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Which tendons may pull, and a first guess of their tensions, the likeliest first.

    A bend of constant curvature k = theta / length with its tip at (rho, z) has theta = 2 atan2(rho, z); its moment is EI k, of
    which each tendon gives tension times lever arm towards its side. What resting tendons give is there already.
    """
    nt = robot.n_tendon
    chain = robot.solver.chain
    lever = float(np.linalg.norm(chain.site[chain.hole[0, 0], :2]))
    bends = chain.stiffness[(chain.hinge > 0.0) & ~chain.twists]  # two hinges a joint set, K = EI / h
    theta = 2.0 * math.atan2(math.hypot(tip[0], tip[1]), tip[2])
    want = theta / float((1.0 / bends[::2]).sum()) / lever  # EI theta / length: the sets are springs in a row
    towards = math.atan2(tip[1], tip[0])
    angle = _directions(robot)
    side = np.stack([np.cos(angle), np.sin(angle)])
    lacking = want * np.array([math.cos(towards), math.sin(towards)]) - side @ least / robot.softness
    towards = math.atan2(lacking[1], lacking[0])
    out = []
    ranked = sorted(sectors(robot), key=lambda s: -_enclosed(angle[s[1]], angle[s[2]], towards))
    for _, i, j in ranked:
        used = np.zeros(nt, bool)
        used[[i, j]] = True
        guess = least / robot.softness
        guess[[i, j]] += np.clip(np.linalg.lstsq(side[:, [i, j]], lacking, rcond=None)[0], 0.0, 0.9 * limit)
        out.append((used if by_sector else np.ones(nt, bool), np.minimum(guess, limit) * robot.softness))
    return out


def _enclosed(a: float, b: float, direction: float) -> float:
    """How far inside the sector from a counter-clockwise to b a direction lies, rad; negative outside."""
    span = (b - a) % (2 * math.pi)
    inside = (direction - a) % (2 * math.pi)
    return min(inside, span - inside) if inside <= span else -min(inside - span, 2 * math.pi - inside)


def _sought(
    robot: LoadedRobot, tip: np.ndarray, used: np.ndarray, guess: np.ndarray, least: np.ndarray, limit: float
) -> tuple[float, np.ndarray]:
    T0, q0, z0, s0 = robot.state()
    T, q, z, s = guess.copy(), q0.copy(), z0.copy(), s0.copy()
    distance = seek(
        *robot.statics, tip, used, least, limit * robot.softness, TOLERANCE, NEAR,
        T0, q0, z0, s0, T, q, z, s, np.empty_like(robot.LU),
    )  # fmt: skip
    if distance >= 0.0 and robot.law.mu > 0.0:
        distance = refine(
            *robot.statics, tip, used, least, limit * robot.softness, TOLERANCE,
            NEAR, STRIDE, T0, q0, z0, s0, T, q, z, s, np.empty_like(robot.LU),
        )  # fmt: skip
    return (float(distance) if distance >= 0.0 else math.inf), T


def _peek(robot: LoadedRobot, tension: np.ndarray) -> Shape:
    """The shape `tension` (softened, true) would give; the robot stays."""
    now = robot.state()
    try:
        return robot.pull(robot.reported(tension / robot.softness))
    finally:
        robot.restore(now)


def _reason(robot: LoadedRobot, tip: np.ndarray, tension: np.ndarray, distance: float, limit: float) -> str:
    length = float(robot.twin.robot.build(robot.twin.values).length)
    far = float(np.linalg.norm(tip))
    if far > length:
        return f"the point is {1e3 * far:.1f} mm from the base; the robot is {1e3 * length:.1f} mm long"
    full = [f"tendon {i + 1}" for i in np.flatnonzero(tension > 0.999 * limit)]
    if full:
        return f"{' and '.join(full)} would need more than the {limit:g} N allowed; {1e3 * distance:.2f} mm are left"
    return f"tips lie on a surface, which passes {1e3 * distance:.2f} mm from this point"
