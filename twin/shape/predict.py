"""A recording's shapes as a file: every trial's named points, their uncertainty and the skin, in the base frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from twin.errors import DataError
from twin.measurements import Recording
from twin.shape.band import STRANGER, Bands, widened
from twin.shape.drift import steadied
from twin.shape.estimator import Estimator, Felt, Shapes
from twin.shape.sensing import Sensed, sense
from twin.soft.skin import Skin
from twin.soft.statics import turned
from twin.threads import single_thread

PLAIN = Bands()


def predict(recording: Recording, estimator: Estimator, bands: Bands = PLAIN) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """NAME_time (n,) s, NAME_vertices (n, P, 3) m, NAME_std (n, P) m, NAME_outside (n,) and NAME_cloud (n, M, 3) m of each trial,
    and what a reader should know. `bands`: how wide they are to be where something may press."""
    sensed, notices = sense(recording, estimator.twin)
    sensed, drift = steadied(sensed, [t.start for t in recording.trials], estimator.twin)
    arrays, skin = {}, SkinOf(estimator)
    for trial in sensed:
        label = next(t.label for t in recording.trials if t.name == trial.name)
        with single_thread():
            shapes = estimator.estimate(felt(trial, estimator))
        shapes = judged(shapes, trial.contact, estimator, bands)
        turn = turned(estimator.body.turn).T
        arrays |= {
            f"{label}_time": trial.time,
            f"{label}_vertices": (estimator.points.rest + shapes.moved) @ turn,
            f"{label}_std": shapes.std,
            f"{label}_outside": shapes.outside,
            f"{label}_cloud": skin(shapes) @ turn,
        }
    return arrays, (*notices, *drift)


def judged(shapes: Shapes, contact: str | None, law: Estimator, bands: Bands) -> Shapes:
    """With the band that goes with what pushes; a frame where something presses that pushed in no alignment is outside."""
    if contact is None:  # frames marked as outside are those where strains say that something presses
        return widened(shapes, np.where(shapes.outside & bands.strange(None), STRANGER, 1.0))
    strange = bands.strange(contact) & (True if shapes.pressed is None else shapes.pressed)
    return replace(widened(shapes, bands.of(law, contact)), outside=shapes.outside | strange)


def felt(trial: Sensed, estimator: Estimator) -> Felt:
    return Felt(trial.strain(estimator.body.cords), trial.displacement, trial.pushed, np.arange(len(trial.time)) > 0)


class SkinOf:
    """The whole skin from the named points: the nodes that move the points so, by least squares, move it."""

    def __init__(self, estimator: Estimator) -> None:
        skin = Skin.of(estimator.body)
        self.rest = skin.rest
        self.weights = skin.weights
        self.inverse = np.linalg.pinv(estimator.body.lattice.weights(estimator.points.rest), rcond=1e-6)

    def __call__(self, shapes: Shapes) -> np.ndarray:
        """(n, M, 3) m in the finger's own frame."""
        n, p = shapes.moved.shape[:2]
        nodes = self.inverse @ shapes.moved.transpose(1, 0, 2).reshape(p, -1)
        return self.rest + (self.weights @ nodes).reshape(-1, n, 3).transpose(1, 0, 2)


def write(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Whole or not at all: to a neighbour first, then renamed. Raises DataError where nothing can be written."""
    if not path.absolute().parent.is_dir():
        raise DataError(f"{path.absolute().parent} is no folder; make it, or give another file with --out")
    part = path.with_name(path.name + ".part")
    with part.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    part.replace(path)
