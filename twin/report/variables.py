"""Everything a residual can be plotted against."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from twin.bench import Bench
from twin.report.stages import markers

STILL = 0.1  # of the median rate: a tendon that moves less is neither pulled nor released


@dataclass(frozen=True)
class Variable:
    """A quantity of every sample of all trials, (n,), with its axis title.

    `side` (-1, 0, 1) splits a loop's two branches; `shown` picks the samples in which the variable is the one that matters, and
    `which` says which those are.
    """

    words: str
    values: np.ndarray
    side: np.ndarray
    shown: np.ndarray
    loop: bool = False
    which: str = ""


def variables(bench: Bench) -> Iterator[tuple[str, Variable]]:
    """Each variable with its kind, as `giveaway.WORDS` names it."""
    inputs, n = bench.inputs, bench.n_sample
    factor = np.array([d.shown[1] for d in bench.drives])
    pull = np.concatenate([i.command for i in inputs]) * factor
    slope = np.concatenate([_slopes(i.time, i.command) for i in inputs]) * factor
    still = STILL * np.median(np.abs(slope), axis=0)
    strongest = np.argmax(pull, axis=1)
    every, no = np.ones(n, bool), np.zeros(n)
    for t in range(bench.n_tendon):
        side = np.where(np.abs(slope[:, t]) > still[t], np.sign(slope[:, t]), 0.0)
        what, unit = bench.drives[t], bench.drives[t].shown[0]
        title, which, shown = f"{what} of tendon {t + 1} ({unit})", f"in which tendon {t + 1} pulls hardest", strongest == t
        yield "loop", Variable(title, pull[:, t], side, shown, True, which)
        yield "tension", Variable(title, pull[:, t], no, shown, False, which)
        yield "rate", Variable(f"rate of tendon {t + 1}'s {what} ({unit}/s)", slope[:, t], no, every)
    for kind, title, parts in (
        ("elapsed", "time in the trial (s)", [i.time - i.time[0] for i in inputs]),
        ("clock", "time since the first trial (min)", [i.clock / 60.0 for i in inputs]),
        ("payload", "tip payload (g)", [np.full(len(i.time), 1e3 * i.loads.payload) for i in inputs]),
        ("torque", "load torque (N m)", [np.broadcast_to(i.loads.torque, len(i.time)) for i in inputs]),
        ("temperature", "ambient temperature (K)", [i.temperature for i in inputs]),
    ):
        yield kind, Variable(title, np.concatenate(parts), no, every)
    for kind, title, values in _of_the_tip(bench):
        yield kind, Variable(title, values, no, every)


def _of_the_tip(bench: Bench) -> Iterator[tuple[str, str, np.ndarray]]:
    whole = markers(bench)
    if not whole:
        return
    name, columns = whole[-1]
    at = 1e3 * np.concatenate(bench.measured)[:, columns]
    for a, axis in enumerate("xyz"):
        yield "position", f"measured {axis} of {name} (mm)", at[:, a]
    for angle in range(15, 360, 15):
        if angle % 90:
            c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
            yield "position", f"reach of {name} towards {angle}° from x (mm)", at[:, :2] @ [c, s]
    yield "azimuth", f"direction {name} is bent to (° from x)", np.degrees(np.arctan2(at[:, 1], at[:, 0]))
    yield "reach", f"distance of {name} from the z axis (mm)", np.hypot(at[:, 0], at[:, 1])


def _slopes(time: np.ndarray, command: np.ndarray) -> np.ndarray:
    """du/dt (n, n_tendon) in N/s or m/s, smoothed over five samples so that noise alone makes no direction."""
    if len(time) < 2:
        return np.zeros_like(command)
    padded = np.pad(command, ((2, 2), (0, 0)), mode="edge")
    smooth = sum(padded[k : k + len(time)] for k in range(5)) / 5.0
    return np.gradient(smooth, time, axis=0)
