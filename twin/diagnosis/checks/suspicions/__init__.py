"""Suspicions: possible mistakes in the files, found before any fit: units, signs, order, frames, clocks. Nothing is repaired.

case.py         the data, and predictions of a changed file
units.py        readings, commands, payloads in another unit than declared
signs.py        displacements, readings and gravity of the opposite sign or direction
frames.py       markers mirrored, turned, shifted; orientations about other axes, or inverse
order.py        tendons and markers exchanged
trials.py       duplicates, another robot, clocks, milliseconds
channels.py     dead channels, declared noise, room temperature
headings.py     headings of IMUs that walk
stops.py        joints that end earlier than described
clouds.py       point clouds in another unit, or away from their markers
description.py  robot.toml off by a thousand
no_readings/    zeros, fills, stuck values, labels swapped for a while, roll-overs
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from twin.diagnosis.checks.suspicions import channels, clouds, description, frames, headings, order, signs, stops, trials, units
from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.checks.suspicions.no_readings import jumps, repeats
from twin.diagnosis.split import blind
from twin.diagnosis.thresholds import UNDECIDED_CHANGES_RATIO
from twin.prediction.prepared import PreparedRecording
from twin.prediction.twin import Twin

Kind = Callable[[Case], Iterable[Suspicion]]
SEEN_IN_FILES: tuple[Kind, ...] = (  # in the files, beside the nominal prediction
    trials.times, trials.clocks, trials.duplicates, trials.robots, units.outputs, channels.room, channels.outputs,
    repeats.lost_markers, repeats.fills, repeats.stuck, repeats.frozen, jumps.exchanged, jumps.rolled,
    channels.noise, signs.outputs, signs.size, frames.frame, frames.orientations, order.markers, clouds.clouds, stops.ends,
    headings.walking,
)  # fmt: skip
TRIED: tuple[Kind, ...] = (  # by predicting a few trials again
    units.payloads, units.torques, signs.gravity, signs.displacements, signs.zeros, order.tendons, channels.inputs,
)  # fmt: skip
LAST: tuple[Kind, ...] = (  # thousandfold loads: where nothing else explains, or the robot as described has no equilibrium
    units.commands, description.parameters,
)  # fmt: skip
UNREADABLE = tuple(units.UNIT_SUSPICIONS.values())  # readings in a wrong unit are no evidence about loads


def suspicions(
    prepared: PreparedRecording, twin: Twin, held_out: Sequence[int], nominal: Sequence[np.ndarray] | None
) -> tuple[Suspicion, ...]:
    """Return all possible mistakes in the files, with the change that would remove each.

    `nominal` (n_k, n_output) is the prediction of the twin as described, None where it has no equilibrium. Of held-out trials only
    inputs and conditions are used. Of several changes that explain the same readings the likeliest are kept.
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
    if nominal is None and not explained():  # without an equilibrium a factor of a thousand is likelier than a turn or an exchange
        found += tried(TRIED)
    return tuple(s for s in found if s.left <= UNDECIDED_CHANGES_RATIO * min(o.left for o in found if o.group == s.group))


__all__ = ["LAST", "SEEN_IN_FILES", "TRIED", "Case", "Suspicion", "suspicions"]
