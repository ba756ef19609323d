"""The markers' frame: mirrored, turned by a quarter or a half, shifted by centimetres."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from twin.diagnosis.checks.suspicions.case import Case, Suspicion, registration, rms
from twin.diagnosis.thresholds import LARGEST_CAMERA_SHIFT, LARGEST_CAMERA_TURN, LEFT_BY_FILE_CHANGE


def frame(case: Case) -> Iterator[Suspicion]:
    """The rigid motion, mirrored or not, that brings the predicted markers onto the measured ones."""
    names, columns = case.points()
    if case.predicted is None or case.unregistered or not len(names):
        return
    y, p = (
        np.concatenate([v[k][:, columns.ravel()] for k in case.trials]).reshape(-1, 3)
        for v in (case.prepared.measured, case.predicted)
    )
    before = rms(y - p)
    turn, shift = registration(p, y)
    turned = rms(y - p @ turn.T - shift)
    mirror = np.diag([1.0, 1.0, -1.0])
    flip, moved = registration(p @ mirror, y)
    flip = flip @ mirror
    mirrored = rms(y - p @ flip.T - moved)
    bar = min(before, case.motion(columns.ravel().tolist()))
    if mirrored < LEFT_BY_FILE_CHANGE * min(bar, turned):
        change = f"export the markers in the right-handed base frame: {_axes(flip)} (or check which tendon is which)"
        yield Suspicion("mirrored frame", f"the markers move as in a mirror: {_axes(flip)}", change, mirrored / before, "marker")
    elif turned < LEFT_BY_FILE_CHANGE * bar:
        angle, size = np.degrees(Rotation.from_matrix(turn).magnitude()), float(np.abs(p).max())
        if angle > LARGEST_CAMERA_TURN:
            words = f"the markers move as in a frame turned by {angle:.0f} degrees against the base frame: {_axes(turn)}"
            change = "export the markers in the base frame (z from base to tip, tendons counted from +x to +y)"
            yield Suspicion("turned frame", words, change, turned / before, "marker")
        elif np.linalg.norm(shift) > LARGEST_CAMERA_SHIFT * size:
            channel = case.prepared.outputs[columns[0, 0]].channel
            off = shift * channel.scale.denominator / channel.scale.numerator
            words = f"all markers are off by {np.round(off, 3).tolist()} {channel.unit}, from the base to the tip"
            change = f"subtract {np.round(off, 3).tolist()} {channel.unit}: the origin is the centre of the base plate"
            yield Suspicion("shifted frame", words, change, turned / before, "marker")


def _axes(turn: np.ndarray) -> str:
    """Which axis of the base frame each axis of the file is, where the turn (3, 3) is near such an exchange."""
    nearest = np.round(turn)
    if not np.allclose(np.abs(nearest).sum(axis=0), 1.0):
        vector = Rotation.from_matrix(turn * np.sign(np.linalg.det(turn))).as_rotvec()
        return f"rotation vector {np.round(np.degrees(vector)).tolist()} deg"
    named = ("x", "y", "z")
    said = []
    for row, axis in zip(nearest, named, strict=True):
        at = int(np.argmax(np.abs(row)))
        said.append(f"{axis} of the file is {'-' if row[at] < 0 else ''}{named[at]}")
    return ", ".join(said)
