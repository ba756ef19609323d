"""The predictions a report compares: the robot as described, calibrated, and with the effects found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.bench import Bench
from twin.diagnose import Diagnosis
from twin.report.plots import ACCENT, BEFORE


@dataclass(frozen=True)
class Stage:
    """One twin's prediction: its key in `Diagnosis.predictions`, how it is called, and the colour it is drawn in."""

    key: str
    words: str
    color: str


def before_and_after(diagnosis: Diagnosis) -> tuple[Stage, Stage]:
    """The two stages whose difference a report shows: calibrated and with effects; without any, as described and calibrated."""
    if diagnosis.claims:
        return Stage("calibrated", "calibrated, no effect added", BEFORE), Stage("after", "with the effects", ACCENT)
    return Stage("nominal", "as described", BEFORE), Stage("calibrated", "calibrated", ACCENT)


def residuals(diagnosis: Diagnosis, stage: Stage) -> list[np.ndarray]:
    """Measured - predicted (n_k, n_output) SI of every trial."""
    return [y - p for y, p in zip(diagnosis.bench.measured, diagnosis.predictions[stage.key], strict=True)]


def markers(bench: Bench) -> list[tuple[str, list[int]]]:
    """Markers measured in x, y and z, base to tip: name and the three columns among the bench's outputs."""
    found: dict[int, dict[int, int]] = {}
    for j, o in enumerate(bench.outputs):
        if o.group == "marker":
            found.setdefault(o.index, {})[o.axis] = j
    whole = {i: [axes[a] for a in range(3)] for i, axes in sorted(found.items()) if len(axes) == 3}
    return [(bench.outputs[columns[0]].channel.name.rpartition("_")[0], columns) for columns in whole.values()]
