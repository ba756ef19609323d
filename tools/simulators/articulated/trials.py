"""Plans a session: the motions of every trial, in a drawn order on one clock. Each trial leaves from home and comes back to it.

A motion is amplitudes a_k(t) of the robot's moves; command = home + sum_k a_k by_k. Between its values an amplitude
eases as (1 - cos pi s) / 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tools.simulators.articulated.bench import DECIMALS, Trial, command_unit
from tools.simulators.articulated.robots import Robot

LEAD = 0.3  # s at home before and after the motion


@dataclass(frozen=True)
class Day:
    """A session: its trials in order, the names of those held out, and whether the camera ran."""

    trials: tuple[Trial, ...]
    held: frozenset[str]
    camera: bool

    @property
    def measured(self) -> list[Trial]:
        """The trials that are not held out."""
        return [t for t in self.trials if t.name not in self.held]

    @property
    def holdout(self) -> list[Trial]:
        """The trials held out."""
        return [t for t in self.trials if t.name in self.held]


def eased(t: np.ndarray, knots: np.ndarray, values: np.ndarray, ramp: float | None = None) -> np.ndarray:
    """Ease through values (knots, k) at the knots; with `ramp` s the change happens in that time before each knot."""
    at = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
    span = np.diff(knots)[at]
    takes = span if ramp is None else np.minimum(ramp, span)
    s = np.clip((t - knots[at] - (span - takes)) / takes, 0.0, 1.0)[:, None]
    return values[at] + (values[at + 1] - values[at]) * 0.5 * (1.0 - np.cos(np.pi * s))


def _some(robot: Robot, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw amplitudes (count, moves) whose sizes sum to at most 1.2, from home to home."""
    low = np.array([m.low for m in robot.moves])
    drawn = low + (1.0 - low) * rng.uniform(size=(count, len(low)))
    drawn /= np.maximum(1.0, np.abs(drawn).sum(axis=1, keepdims=True) / 1.2)
    drawn[[0, 1, -1]] = 0.0
    return drawn


def _knots(seconds: float, shortest: float, longest: float, rng: np.random.Generator) -> np.ndarray:
    knots = [0.0, LEAD]
    while knots[-1] < seconds - LEAD - longest:
        knots.append(knots[-1] + rng.uniform(shortest, longest))
    return np.array([*knots, seconds - LEAD])


def wander(robot: Robot, t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Go through drawn amplitudes, one every 0.25 to 0.9 s."""
    knots = _knots(t[-1], 0.25, 0.9, rng)
    return eased(t, knots, _some(robot, len(knots), rng))


def stand(robot: Robot, t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Stand for two seconds or three at drawn amplitudes, half a second between."""
    knots = _knots(t[-1], 2.0, 3.0, rng)
    return eased(t, knots, _some(robot, len(knots), rng), 0.5)


def steps(robot: Robot, t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Step to drawn amplitudes once in 0.8 to 1.2 s, within 60 ms."""
    knots = _knots(t[-1], 0.8, 1.2, rng)
    return eased(t, knots, _some(robot, len(knots), rng), 0.06)


def one_move(robot: Robot, move: int, t: np.ndarray, turns: int) -> np.ndarray:
    """Run one move there and back so many times, each time a little less far."""
    knots = np.linspace(LEAD, t[-1] - LEAD, 2 * turns + 1)
    values = np.zeros((len(knots), len(robot.moves)))
    low = robot.moves[move].low
    values[1::2, move] = np.linspace(0.9, 0.55, turns)
    values[2:-1:2, move] = 0.1 if low == 0.0 else 0.8 * low
    return eased(t, np.array([0.0, *knots]), np.array([values[0], *values]))


def chirp(robot: Robot, t: np.ndarray) -> np.ndarray:
    """Swing the first two moves from 0.3 to 4 Hz, by a ninth about home or about the middle of a move that is one-sided."""
    ends = np.array([0.0, LEAD, LEAD + 1.0, t[-1] - LEAD - 1.0, t[-1] - LEAD])
    fade = eased(t, ends, np.array([0.0, 0.0, 1.0, 1.0, 0.0])[:, None])
    rate = (4.0 - 0.3) / t[-1]
    swing = np.sin(2.0 * np.pi * (0.3 * t + 0.5 * rate * t * t))
    found = np.zeros((len(t), len(robot.moves)))
    for k, move in enumerate(robot.moves[:2]):
        middle = 0.45 if move.low == 0.0 and k == 0 else 0.0 if move.low < 0.0 else 0.15
        found[:, k] = fade[:, 0] * (middle + 0.11 * (1 - 2 * k) * swing)
    return found


def _motions(robot: Robot, rate: int, rng: np.random.Generator) -> list[tuple[str, np.ndarray, float]]:
    """Return name, amplitudes over time and payload of every trial; those held out begin with `held`."""

    def clock(seconds: float) -> np.ndarray:
        return np.arange(round(seconds * rate) + 1) / rate

    heavy, light, held = robot.payloads
    found: list[tuple[str, np.ndarray, float]] = []
    for k, move in enumerate(robot.moves):
        found.append((f"slow_{move.name}", one_move(robot, k, clock(rng.integers(10, 13)), 2), 0.0))
        if k < 2:
            found.append((f"fast_{move.name}", one_move(robot, k, clock(6.0), 6), 0.0))
    again = wander(robot, clock(7.0), rng)
    found += [
        ("chirp", chirp(robot, clock(10.0)), 0.0),
        ("steps", steps(robot, clock(9.0), rng), 0.0),
        ("hold", stand(robot, clock(10.0), rng), 0.0),
        ("random_1", wander(robot, clock(10.0), rng), 0.0),
        ("payload_1", wander(robot, clock(9.0), rng), heavy),
        ("payload_2", wander(robot, clock(8.0), rng), light),
        ("repeat_1", again, 0.0),
        ("repeat_2", again, 0.0),
        ("held_random", wander(robot, clock(10.0), rng), 0.0),
        ("held_steps", steps(robot, clock(8.0), rng), 0.0),
        ("held_payload", wander(robot, clock(8.0), rng), held),
    ]
    return found if len(robot.moves) > 3 else [*found, ("random_2", wander(robot, clock(9.0), rng), 0.0)]


def session(robot: Robot, rng: np.random.Generator, camera: bool | None = None) -> Day:
    """Plan a session; without `camera` one day in five has none."""
    rate = int(rng.choice(robot.rates))
    filmed = bool(rng.uniform() > 0.2)
    home, by = np.array([d.home for d in robot.drives]), np.array([m.by for m in robot.moves])
    scale = np.array([command_unit(drive)[1] for drive in robot.drives])
    planned = []
    for name, amplitudes, payload in _motions(robot, rate, rng):
        shown = np.round((home + amplitudes @ by) * scale, DECIMALS)
        planned.append(Trial(name, shown / scale, rate, payload))
    trials, now = [], 0.0
    for i in rng.permutation(len(planned)):
        trials.append(replace(planned[i], start=round(now, 2)))
        now += planned[i].time[-1] + rng.uniform(15.0, 45.0)
    held = frozenset(t.name for t in trials if t.name.startswith("held"))
    return Day(tuple(trials), held, filmed if camera is None else camera)
