"""The predictions a report compares: the robot as described, calibrated, and with the effects found."""

from dataclasses import dataclass

import numpy as np

from twin.diagnosis import Diagnosis
from twin.prediction.prepared import PreparedRecording
from twin.report.plots.figures import ACCENT_COLOUR, BEFORE_COLOUR


@dataclass(frozen=True)
class TwinStage:
    """A stage of the twin: its key in `Diagnosis.predictions`, its label and its colour."""

    key: str
    label: str
    colour: str


def compared_stages(diagnosis: Diagnosis) -> tuple[TwinStage, TwinStage]:
    """Return the two compared stages: calibrated and with effects; without effects, as described and calibrated."""
    if diagnosis.claims:
        before = TwinStage("calibrated", "calibrated, no effect added", BEFORE_COLOUR)
        return before, TwinStage("after", "with the effects", ACCENT_COLOUR)
    return TwinStage("nominal", "as described", BEFORE_COLOUR), TwinStage("calibrated", "calibrated", ACCENT_COLOUR)


def residuals(diagnosis: Diagnosis, stage: TwinStage) -> list[np.ndarray]:
    """Return measured - predicted (n_k, n_output), SI, of every trial."""
    return [y - p for y, p in zip(diagnosis.prepared.measured, diagnosis.predictions[stage.key], strict=True)]


def complete_markers(prepared: PreparedRecording) -> list[tuple[str, list[int]]]:
    """Return the markers measured in x, y and z, base to tip: name and its three columns of the prepared outputs."""
    found: dict[int, dict[int, int]] = {}
    for j, o in enumerate(prepared.outputs):
        if o.group == "marker":
            found.setdefault(o.index, {})[o.axis] = j
    whole = {i: [axes[a] for a in range(3)] for i, axes in sorted(found.items()) if len(axes) == 3}
    return [(prepared.outputs[columns[0]].channel.name.rpartition("_")[0], columns) for columns in whole.values()]
