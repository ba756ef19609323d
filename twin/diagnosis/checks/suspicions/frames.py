"""Frames of positions and orientations: mirrored, turned by a quarter or a half, shifted; orientations the other way round."""

from collections.abc import Iterator
from itertools import permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from twin.diagnosis.checks.suspicions.case import Case, Suspicion, registration, rms
from twin.diagnosis.thresholds import LARGEST_CAMERA_SHIFT, LARGEST_CAMERA_TURN, LEFT_BY_FILE_CHANGE


def frame(case: Case) -> Iterator[Suspicion]:
    """Yield the rigid motion, mirrored or not, that brings the predicted markers onto the measured ones."""
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
    error = min(before, case.motion(columns.ravel().tolist()))
    if mirrored < LEFT_BY_FILE_CHANGE * min(error, turned):
        change = f"export the markers in the right-handed base frame: {_axes(flip)} (or check which tendon is which)"
        yield Suspicion("mirrored frame", f"the markers move as in a mirror: {_axes(flip)}", change, mirrored / before, "marker")
    elif turned < LEFT_BY_FILE_CHANGE * error:
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


def orientations(case: Case) -> Iterator[Suspicion]:
    """Yield orientations that fit with the axes of their rotation vectors r exchanged or reversed.

    In other axes, M of those declared, R becomes M R M' and r becomes det(M) M r, where M may be a mirror. Of the inverse rotation
    r becomes -r. What turns about two axes alone does not tell these causes apart.
    """
    for body in dict.fromkeys(o.index for o in case.prepared.outputs if o.group == "turn") if case.predicted else ():
        columns = [j for j, o in enumerate(case.prepared.outputs) if o.group == "turn" and o.index == body]
        y, p = (np.concatenate([v[k][:, columns] for k in case.trials]) for v in (case.prepared.measured, case.predicted or ()))
        errors = [(rms(y - p @ P.T), P) for P in _exchanges()]
        enough = min(error for error, _ in errors) + case.floor(columns)
        # of those that fit alike the one that changes least: a body that hardly turns about an axis says nothing of its sign
        error, P = min((e for e in errors if e[0] <= enough), key=lambda e: np.abs(e[1] - np.eye(3)).sum())
        left = None if np.array_equal(P, np.eye(3)) else case.better(rms(y - p), error, columns)
        if left is not None:
            name = case.prepared.outputs[columns[0]].channel.name.removesuffix("_turn")
            words = f"{name} turns about other axes than the robot as described would: {_axes(P)}"
            change = (
                f"write the orientation of {name} in the right-handed base frame, as the rotation that turns the base's axes into "
                f"its own (not the inverse): {_axes(P)} of its rotation vector"
            )
            yield Suspicion("orientation", words, change, left, "turn")


def _exchanges() -> list[np.ndarray]:
    """Return the 48 exchanges of axes and signs (3, 3), as they are first."""
    return [np.diag(s) @ np.eye(3)[list(order)] for s in product((1.0, -1.0), repeat=3) for order in permutations(range(3))]


def _axes(turn: np.ndarray) -> str:
    """Return which axis of the base frame each axis of the file is, where the turn (3, 3) is near such an exchange."""
    nearest = np.round(turn)
    if not np.allclose(np.abs(nearest).sum(axis=0), 1.0):
        vector = Rotation.from_matrix(turn * np.sign(np.linalg.det(turn))).as_rotvec()
        return f"rotation vector {np.round(np.degrees(vector)).tolist()} deg"
    named = ("x", "y", "z")
    axes = []
    for row, axis in zip(nearest, named, strict=True):
        at = int(np.argmax(np.abs(row)))
        axes.append(f"{axis} of the file is {'-' if row[at] < 0 else ''}{named[at]}")
    return ", ".join(axes)
