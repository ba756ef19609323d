"""Tip a hinged cup over, so that its balls come to lie in a tray."""

from typing import ClassVar

import numpy as np

from twin.mechanics.silicone.motion.scene import Part, Thing
from twin.tasks.task import ObjectTrack, Outcome, Task, build_table, table_block

TRAY_FLOOR, CUP_FLOOR = 0.143, 0.124  # m below the palm: the tray's floor and the cup's
# m: half the cup's inner width; half its walls' thickness; half its walls' height
CUP_INNER_HALF_WIDTH, CUP_HALF_WALL, CUP_HALF_HEIGHT = 0.010, 2e-3, 0.016
CUP_HALF_BASE = 2e-3  # m, half the base's thickness
BALL_RADIUS = 4.5e-3  # m
CUP_HINGE = (-3e-3, 0.0, -4e-3)  # m from the middle of its floor: the cup leans on its rest, and falls past some 20 degrees
TRAY_HALF_SIZE, TRAY_HALF_RIM = (0.053, 0.045, 6e-3), 2e-3  # m, half its length, width and height; half its rim's thickness
TRAY_DISTANCE = 0.027  # m from the hinge to the tray's middle


class Pour(Task):
    """A hinged cup with four balls, beside a tray."""

    description = "tip a hinged cup over so that its four balls come to lie in a tray"
    success_criterion = "in the end all four balls lie in the tray, outside of the cup"
    duration: ClassVar[float] = 2.4
    push_strength: ClassVar[float | tuple[float, ...]] = (0.6, 0.0, 0.0)

    def draw_things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        x, out = rng.uniform(0.018, 0.021), CUP_INNER_HALF_WIDTH + CUP_HALF_WALL
        up, wide = -CUP_HALF_BASE - CUP_HALF_HEIGHT, out + CUP_HALF_WALL
        mass = rng.uniform(3e-3, 5e-3)  # of a wall
        walls = tuple(
            Part(
                "box",
                (CUP_HALF_WALL, wide, CUP_HALF_HEIGHT) if dx else (CUP_INNER_HALF_WIDTH, CUP_HALF_WALL, CUP_HALF_HEIGHT),
                (dx * out, dy * out, up),
                mass=mass,
                friction=0.5,
            )
            for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1))
        )
        cup = Thing(
            "object", "box", (wide, wide, CUP_HALF_BASE), mass, (x, 0.0, CUP_FLOOR - CUP_HALF_BASE), friction=0.5,
            hinge=(CUP_HINGE, (0.0, 1.0, 0.0)), parts=walls,
        )  # fmt: skip
        at = rng.uniform(-4e-4, 4e-4, (4, 2)) + [(dx, dy) for dx in (-5e-3, 5e-3) for dy in (-5e-3, 5e-3)]
        balls = (
            Thing(
                f"ball {k + 1}",
                "sphere",
                (BALL_RADIUS,),
                2e-3,
                (x + float(px), float(py), CUP_FLOOR - 2 * CUP_HALF_BASE - BALL_RADIUS),
                friction=0.5,
            )
            for k, (px, py) in enumerate(at)
        )
        return cup, *balls, build_table(TRAY_FLOOR, *tray_parts(x))

    def judge(self, track: ObjectTrack) -> Outcome:
        balls, middle = track.other_places[-1], track.place[0] + [CUP_HINGE[0] - TRAY_DISTANCE, 0.0, 0.0]
        if _balls_in_cup(balls, track).any():
            return Outcome.NOT_REACHED
        in_tray = (np.abs(balls - middle)[:, :2] < TRAY_HALF_SIZE[:2]).all(axis=1) & (balls[:, 2] < TRAY_FLOOR)
        return Outcome.SUCCESS if in_tray.all() else Outcome.DROPPED


def tray_parts(x: float) -> tuple[Part, ...]:
    """Return the rest that the cup at x (m) leans on, and the rim of the tray."""
    rest, middle, (long, wide, tall) = 0.5 * (TRAY_FLOOR - CUP_FLOOR), x + CUP_HINGE[0] - TRAY_DISTANCE, TRAY_HALF_SIZE
    return (
        table_block((2e-3, 0.012, rest), x + 12e-3, 0.0),
        *(table_block((TRAY_HALF_RIM, wide, tall), middle + s * (long + TRAY_HALF_RIM), 0.0) for s in (-1.0, 1.0)),
        *(table_block((long, TRAY_HALF_RIM, tall), middle, s * (wide + TRAY_HALF_RIM)) for s in (-1.0, 1.0)),
    )


def _balls_in_cup(balls: np.ndarray, track: ObjectTrack) -> np.ndarray:
    """Return whether balls (n, 3) m are in the cup at the end, (n,)."""
    w, x, y, z = track.turn[-1]
    up = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])  # its own z axis, towards its floor
    away = balls - track.place[-1]
    height = -(away @ up)
    across = np.linalg.norm(away + height[:, None] * up, axis=1)
    return (height > 0.0) & (height < CUP_HALF_BASE + 2.0 * CUP_HALF_HEIGHT) & (across < 1.5 * CUP_INNER_HALF_WIDTH)
