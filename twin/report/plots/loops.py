"""Describe loops: how far pull and release differ at the same commands, before any effect is fitted."""

from collections.abc import Sequence
from typing import Any

from twin.diagnosis import Diagnosis
from twin.diagnosis.checks.loops import Loops
from twin.report.numbers import DISPLAY_UNITS, finite_or_none, format_number
from twin.report.sentence import trial_labels


def describe_loops(found: Loops) -> str:
    """Say whether pull and release differ, in which direction, and whether time could cause the same."""
    if not found.by_trial:
        return "Loops: no trial returns over its own commands, so pull and release cannot be compared."
    unit, factor = DISPLAY_UNITS[found.group]
    lag, noise = factor * found.lag, factor * found.noise
    trials = len(found.by_trial)
    where = f"{found.name}, {trials} trial{'s' if trials > 1 else ''}, noise {format_number(noise)} {unit}"
    if not found.seen:
        return f"Loops: at the same commands release and pull differ by no more than noise ({format_number(lag)} {unit}; {where})."
    way = "lags: it moves less on pull and stays further out on release" if lag > 0 else "leads: it stays less far out on release"
    words = f"Loops: at the same commands release and pull differ by {format_number(lag)} {unit} ({where}); the robot {way}."
    if found.confounded:
        words += (
            " Every command was visited once in each direction and in the same order, so friction, creep and drift look alike here."
        )
    return words


def advise_repeat(diagnosis: Diagnosis) -> str | None:
    """Name the trial to repeat where a loop could come from direction or from time; None where it is clear."""
    found = diagnosis.loops
    if not (found.seen and found.confounded):
        return None
    again = trial_labels(diagnosis, (max(found.by_trial, key=lambda loop: abs(loop.lag)).trial,))[0]
    return (
        f"run {again} again with its pull interrupted: pull to its largest command, release to half, pull to the largest again, "
        "release. Then some commands are reached by release before pull, which separates friction from creep and drift"
    )


def loops_json(found: Loops, names: Sequence[str]) -> dict[str, Any]:
    """Return the loops for report.json, in the unit of the output."""
    unit, factor = DISPLAY_UNITS[found.group]
    return {
        "output": found.name,
        "unit": unit,
        "lag": finite_or_none(found.lag, factor),
        "noise": finite_or_none(found.noise, factor),
        "seen": found.seen,
        "time_and_direction_confounded": found.confounded,
        "trials": [
            {
                "trial": name,
                "lag": finite_or_none(loop.lag, factor),
                "noise": finite_or_none(loop.noise, factor),
                "drift": finite_or_none(loop.drift, factor),
                "pairs": loop.pairs,
            }
            for name, loop in zip(names, found.by_trial, strict=True)
        ],
    }
