"""Which place of the body an error sits at.

All from residuals of the fitted trials, (n, m).
"""

from collections.abc import Sequence

import numpy as np

from twin.diagnosis.thresholds import BEND_JUMP_RATIO, EVEN_MARKER_ERRORS_RATIO, SINGLE_MARKER_ERROR_RATIO
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.prepared import PreparedRecording
from twin.robots.family import load_family


def _markers(prepared: PreparedRecording) -> dict[str, list[int]]:
    """Columns of each marker by its name, base to tip, in order of their axes."""
    found: dict[int, list[int]] = {}
    for j, o in enumerate(prepared.outputs):
        if OUTPUT_GROUPS[o.group].is_point:
            found.setdefault(o.index, []).append(j)
    in_order = (sorted(found[i], key=lambda j: prepared.outputs[j].axis) for i in sorted(found))
    return {prepared.outputs[c[0]].channel.name.rpartition("_")[0]: c for c in in_order}


def place(prepared: PreparedRecording, x: np.ndarray) -> str:
    """Which markers carry an error x (n, m), in words; "" with fewer than three of them."""
    columns = _markers(prepared)
    if len(columns) < 3:
        return ""
    names = list(columns)
    size = np.array([np.sqrt((x[:, c] ** 2).mean()) for c in columns.values()])
    most = int(np.argmax(size))
    if size[most] < EVEN_MARKER_ERRORS_RATIO * size.min():
        return "it is alike along the body"
    if size[most] > SINGLE_MARKER_ERROR_RATIO * np.sort(size)[-2]:
        return f"{names[most]} alone carries most of it: check that marker"
    if most == len(names) - 1:
        return f"it grows from {names[0]} to {names[-1]}"
    return f"it fades from {names[0]} to {names[-1]}" if most == 0 else f"it is largest around {names[most]}"


def describe_location(prepared: PreparedRecording, trials: Sequence[int], off: np.ndarray, predicted: Sequence[np.ndarray]) -> str:
    """The place that `misbent` finds, in words; "" if there is none."""
    at = misbent_segment(prepared, trials, off, predicted)
    if at is None:
        return ""
    if at == 0:
        return " The fitted robot is off from its base on, as a whole: look at the clamp and the camera."
    names = [name for name, c in _markers(prepared).items() if len(c) == 3]
    return f" The fitted robot bends wrongly at one place, between {names[at - 1]} and {names[at]}."


def misbent_segment(
    prepared: PreparedRecording, trials: Sequence[int], off: np.ndarray, predicted: Sequence[np.ndarray]
) -> int | None:
    """The chord, from 0 at the base, in which alone the fitted robot bends wrongly; None if there is no such place.

    `off` (n, m) is the smooth part of its error, `predicted` (n_k, m) where it should be, both SI. A chord t from marker to marker,
    the base the first, turns by w = t x (change of `off` along it) / |t|^2. Bending that is wrong between two markers makes w jump
    at both, whatever the rest of the body does to make up for it. That holds of markers on a backbone: between points of a skin,
    here and there around it, a chord turns with the section too, and the shorter it is the more by their noise.
    """
    whole = {name: c for name, c in _markers(prepared).items() if len(c) == 3}
    if len(whole) < 4 or load_family(prepared.robot.family).chain is None:
        return None
    columns = list(whole.values())
    seen = np.concatenate([np.isfinite(prepared.measured[k][:, columns]).all(axis=(1, 2)) for k in trials])
    if not seen.any():
        return None
    t, moved = (_chords(x[:, columns][seen]) for x in (np.concatenate(list(predicted)), off))
    turn = np.cross(t, moved) / (t**2).sum(axis=2, keepdims=True)
    jump = (np.diff(turn, axis=1, prepend=0.0) ** 2).sum(axis=2).mean(axis=0)  # at the base and every marker but the last
    both = np.minimum(jump[:-1], jump[1:])
    at = int(np.argmax(both))
    return at if both[at] > BEND_JUMP_RATIO * np.delete(jump, [at, at + 1]).max() else None


def _chords(x: np.ndarray) -> np.ndarray:
    """Differences (n, marker, 3) from each marker to the next, the first from the base, which is at rest."""
    return np.diff(x, axis=1, prepend=0.0)
