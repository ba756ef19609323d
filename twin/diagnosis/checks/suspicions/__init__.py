"""Suspicions about what a file means, raised before anything is fitted: units, signs, order, frames, clocks. Nothing is repaired.

case.py       what is looked at, and how a changed file would be predicted

units.py      readings, commands, payloads in another unit than declared
signs.py      displacements, readings and gravity the other way round
frames.py     markers mirrored, turned, shifted
order.py      tendons and markers exchanged
trials.py     duplicates, another robot, clocks, milliseconds
channels.py   dead channels, declared noise, room temperature
clouds.py     point clouds in another unit, or away from their markers
description.py  robot.toml off by a thousand
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from twin.diagnosis.checks.suspicions import channels, clouds, description, frames, order, signs, trials, units
from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.split import blind
from twin.diagnosis.thresholds import UNDECIDED_CHANGES_RATIO
from twin.prediction.prepared import PreparedRecording
from twin.prediction.twin import Twin

Kind = Callable[[Case], Iterable[Suspicion]]
SEEN_IN_FILES: tuple[Kind, ...] = (  # in the files, beside the nominal prediction
    trials.times, trials.clocks, trials.duplicates, trials.robots, units.outputs, channels.room, channels.outputs, channels.noise,
    signs.outputs, signs.size, frames.frame, order.markers, clouds.clouds,
)  # fmt: skip
TRIED: tuple[Kind, ...] = (  # by predicting a few trials again
    units.payloads, units.torques, signs.gravity, signs.displacements, order.tendons, channels.inputs,
)  # fmt: skip
LAST: tuple[Kind, ...] = (
    units.commands,
    description.parameters,
)  # thousandfold loads: where nothing else explains, or the robot as described has no equilibrium
UNREADABLE = tuple(units.UNIT_SUSPICIONS.values())  # readings in a wrong unit say nothing of loads


def suspicions(
    prepared: PreparedRecording, twin: Twin, held_out: Sequence[int], nominal: Sequence[np.ndarray] | None
) -> tuple[Suspicion, ...]:
    """All that looks wrong about what the file means, with the change that would remove it.

    `nominal` (n_k, n_output) is the prediction of the twin as described, None where it has no equilibrium. Of sealed trials only
    inputs and conditions are looked at. Of changes that explain the same readings the likeliest are kept.
    """
    case = Case(blind(prepared, held_out), twin, nominal)
    found = [s for kind in SEEN_IN_FILES for s in kind(case)]

    def explained() -> bool:
        return any(s.group == case.group for s in found)

    def tried(kinds: Sequence[Kind]) -> list[Suspicion]:
        return [s for kind in kinds for s in kind(case.thinned())]

    if nominal is not None and not any(s.kind in UNREADABLE and s.group == case.group for s in found):
        found += tried(TRIED)
    for kind in LAST:
        if not explained():
            found += tried([kind])
    if nominal is None and not explained():  # what has no equilibrium is sooner off by a thousand than turned or exchanged
        found += tried(TRIED)
    return tuple(s for s in found if s.left <= UNDECIDED_CHANGES_RATIO * min(o.left for o in found if o.group == s.group))


__all__ = ["LAST", "SEEN_IN_FILES", "TRIED", "Case", "Suspicion", "suspicions"]
