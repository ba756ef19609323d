"""The tensions that bring the tip to a wanted point, or why none do.

The tips that tendons reach lie on a surface: two numbers, how far and in which direction the robot bends. Of the many tensions
that bend it alike, `by_sector` (Peng et al. 2025, Algorithm 2) takes the one answer in which at most two neighbouring tendons pull,
those whose bending directions enclose the point; the general search starts there and lets all pull.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from twin.body import TOLERANCE
from twin.equilibrium.chain import State
from twin.equilibrium.move import Aim, refine, seek
from twin.equilibrium.newton import no_factors
from twin.errors import SolveError, TwinError
from twin.kinematics.robot import LoadedRobot, Shape

NEAR = 1e-5  # m: where the search stops


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
    distance, state = math.inf, None
    for used, guess in _starts(robot, tip, least, limit, by_sector):
        away, found = _sought(robot, tip, used, guess, least, limit)
        if away < distance:
            distance, state = away, found
        if distance < within:
            break
    if state is None:
        raise SolveError("no equilibrium was found on the way to this point; rest the robot first")
    tension = state.T / robot.softness
    reason = None if distance < within else _reason(robot, tip, tension, distance, limit)
    return Reach(robot.reported(tension), _shape_at(robot, state), distance, reason)


def sectors(robot: LoadedRobot) -> list[tuple[float, int, int]]:
    """Neighbouring tendons (direction of i in rad, i, j), counter-clockwise: their bending directions bound a sector."""
    angle = robot.directions
    order = np.argsort(angle)
    return [(float(angle[i]), int(i), int(order[(k + 1) % len(order)])) for k, i in enumerate(order)]


def _starts(
    robot: LoadedRobot, tip: np.ndarray, least: np.ndarray, limit: float, by_sector: bool
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Which tendons may pull, and a first guess of their tensions, the likeliest first.

    A bend of constant curvature k = theta / length with its tip at (rho, z) has theta = 2 atan2(rho, z); its moment is EI k, of
    which each tendon gives tension times lever arm towards its side. What resting tendons give is there already.
    """
    theta = 2.0 * math.atan2(math.hypot(tip[0], tip[1]), tip[2])
    want = theta * robot.pull_per_bend
    towards = math.atan2(tip[1], tip[0])
    angle = robot.directions
    side = np.stack([np.cos(angle), np.sin(angle)])
    lacking = want * np.array([math.cos(towards), math.sin(towards)]) - side @ least / robot.softness
    towards = math.atan2(lacking[1], lacking[0])
    for _, i, j in sorted(sectors(robot), key=lambda s: -_enclosed(angle[s[1]], angle[s[2]], towards)):
        used = np.full(robot.n_tendon, not by_sector)
        used[[i, j]] = True
        guess = least / robot.softness
        guess[[i, j]] += np.clip(np.linalg.lstsq(side[:, [i, j]], lacking, rcond=None)[0], 0.0, 0.9 * limit)
        yield used, np.minimum(guess, limit) * robot.softness


def _enclosed(a: float, b: float, direction: float) -> float:
    """How far inside the sector from a counter-clockwise to b a direction lies, rad; negative outside."""
    span = (b - a) % (2 * math.pi)
    inside = (direction - a) % (2 * math.pi)
    return min(inside, span - inside) if inside <= span else -min(inside - span, 2 * math.pi - inside)


def _sought(
    robot: LoadedRobot, tip: np.ndarray, used: np.ndarray, guess: np.ndarray, least: np.ndarray, limit: float
) -> tuple[float, State]:
    """The least distance (m) found, infinite where lost, and the state (T, q, z, s) that the robot is in there."""
    start, found = robot.state(), robot.state()._replace(T=guess.copy())
    aim, factors = Aim(tip, used, least, float(limit * robot.softness), NEAR), no_factors(found.q.size, guess.size)
    distance = seek(robot.statics, aim, start, found, factors, TOLERANCE)
    if distance >= 0.0:
        distance = refine(robot.statics, aim, start, found, factors, TOLERANCE)
    return (float(distance) if distance >= 0.0 else math.inf), found


def _shape_at(robot: LoadedRobot, state: State) -> Shape:
    """The shape the robot has in `state`; it stays as it stands."""
    now = robot.state()
    robot.restore(state)
    shape = robot.shape()
    robot.restore(now)
    return shape


def _reason(robot: LoadedRobot, tip: np.ndarray, tension: np.ndarray, distance: float, limit: float) -> str:
    length, far = robot.length, float(np.linalg.norm(tip))
    if far > length:
        return f"the point is {1e3 * far:.1f} mm from the base; the robot is {1e3 * length:.1f} mm long"
    full = [f"tendon {i + 1}" for i in np.flatnonzero(tension > 0.999 * limit)]
    if full:
        return f"{' and '.join(full)} would need more than the {limit:g} N allowed; {1e3 * distance:.2f} mm are left"
    if np.ptp(robot.solver.chain.pieces) > 0:
        return f"no tensions were found that bring the tip nearer than {1e3 * distance:.2f} mm"
    return f"tips lie on a surface, which passes {1e3 * distance:.2f} mm from this point"
