"""Headings that walk: an IMU without a magnetometer integrates its gyro's errors into its turn about the vertical."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.diagnosis.thresholds import FEWEST_HELD_ROWS, HELD_COMMAND_RANGE, WALK_OF_HEADING
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.orientations import Orientation


def walking(case: Case) -> Iterator[Suspicion]:
    """Yield orientations that turn about the vertical while the commands hold and nothing tilts.

    Of every stretch of held commands its second half counts, when bodies have come to rest.
    """
    gravity = np.mean([np.mean(np.atleast_2d(i.loads.gravity), axis=0) for i in case.prepared.inputs], axis=0)
    if not gravity.any():
        return
    up = Rotation.from_rotvec(case.twin.body().frame.turn).apply(-gravity / np.linalg.norm(gravity))
    held = _held(case)
    for o in case.prepared.orientations:
        first = next(j for j, out in enumerate(case.prepared.outputs) if out.channel == o.turns[0])
        vectors = [
            y[rows][:, first : first + 3] for k, rows in held if np.isfinite(y := case.prepared.measured[k])[rows, first].all()
        ]
        changes = [(Rotation.from_rotvec(v[-1]) * Rotation.from_rotvec(v[len(v) // 2]).inv()).as_rotvec() for v in vectors]
        if not changes:
            continue
        along = np.array(changes) @ up
        tilt = np.linalg.norm(np.array(changes) - along[:, None] * up, axis=1)
        heading, tilted = (float(np.sqrt(np.mean(x**2))) for x in (along, tilt))
        noise = o.turns[0].noise or OUTPUT_GROUPS["turn"].typical_noise
        if heading > WALK_OF_HEADING * max(tilted, noise):
            yield _suspicion(o, heading, tilted)


def _held(case: Case) -> list[tuple[int, slice]]:
    """Return the stretches of rows, by trial, in which no command leaves a small part of its range."""
    found = []
    every = np.concatenate([i.command for i in case.prepared.inputs])
    room = HELD_COMMAND_RANGE * np.ptp(every, axis=0)
    for k in case.trials:
        command = case.prepared.inputs[k].command
        starts = [0, *(np.flatnonzero((np.abs(np.diff(command, axis=0)) > room).any(axis=1)) + 1), len(command)]
        for a, b in pairwise(starts):
            if b - a >= FEWEST_HELD_ROWS and np.all(np.ptp(command[a:b], axis=0) <= room):
                found.append((k, slice(a, b)))
    return found


def _suspicion(of: Orientation, heading: float, tilted: float) -> Suspicion:
    names, (walk, tilt) = [c.name for c in of.channels], (f"{np.degrees(x):.2g} deg" for x in (heading, tilted))
    words = (
        f"{', '.join(names)}: while commands hold, the heading goes on by {walk} and the tilt by {tilt}: a drift of the sensor, "
        "as of a gyro without a magnetometer; no motion of the robot turns it so"
    )
    if len(names) == len(of.turns):
        change = f"the role 'context' for {names[-1]}; {names[0]} and {names[1]} stay outputs"
    else:
        place = of.turns[0].name.removesuffix("_turn_x")
        change = f"{place}_roll and {place}_pitch in place of the quaternion, whose heading is not known"
    return Suspicion("heading", words, change, 0.0, "turn")
