"""The split into fitted and held-out trials, by the inputs and the seed, never by what was measured."""

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from twin.diagnosis.checks.design import longest_rest, pulled, rates
from twin.diagnosis.noise.estimate import repeats
from twin.diagnosis.thresholds import HELD_OUT_SHARE, SAME_RATE_RATIO, SHORTEST_HOLD
from twin.prediction.prepared import PreparedRecording

LOAD_CONDITIONS = ("payload", "mount", "force")


def split(prepared: PreparedRecording, seed: int) -> tuple[list[int], list[int]]:
    """Return the (fitted, held-out) trials, both in clock order.

    About a quarter is held out. A trial is held out last if it alone among the fitted ones shows a condition (a payload, a mount, a
    kind of motion, an end of a range) or repeats another, since repeats show the noise. Losing a load counts more than losing a
    repeat. What begins at an end of a range, as a stop, a slack tendon or a saturated motor, shows nowhere else.
    """
    n = len(prepared.inputs)
    shown = list(_conditions(prepared))
    repeated = {k for pair in repeats(prepared) for k in pair}
    place = np.random.default_rng(seed).permutation(n)
    open_, wanted = set(range(n)), max(1, round(HELD_OUT_SHARE * n))
    while n - len(open_) < wanted:
        count = Counter(c for k in open_ for c in shown[k])
        lost = {k: sum(1 + (c[0] in LOAD_CONDITIONS) for c in shown[k] if count[c] == 1) for k in open_}
        open_.remove(min(open_, key=lambda k: (lost[k] + (k in repeated), k in repeated, place[k])))
    return sorted(open_), [k for k in range(n) if k not in open_]


def blind(prepared: PreparedRecording, trials: Sequence[int]) -> PreparedRecording:
    """Return the prepared recording without the measurements of these trials; their inputs stay, for a body with memory."""
    measured = [np.full_like(y, np.nan) if k in trials else y for k, y in enumerate(prepared.measured)]
    return replace(prepared, measured=tuple(measured))


def _conditions(prepared: PreparedRecording) -> Iterator[set[tuple[Hashable, ...]]]:
    """Yield the conditions that each trial shows, by its inputs and loads only."""
    top = max(float(np.abs(i.pull).max()) for i in prepared.inputs)
    told, one = prepared.pull_resolution, np.zeros(1)
    ends = {
        "most": (np.array([i.pull.max(axis=0) for i in prepared.inputs]), told),
        "least": (-np.array([i.pull.min(axis=0) for i in prepared.inputs]), told),
        "most torque": (np.array([[np.mean(i.loads.torque)] for i in prepared.inputs]), one),
        "least torque": (-np.array([[np.mean(i.loads.torque)] for i in prepared.inputs]), one),
        "warmest": (np.array([[i.temperature.mean()] for i in prepared.inputs]), one),
        "coldest": (-np.array([[i.temperature.mean()] for i in prepared.inputs]), one),
    }
    for k, i in enumerate(prepared.inputs):
        moved = pulled(i, top)
        shown: set[tuple[Hashable, ...]] = {
            ("payload", round(i.loads.hung, 6)),
            ("mount", *np.round(i.loads.gravity, 3)),
            ("force", *np.round(i.loads.force, 3)),
            ("together", *moved),
            *(("pull of", t) for t in moved),
            *(("pace", round(float(np.log(r) / np.log(SAME_RATE_RATIO)))) for r in rates(i, top)),
        }
        if longest_rest(i, top) >= SHORTEST_HOLD:
            shown.add(("hold",))
        for name, (values, alike) in ends.items():
            reaches = (values[k] >= values.max(axis=0) - alike) & (np.ptp(values, axis=0) > alike)
            shown |= {(name, c) for c in np.flatnonzero(reaches)}
        yield shown
