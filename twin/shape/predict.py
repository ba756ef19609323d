"""Estimate the shapes of a recording: named points of every trial, their uncertainty and the skin, in the base frame."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError
from twin.foundation.parallel import single_thread
from twin.measurements import Recording
from twin.mechanics.silicone.skin import Skin
from twin.mechanics.silicone.statics import rotation_about_z
from twin.shape.alignment.band_widening import UNKNOWN_CONTACT_WIDENING, BandWidening, widen_band
from twin.shape.alignment.drift_correction import correct_drift
from twin.shape.alignment.twin_check import twin_notices
from twin.shape.estimators.estimator import Estimator, SensorReadings, ShapeEstimates
from twin.shape.sensing import SensedTrial, read_sensors

NO_WIDENING = BandWidening()


def predict_shapes(
    recording: Recording, estimator: Estimator, bands: BandWidening = NO_WIDENING
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Estimate the shapes of all trials and return them as arrays, with notices for the reader: also of frames outside the training
    and of a twin that is not of this finger.

    Arrays of each trial: NAME_time (n,) s, NAME_vertices (n, P, 3) m, NAME_std (n, P) m, NAME_outside (n,) and NAME_cloud (n, M, 3)
    m. `bands` widens the bands where something may press.
    """
    sensed, notices = read_sensors(recording, estimator.twin)
    sensed, drift = correct_drift(sensed, [t.start for t in recording.trials], estimator.twin)
    with single_thread():
        doubts = twin_notices(sensed, estimator)
    arrays, skin = {}, SkinReconstruction(estimator)
    for trial in sensed:
        label = next(t.label for t in recording.trials if t.name == trial.name)
        with single_thread():
            shapes = estimator.estimate(trial_readings(trial, estimator))
        shapes = apply_band_widening(shapes, trial.contact, estimator, bands)
        turn = rotation_about_z(estimator.body.turn).T
        arrays |= {
            f"{label}_time": trial.time,
            f"{label}_vertices": (estimator.points.rest + shapes.displacements) @ turn,
            f"{label}_std": shapes.std,
            f"{label}_outside": shapes.outside,
            f"{label}_cloud": skin(shapes) @ turn,
        }
    return arrays, (*notices, *doubts, *_outside_notices(arrays), *drift)


def _outside_notices(arrays: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Return a notice of the frames that are outside, by trial."""
    flags = {name.removesuffix("_outside"): of for name, of in arrays.items() if name.endswith("_outside")}
    each = ", ".join(f"{name} {int(of.sum())} of {len(of)}" for name, of in flags.items() if of.any())
    return (
        (f"frames unlike all that the estimator was trained on, whose bands may not hold (NAME_outside): {each}",) if each else ()
    )


def apply_band_widening(shapes: ShapeEstimates, contact: str | None, estimator: Estimator, bands: BandWidening) -> ShapeEstimates:
    """Widen the band for the contact of the trial, and mark frames pressed by a contact unknown to the alignment as outside."""
    if contact is None:  # here `outside` marks frames in which the strains show a push
        pressed = UNKNOWN_CONTACT_WIDENING if bands.is_unknown(None) else 1.0
        return widen_band(shapes, np.where(shapes.outside, pressed, bands.free_factor(estimator)))
    unknown = bands.is_unknown(contact) & (True if shapes.pressed is None else shapes.pressed)
    return replace(widen_band(shapes, bands.factor(estimator, contact)), outside=shapes.outside | unknown)


def trial_readings(trial: SensedTrial, estimator: Estimator) -> SensorReadings:
    """Return the readings of a trial as the estimator's input."""
    return SensorReadings(trial.strain(estimator.body.cords), trial.displacement, trial.pushed, np.arange(len(trial.time)) > 0)


class SkinReconstruction:
    """The whole skin from the named points, through the nodal displacements that fit the points by least squares."""

    def __init__(self, estimator: Estimator) -> None:
        skin = Skin.of(estimator.body)
        self.rest = skin.rest
        self.weights = skin.weights
        self.inverse = np.linalg.pinv(estimator.body.lattice.weights(estimator.points.rest), rcond=1e-6)

    def __call__(self, shapes: ShapeEstimates) -> np.ndarray:
        """Return the skin (n, M, 3) m in the finger's own frame."""
        n, p = shapes.displacements.shape[:2]
        nodes = self.inverse @ shapes.displacements.transpose(1, 0, 2).reshape(p, -1)
        return self.rest + (self.weights @ nodes).reshape(-1, n, 3).transpose(1, 0, 2)


def write_shapes(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write the arrays, whole or not at all. Raises DataError where the folder is missing."""
    if not path.absolute().parent.is_dir():
        raise DataError(f"{path.absolute().parent} is no folder; make it, or give another file with --out")
    write_atomically(path, lambda file: np.savez_compressed(file, **arrays))  # type: ignore[arg-type]
