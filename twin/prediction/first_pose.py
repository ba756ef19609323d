"""Where a trial's joints stand before it begins, as its encoders show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from twin.body import Body, Start
from twin.effects.base.chain import EffectChain
from twin.measurements import Trial

if TYPE_CHECKING:
    from twin.prediction.prepared import Inputs, Output

JOINTS = ("joint angle", "joint shift")
AT_REST = 1.5  # times the scatter from row to row: a joint whose readings scatter more on the whole moves
LEAST_ROWS = 3  # whose scatter says how well a position is known
DOUBTED = 10.0  # standard errors: a pose that is that far off is half believed, one at three of them by a tenth


def with_seen(start: Start, trial: Trial, outputs: Sequence[Output], command: np.ndarray, body: Body) -> Start:
    """Return a start with the mean positions (n_joint,) of joints that encoders show while the first command (n, n_tendon) holds.

    They are NaN where no encoder does or the joint moves, and doubted by `DOUBTED` times their standard error. A trial that names a
    pose keeps it.
    """
    measured = {o.index: trial.values[o.channel.name] for o in outputs if o.group in JOINTS}
    moved = np.flatnonzero(np.any(command != command[0], axis=1))
    held = int(moved[0]) if moved.size else len(command)
    if start.pose or not measured or held < LEAST_ROWS:
        return start
    n_joint = max(sense.index + 1 for sense in body.senses.values() if sense.group in JOINTS)
    seen, doubt = np.full(n_joint, np.nan), np.full(n_joint, np.nan)
    for joint, position in measured.items():
        known = position[:held][np.isfinite(position[:held])]
        if known.size >= LEAST_ROWS and known.std() <= AT_REST * (noise := max(float(np.diff(known).std()) / np.sqrt(2.0), 1e-9)):
            seen[joint], doubt[joint] = known.mean(), DOUBTED * noise / np.sqrt(known.size)
    return replace(start, seen=tuple(map(float, seen)), doubt=tuple(map(float, doubt)))


def true_start(inputs: Inputs, chain: EffectChain) -> Start:
    """Return where a trial begins, its joints without what effects of their encoders add."""
    if not inputs.start.seen:
        return inputs.start
    shown = np.array([inputs.start.seen])
    first = inputs.signals
    row = first.with_changes(
        time=first.time[:1], clock=first.clock[:1], tension=first.tension[:1], displacement=first.displacement[:1],
        markers=first.markers[:1], temperature=first.temperature[:1], current=first.current[:1], control=first.control[:1],
        others=dict.fromkeys(JOINTS, shown),
    )  # fmt: skip
    sensed = chain.sense(row).others
    turned, shifted = (sensed[group] - shown for group in JOINTS)  # of a joint that turns, and of one that slides
    return replace(inputs.start, seen=tuple(map(float, (shown - np.where(turned != 0.0, turned, shifted))[0])))
