"""Loops in words and numbers: how far pulling and releasing at the same commands differ, before any law is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from twin.diagnose import Diagnosis
from twin.diagnose.loops import Loops
from twin.report.numbers import SHOWN, finite, number
from twin.report.sentence import labels


def loop_words(found: Loops) -> str:
    """Whether pull and release differ, which way, and whether time could do the same."""
    if not found.each:
        return "Loops: no trial comes back over its own commands, so pull and release cannot be compared."
    unit, factor = SHOWN[found.group]
    lag, noise = factor * found.lag, factor * found.noise
    trials = len(found.each)
    where = f"{found.name}, {trials} trial{'s' if trials > 1 else ''}, noise {number(noise)} {unit}"
    if not found.seen:
        return f"Loops: pull and release of the same commands differ by no more than noise ({number(lag)} {unit}; {where})."
    way = "lags: it reaches less when pulled and keeps more when released" if lag > 0 else "leads: it keeps less when released"
    words = f"Loops: at the same commands release and pull differ by {number(lag)} {unit} ({where}); the robot {way}."
    if found.confounded:
        words += (
            " Every command was visited once in each direction and in the same order: friction, creep and drift look alike here."
        )
    return words


def advice(diagnosis: Diagnosis) -> str | None:
    """The trial that parts direction from time, where a loop was seen that could be either."""
    found = diagnosis.loops
    if not (found.seen and found.confounded):
        return None
    again = labels(diagnosis, (max(found.each, key=lambda loop: abs(loop.lag)).trial,))[0]
    return (
        f"run {again} again with its pull interrupted: pull to its largest command, release to half, pull to the largest again, "
        "release; so that some commands are reached by release before pull, and friction parts from creep and drift"
    )


def table(found: Loops, names: Sequence[str]) -> dict[str, Any]:
    """For report.json, in the unit of the output."""
    unit, factor = SHOWN[found.group]
    return {
        "output": found.name,
        "unit": unit,
        "lag": finite(found.lag, factor),
        "noise": finite(found.noise, factor),
        "seen": found.seen,
        "time_and_direction_confounded": found.confounded,
        "trials": [
            {
                "trial": name,
                "lag": finite(loop.lag, factor),
                "noise": finite(loop.noise, factor),
                "drift": finite(loop.drift, factor),
                "pairs": loop.pairs,
            }
            for name, loop in zip(names, found.each, strict=True)
        ],
    }
