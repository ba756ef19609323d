"""Tip a hinged cup over, so that its balls come to lie in a tray."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from twin.soft.scene import Part, Thing
from twin.tasks.task import Outcome, Task, Track, block, table

FLOOR, FOOT = 0.143, 0.124  # m below the palm: the tray's floor, and the cup's own
INNER, WALL, TALL = 0.010, 2e-3, 0.016  # m: half the cup's width within; half its walls' thickness; half its walls' height
BASE = 2e-3  # m, half
BALL = 4.5e-3  # m, radius
HINGE = (-3e-3, 0.0, -4e-3)  # m of the middle of its floor: the cup leans on its rest, and past some 20 degrees it falls
TRAY, RIM = (0.053, 0.045, 6e-3), 2e-3  # m, half its length, width and height; half its rim's thickness
AHEAD = 0.027  # m from the hinge to the tray's middle


class Pour(Task):
    about = "tip a hinged cup over so that its four balls come to lie in a tray"
    success = "in the end all four balls lie in the tray, outside of the cup"
    seconds: ClassVar[float] = 2.4
    strength: ClassVar[float | tuple[float, ...]] = (0.6, 0.0, 0.0)

    def things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        x, out = rng.uniform(0.018, 0.021), INNER + WALL
        up, wide = -BASE - TALL, out + WALL
        mass = rng.uniform(3e-3, 5e-3)  # of a wall
        walls = tuple(
            Part("box", (WALL, wide, TALL) if dx else (INNER, WALL, TALL), (dx * out, dy * out, up), mass=mass, friction=0.5)
            for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1))
        )
        cup = Thing(
            "object", "box", (wide, wide, BASE), mass, (x, 0.0, FOOT - BASE), friction=0.5, hinge=(HINGE, (0.0, 1.0, 0.0)),
            parts=walls,
        )  # fmt: skip
        at = rng.uniform(-4e-4, 4e-4, (4, 2)) + [(dx, dy) for dx in (-5e-3, 5e-3) for dy in (-5e-3, 5e-3)]
        balls = (
            Thing(f"ball {k + 1}", "sphere", (BALL,), 2e-3, (x + float(px), float(py), FOOT - 2 * BASE - BALL), friction=0.5)
            for k, (px, py) in enumerate(at)
        )
        return cup, *balls, table(FLOOR, *tray(x))

    def judge(self, track: Track) -> Outcome:
        balls, middle = track.others[-1], track.place[0] + [HINGE[0] - AHEAD, 0.0, 0.0]
        if _held(balls, track).any():
            return Outcome.NOT_REACHED
        there = (np.abs(balls - middle)[:, :2] < TRAY[:2]).all(axis=1) & (balls[:, 2] < FLOOR)
        return Outcome.SUCCESS if there.all() else Outcome.DROPPED


def tray(x: float) -> tuple[Part, ...]:
    """What the cup at x (m) leans on, and the rim around where its balls shall lie."""
    rest, middle, (long, wide, tall) = 0.5 * (FLOOR - FOOT), x + HINGE[0] - AHEAD, TRAY
    return (
        block((2e-3, 0.012, rest), x + 12e-3, 0.0),
        *(block((RIM, wide, tall), middle + s * (long + RIM), 0.0) for s in (-1.0, 1.0)),
        *(block((long, RIM, tall), middle, s * (wide + RIM)) for s in (-1.0, 1.0)),
    )


def _held(balls: np.ndarray, track: Track) -> np.ndarray:
    """(n,) whether balls (n, 3) m are within the cup in the end."""
    w, x, y, z = track.turn[-1]
    up = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])  # its own z axis, towards its floor
    away = balls - track.place[-1]
    height = -(away @ up)
    across = np.linalg.norm(away + height[:, None] * up, axis=1)
    return (height > 0.0) & (height < BASE + 2.0 * TALL) & (across < 1.5 * INNER)
