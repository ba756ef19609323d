"""What an operator lets the robot do, before it is known whether tensions or displacements drive it.

A motion is a bend b(t) in the unit disk, its direction the way the robot is to bend, and a pull c(t) that all tendons share.
Sets hold nine kinds at least once, so that slow and quick, loading and unloading, all directions and a long hold are there.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tools.simulators.second_rod.robot import TENDON_ANGLES

Array = np.ndarray
TOWARDS = np.column_stack([np.cos(TENDON_ANGLES), np.sin(TENDON_ANGLES)])  # (TENDONS, 2)
QUICKEST_MOVE = 0.45  # s: nominal.md's fastest step


def no_pull(times: Array) -> Array:
    return np.zeros(times.size)


@dataclass(frozen=True)
class Motion:
    """`bend`: times (n,) s -> (n, 2); `pull`: times -> (n,); logged in so many rows over `duration` s."""

    duration: float
    rows: int
    bend: Callable[[Array], Array]
    pull: Callable[[Array], Array] = no_pull


def unit(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])


def anywhere(random: np.random.Generator, least: float, most: float) -> Array:
    """A bend (2,) of a size between two bounds, in any direction."""
    return unit(random.uniform(0, 2 * np.pi)) * random.uniform(least, most)


def rows(random: np.random.Generator) -> int:
    return int(random.integers(80, 180))


def eased(x: Array) -> Array:
    """From 0 to 1 with speed and acceleration zero at both ends: x^3 (10 - 15 x + 6 x^2)."""
    x = np.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


def through(points: Array, leaves: Array, move: float) -> Callable[[Array], Array]:
    """Rests at points (k, 2); moves off towards points[i] at leaves[i], i > 0, for `move` s."""

    def bend(times: Array) -> Array:
        out = np.tile(points[0].astype(float), (times.size, 1))
        for before, after, leave in zip(points[:-1], points[1:], leaves[1:], strict=True):
            out += eased((times - leave) / move)[:, None] * (after - before)
        return out

    return bend


def swung(times: Array, period: float) -> Array:
    """From 0 to 1 and back once a period."""
    return 0.5 * (1 - np.cos(2 * np.pi * times / period))


def single(random: np.random.Generator) -> Motion:
    """One tendon pulled and let go, each time further."""
    direction, period = TOWARDS[random.integers(len(TOWARDS))], random.choice([8.0, 20.0, 40.0, 60.0])
    times_over = 3 if period < 10 else 2 if period < 50 else 1
    tops = np.sort(random.uniform(0.6, 1, times_over)) * random.uniform(0.7, 1)

    def bend(times: Array) -> Array:
        turn = np.minimum((times / period).astype(int), times_over - 1)
        return np.outer(tops[turn] * swung(times, period), direction)

    return Motion(period * times_over, rows(random), bend)


def loops(random: np.random.Generator) -> Motion:
    """One tendon with partial reversals, loops within loops."""
    direction, move = TOWARDS[random.integers(len(TOWARDS))], random.choice([4.0, 7.0, 11.0])
    levels = np.array([0, 0.9, 0.45, 0.75, 0.3, 1.0, 0.1, 0.6, 0.0]) * random.uniform(0.8, 1)
    bend = through(np.outer(levels, direction), (np.arange(levels.size) - 1) * move, 0.98 * move)
    return Motion(move * (levels.size - 1), rows(random), bend)


def between(random: np.random.Generator) -> Motion:
    """Up and down in any direction, mostly between two tendons."""
    period, top = random.choice([15.0, 30.0, 50.0]), anywhere(random, 0.7, 1)
    return Motion(period * (2 if period < 40 else 1), rows(random), lambda times: np.outer(swung(times, period), top))


def line(random: np.random.Generator) -> Motion:
    """Through the straight pose to both sides."""
    period, top = random.choice([12.0, 25.0, 45.0]), anywhere(random, 0.6, 0.9)
    return Motion(2 * period, rows(random), lambda times: np.outer(np.sin(2 * np.pi * times / period), top))


def turning(size: Array, turns: Array) -> Array:
    """(n, 2) bends of sizes (n,) at turns (n,) of a circle."""
    return size[:, None] * np.column_stack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)])


def circle(random: np.random.Generator) -> Motion:
    period, radius = random.choice([10.0, 20.0, 40.0, 60.0]), random.uniform(0.45, 0.95)
    sense, first = random.choice([-1, 1]), random.uniform()
    return Motion(
        period * (2 if period < 50 else 1),
        rows(random),
        lambda times: turning(np.full(times.size, radius), first + sense * times / period),
    )


def spiral(random: np.random.Generator) -> Motion:
    period, radius, sense = random.choice([12.0, 20.0]), random.uniform(0.8, 0.98), random.choice([-1, 1])
    duration = 4 * period
    return Motion(duration, rows(random), lambda times: turning(radius * times / duration, sense * times / period))


def wandering(random: np.random.Generator, durations: list[float], slowest: float, fastest: float) -> Motion:
    """Four sines in each coordinate, frequencies in Hz; in some, all tendons pull together now and then."""
    duration, frequencies = random.choice(durations), random.uniform(slowest, fastest, (2, 4))
    sizes, phases = random.uniform(0.3, 1, (2, 4)), random.uniform(0, 2 * np.pi, (2, 4))

    def sines(times: Array) -> Array:
        return np.sum(sizes * np.sin(2 * np.pi * times[:, None, None] * frequencies + phases), axis=2)

    largest = np.max(np.linalg.norm(sines(np.linspace(0, duration, 500)), axis=1))
    share, pulls, size = random.uniform(0.8, 0.97), random.random() < 0.4, random.uniform(0.02, 0.1)

    def pull(times: Array) -> Array:
        return size * (1 + np.sin(4 * np.pi * times / duration))

    return Motion(duration, rows(random), lambda times: sines(times) * share / largest, pull if pulls else no_pull)


def sines(random: np.random.Generator) -> Motion:
    return wandering(random, [50.0, 80.0, 120.0], 0.015, 0.09)


def quick(random: np.random.Generator) -> Motion:
    return wandering(random, [14.0, 18.0, 22.0], 0.08, 0.3)


def steps(random: np.random.Generator) -> Motion:
    """Quick steps with short rests; half of them begin straight."""
    number, rest = int(random.integers(7, 12)), random.uniform(1.6, 3.5)
    points = np.array([anywhere(random, 0.2, 0.95) for _ in range(number)])
    points[0] *= random.random() < 0.5
    return Motion(number * rest, rows(random), through(points, np.arange(number) * rest, QUICKEST_MOVE))


def poses(random: np.random.Generator) -> Motion:
    """Slow steps with long rests."""
    number, rest = int(random.integers(8, 14)), random.uniform(5, 9)
    points = np.array([anywhere(random, 0.1, 0.95) for _ in range(number)])
    return Motion(number * rest, rows(random), through(points, np.arange(number) * rest, 2.6))


def hold(random: np.random.Generator) -> Motion:
    """Bent for minutes, straight for a minute, bent another way."""
    bent, other = anywhere(random, 0.6, 0.9), anywhere(random, 0.3, 0.7)
    held, straight = random.uniform(90, 150), random.uniform(40, 80)
    leaves = np.array([0.0, 4.0, 4 + held, 4 + held + straight])
    bend = through(np.array([0 * bent, bent, 0 * bent, other]), leaves, 3.0)
    return Motion(held + straight + 40, int(random.integers(95, 150)), bend)


MOTIONS: dict[str, Callable[[np.random.Generator], Motion]] = {
    "single": single, "loops": loops, "circle": circle, "sines": sines, "quick": quick, "steps": steps, "poses": poses,
    "hold": hold, "between": between, "line": line, "spiral": spiral,
}  # fmt: skip
ALWAYS = ("single", "loops", "circle", "sines", "quick", "steps", "poses", "hold", "between")
MOTIONS_REPEATED = tuple(kind for kind in MOTIONS if kind != "hold")  # a second hold would make a day of holds
