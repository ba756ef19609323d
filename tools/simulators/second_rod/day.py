"""One day on the bench: which trials, how the robot is mounted and loaded, how well it is measured. Effects come later.

Numbers are drawn within what nominal.md tells of such logs. What an effect needs to show at all, say its temperature logged or an
early trial repeated late, it asks for by name (`Want`), as an operator who suspects it would arrange.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tools.simulators.second_rod.mechanics.rod import INTERVALS
from tools.simulators.second_rod.motions import ALWAYS, MOTIONS, MOTIONS_REPEATED, TOWARDS, Motion
from tools.simulators.second_rod.robot import Robot, built

Array = np.ndarray
Drive = Literal["tension", "displacement"]
Want = Literal["pretension", "weights", "repeats over hours", "ambient temperature", "every marker"]
STANDARD_GRAVITY = 9.81  # m/s^2
HEAVIEST_BY_MOUNT = {"upright": 5e-3, "sideways": 10e-3, "hanging": 20e-3}  # kg; more buckles or overloads the robot
GENTLER = {"upright": 0.8, "sideways": 0.9, "hanging": 1.0}  # share of the tensions
CORNER = 0.012  # share of the largest tension over which a command's corner at zero is rounded off
SLACKENING = 0.08  # bend over which a tendon that is paid out gets its full slack
REFERENCE = 23.0  # degC at which stiffness is quoted (nominal.md)


@dataclass(frozen=True)
class Trial:
    """`command`: times (n,) s -> (n, TENDONS) N, or m pulled in."""

    name: str
    times: Array  # (rows,) s
    command: Callable[[Array], Array]
    payload: float  # kg
    mount: str
    start: float = 0.0  # s on the day's clock


@dataclass(frozen=True)
class Day:
    """All but the effects. SI units."""

    drive: Drive
    robot: Robot
    gravities: dict[str, Array]  # of each mounting, m/s^2
    mount: str  # of the set; a trial may have another
    trials: tuple[Trial, ...]
    duration: float  # s
    largest_command: float  # N or m
    temperature: Callable[[Array], Array]  # clock (n,) s -> degC
    markers: tuple[int, ...]  # disks that bear one, from 1
    marker_noise: float  # m a coordinate
    tension_noise: float  # N
    displacement_noise: float  # m
    missing: float  # share of marker samples
    tells_noise: bool
    logs_temperature: bool
    repeats: bool

    @property
    def by_displacement(self) -> bool:
        return self.drive == "displacement"

    @property
    def input_noise(self) -> float:
        return self.displacement_noise if self.by_displacement else self.tension_noise


def tensions(motion: Motion, preload: float, largest: float, share: float) -> Callable[[Array], Array]:
    """preload + largest (positive part of the bend's component towards each tendon + the shared pull), N."""

    def command(times: Array) -> Array:
        towards = share * motion.bend(times) @ TOWARDS.T
        positive = 0.5 * (towards + np.sqrt(towards**2 + CORNER**2))
        return preload + largest * (positive + share * motion.pull(times)[:, None])

    return command


def displacements(motion: Motion, stroke: float, paid_out: float, slack: float) -> Callable[[Array], Array]:
    """Pulled in by the bend's component towards each tendon; the others are paid out by more than it takes, so go slack, m."""

    def command(times: Array) -> Array:
        towards = motion.bend(times) @ TOWARDS.T
        negative = np.minimum(towards, 0)
        return stroke * (np.maximum(towards, 0) + paid_out * negative) - slack * (1 - np.exp(negative / SLACKENING))

    return command


def mountings(random: np.random.Generator, wants: frozenset[Want]) -> tuple[dict[str, Array], str, str]:
    """Gravity of each mounting, the set's mounting, and another for some trials (or the same)."""
    azimuth = np.deg2rad(random.choice([0.0, 30.0, 90.0, 180.0, 270.0]))
    sideways = np.round(STANDARD_GRAVITY * np.array([np.cos(azimuth), np.sin(azimuth), 0]), 4) + 0.0  # no -0.0 in the files
    gravities = {
        "hanging": np.array([0, 0, STANDARD_GRAVITY]),
        "upright": np.array([0, 0, -STANDARD_GRAVITY]),
        "sideways": sideways,
    }
    weighs = "weights" in wants
    mount = str(random.choice(["sideways", "hanging"], p=[0.6, 0.4]) if weighs else random.choice(list(gravities)))
    other = str(random.choice([name for name in gravities if name != mount]))
    return gravities, mount, other if random.random() < (0.6 if weighs else 0.3) else mount


def sequence(random: np.random.Generator, wants: frozenset[Want]) -> tuple[list[str], list[int]]:
    """Kinds of motion in order, and which of those trials are run again at the end."""
    number = int(random.integers(12, 18))
    repeats = random.random() < 0.69 or "repeats over hours" in wants
    again = 0 if not repeats else 2 if number > 13 else 1
    kinds = [*ALWAYS, *(str(kind) for kind in random.choice(MOTIONS_REPEATED, number - again - len(ALWAYS)))]
    random.shuffle(kinds)
    early = [int(random.integers(0, 3)), int(random.integers(3, 6))]
    return kinds, early[:again]


def draw_day(random: np.random.Generator, drive: Drive, wants: frozenset[Want] = frozenset(), trials: int | None = None) -> Day:
    """A day whose inputs are of one kind. `trials`: no more than so many of them, for tests."""
    gravities, mount, other = mountings(random, wants)
    largest = random.uniform(2.2, 3.6) if drive == "tension" else random.uniform(8.5e-3, 12.5e-3)
    preload = 0.2 if "pretension" in wants else float(random.choice([0.08, 0.12, 0.15, 0.2]))
    paid_out, slack = random.uniform(1.06, 1.15), random.uniform(0.3e-3, 0.9e-3)
    payloads = [0.0, 0.0, 5e-3, 10e-3, 20e-3] if random.random() < 0.6 or "weights" in wants else [0.0]
    kinds, again = sequence(random, wants)
    run: list[Trial] = []
    for number, kind in enumerate(kinds):
        motion = MOTIONS[kind](random)
        place = other if random.random() < 0.4 else mount
        payload = min(float(random.choice(payloads)), HEAVIEST_BY_MOUNT[place])
        gentler = GENTLER[place] - (0.1 if place == "upright" and payload > 0 else 0.0)
        name = f"{kind}_{1 + kinds[:number].count(kind)}"
        times = np.round(np.linspace(0, motion.duration, motion.rows + 1), 4)
        command = (
            tensions(motion, preload, largest, gentler) if drive == "tension" else displacements(motion, largest, paid_out, slack)
        )
        run.append(Trial(name, times, command, payload, place))
    run += [Trial(f"{run[n].name}_again", run[n].times, run[n].command, run[n].payload, run[n].mount) for n in again]
    longer = 6 if random.random() < 0.4 or "repeats over hours" in wants else 1
    clock, started = 0.0, []
    for trial in run[:trials]:
        started.append(Trial(trial.name, trial.times, trial.command, trial.payload, trial.mount, round(clock, 1)))
        clock += trial.times[-1] + longer * random.uniform(25, 90)
    everything = random.random() < 0.75 or "every marker" in wants
    some = (*sorted(int(n) for n in random.choice(np.arange(1, INTERVALS), 4, replace=False)), INTERVALS)
    return Day(
        drive=drive,
        robot=built(random),
        gravities=gravities,
        mount=mount,
        trials=tuple(started),
        duration=clock,
        largest_command=largest + (preload if drive == "tension" else 0.0),
        temperature=weather(random, clock, "ambient temperature" in wants),
        markers=tuple(range(1, INTERVALS + 1)) if everything else some,
        marker_noise=random.uniform(0.2e-3, 0.3e-3),
        tension_noise=float(np.exp(random.uniform(np.log(0.004), np.log(0.03)))),
        displacement_noise=random.uniform(0.01e-3, 0.03e-3),
        missing=0.005 if random.random() < 0.7 else 0.0,
        tells_noise=random.random() < 0.5,
        logs_temperature=random.random() < 0.3 or "ambient temperature" in wants,
        repeats=bool(again),
    )


def weather(random: np.random.Generator, duration: float, warm: bool) -> Callable[[Array], Array]:
    """The room's temperature, degC: warming and cooling again by some degrees, a heating that comes and goes."""
    coldest, rise = random.uniform(19.5, 22.5), random.uniform(6, 9) if warm else random.uniform(1, 4)
    phase = random.uniform(0, 2 * np.pi)

    def temperature(clock: Array) -> Array:
        day = 0.5 - 0.5 * np.cos(1.5 * np.pi * clock / duration)
        return coldest + rise * day + 0.3 * np.sin(2 * np.pi * clock / 700 + phase)

    return temperature
