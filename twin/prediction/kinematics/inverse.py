"""The tensions that bring the tip to a wanted point, or the reason why none do.

The reachable tips lie on a surface: two numbers, how far and in which direction the robot bends. Many tensions give the same bend.
`by_sector` (Peng et al. 2025, Algorithm 2) takes the solution in which at most two neighbouring tendons pull, whose bending
directions enclose the point. The general search starts there and lets all pull.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from twin.body import SOLVE_TOLERANCE
from twin.foundation.errors import SolveError, TwinError
from twin.mechanics.rod.balance.chain import ChainState
from twin.mechanics.rod.balance.newton import empty_factors
from twin.mechanics.rod.continuation import TipTarget, refine_tensions, seek_tensions
from twin.prediction.kinematics.loaded_robot import LoadedRobot, Shape

SEARCH_TOLERANCE = 1e-5  # m, distance at which the search stops


@dataclass(frozen=True)
class InverseSolution:
    """Load-cell readings (n_tendon,) N to pull to, the resulting shape, the tip's distance (m) from the wanted point.

    `reason` explains a distance larger than allowed, else it is None.
    """

    tension: np.ndarray
    shape: Shape
    distance: float
    reason: str | None


def inverse(
    robot: LoadedRobot, tip: np.ndarray, *, limit: float = 4.0, within: float = 1e-4, by_sector: bool = True,
    resting: np.ndarray | None = None,
) -> InverseSolution:  # fmt: skip
    """Return the tensions that move the robot's tip from its present state to `tip` (3,) m in the base frame.

    Each is from 0 to `limit` N. `resting` (n_tendon,) N are load-cell readings below which no tendon can go, as a cold SMA spring's
    (slack by default): tendons that need not pull keep them, and at most two pull more. The robot does not move: `pull` it to the
    result. A tip that is not reached `within` (m) comes back with the nearest solution and the reason. Raises TwinError for a point
    that is not three finite numbers.
    """
    tip = np.asarray(tip, float)
    if tip.shape != (3,) or not np.isfinite(tip).all():
        raise TwinError(f"a tip position is {tip.tolist()}; three finite numbers in metres are needed")
    least = np.zeros(robot.n_tendon) if resting is None else robot.true_tension(np.asarray(resting, float)) * robot.softness
    distance, state = math.inf, None
    for used, guess in _starts(robot, tip, least, limit, by_sector):
        away, found = _search(robot, tip, used, guess, least, limit)
        if away < distance:
            distance, state = away, found
        if distance < within:
            break
    if state is None:
        raise SolveError("no equilibrium was found on the way to this point; rest the robot first")
    tension = state.T / robot.softness
    reason = None if distance < within else _describe_shortfall(robot, tip, tension, distance, limit)
    return InverseSolution(robot.reported_tension(tension), _shape_at(robot, state), distance, reason)


def sectors(robot: LoadedRobot) -> list[tuple[float, int, int]]:
    """Return neighbouring tendons (direction of i in rad, i, j), counter-clockwise; their bending directions bound a sector."""
    angle = robot.directions
    order = np.argsort(angle)
    return [(float(angle[i]), int(i), int(order[(k + 1) % len(order)])) for k, i in enumerate(order)]


def _starts(
    robot: LoadedRobot, tip: np.ndarray, least: np.ndarray, limit: float, by_sector: bool
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield which tendons may pull, and a first guess of their tensions, the likeliest first.

    A bend of constant curvature k = theta / length with its tip at (rho, z) has theta = 2 atan2(rho, z). Its moment is EI k, of
    which each tendon gives tension times lever arm towards its side. The moment of resting tendons is subtracted.
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
    """Return how far (rad) inside the sector from a counter-clockwise to b a direction lies; negative outside."""
    span = (b - a) % (2 * math.pi)
    inside = (direction - a) % (2 * math.pi)
    return min(inside, span - inside) if inside <= span else -min(inside - span, 2 * math.pi - inside)


def _search(
    robot: LoadedRobot, tip: np.ndarray, used: np.ndarray, guess: np.ndarray, least: np.ndarray, limit: float
) -> tuple[float, ChainState]:
    """Return the least distance (m) found, infinite where lost, and the robot's state (T, q, z, s) there."""
    start, found = robot.state(), robot.state()._replace(T=guess.copy())
    aim, factors = (
        TipTarget(tip, used, least, float(limit * robot.softness), SEARCH_TOLERANCE),
        empty_factors(found.q.size, guess.size),
    )
    distance = seek_tensions(robot.statics, aim, start, found, factors, SOLVE_TOLERANCE)
    if distance >= 0.0:
        distance = refine_tensions(robot.statics, aim, start, found, factors, SOLVE_TOLERANCE)
    return (float(distance) if distance >= 0.0 else math.inf), found


def _shape_at(robot: LoadedRobot, state: ChainState) -> Shape:
    """Return the robot's shape in `state`, without moving it."""
    now = robot.state()
    robot.restore(state)
    shape = robot.shape()
    robot.restore(now)
    return shape


def _describe_shortfall(robot: LoadedRobot, tip: np.ndarray, tension: np.ndarray, distance: float, limit: float) -> str:
    length, far = robot.length, float(np.linalg.norm(tip))
    if far > length:
        return f"the point is {1e3 * far:.1f} mm from the base; the robot is {1e3 * length:.1f} mm long"
    full = [f"tendon {i + 1}" for i in np.flatnonzero(tension > 0.999 * limit)]
    if full:
        return f"{' and '.join(full)} would need more than the {limit:g} N allowed; {1e3 * distance:.2f} mm are left"
    if np.ptp(robot.solver.chain.n_piece) > 0:
        return f"no tensions were found that bring the tip nearer than {1e3 * distance:.2f} mm"
    return f"tips lie on a surface, which passes {1e3 * distance:.2f} mm from this point"
