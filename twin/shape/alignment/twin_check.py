"""Check that a twin is of the finger that was measured: from its numbers, and from the strains of free motion.

Without contact tendons make the strains. A twin of another finger reads other strains from the same resistances: its R0 and kappa
are not this finger's. The doubt is how far apart (m) the shapes of the two lie, as an estimator takes them where something may
press and the strains alone tell the shape. An undeclared push makes the same difference, so the trial that fits best counts.
"""

from collections.abc import Sequence

import numpy as np

from twin.foundation.errors import DataError
from twin.prediction.twin import Twin
from twin.shape.alignment.sensor_fit import SENSOR_PARAMETERS
from twin.shape.estimators.estimator import Estimator, SensorReadings
from twin.shape.estimators.modal import ModalNetwork
from twin.shape.sensing import SensedTrial

TOLD_BY_STRAIN = 0.01  # of a trial's strains the largest must reach this
# m: aligned twins show 0.11 mm at most (`physics` 0.13), those of other fingers 0.30 mm and more on seven days
ACCEPTED_DOUBT = 2e-4
FRAME_COUNT = 40  # of a trial, evenly spread


def is_aligned(twin: Twin) -> bool:
    """Return whether numbers of the sensors were fitted that robots of this kind differ in; True where they do not differ."""
    names = {p.name for p in twin.robot.nuisance if p.name.startswith(tuple(f"sensors.{name}_" for name in SENSOR_PARAMETERS))}
    return not names or not names.isdisjoint(twin.values)


def twin_notices(trials: Sequence[SensedTrial], estimator: Estimator) -> tuple[str, ...]:
    """Return a notice where the twin was never aligned, or where it does not fit the strains of trials in free motion."""
    doubt = strain_doubt(trials, estimator) or 0.0
    doubted = doubt > ACCEPTED_DOUBT
    size = f"strains of free motion put points {1e3 * doubt:.1f} mm off those of the tendons" if doubted else ""
    if not is_aligned(estimator.twin):
        return (
            "the twin was never aligned: mounting angle, R0 and kappa are as described, from which a finger differs; points "
            f"may be millimetres off and outside their bands{'; ' + size if size else ''}; run twin align on a set with clouds",
        )
    if doubted:
        return (
            f"{size}: the twin is of another finger, its sensors have changed, or something pressed undeclared; run twin align on "
            "clouds of this finger",
        )
    return ()


def strain_doubt(trials: Sequence[SensedTrial], estimator: Estimator) -> float | None:
    """Return the distance (m) between shapes by measured strains and by those that tendons make: the mean over points, the median
    over frames, of the trial in free motion that fits best. None where no such trial moves the sensors."""
    if any(effect.acts_on_robot for effect in estimator.twin.effects):
        return None  # its tendons make other strains than the network learned
    try:
        tendon_strains = ModalNetwork.of(estimator.twin.robot).tendon_strains
    except DataError:  # a robot without these weights
        return None
    doubts = []
    for trial in trials:
        rows = np.unique(np.linspace(0, len(trial.time) - 1, FRAME_COUNT).round().astype(int))
        displacement = trial.displacement[rows]
        made, measured = tendon_strains(displacement), trial.strain(estimator.body.cords)[rows]
        if trial.pushed or np.abs(made).max() < TOLD_BY_STRAIN:
            continue
        made = np.where(np.isfinite(measured), made, np.nan)
        one, other = (estimator.estimate(SensorReadings(eps, displacement)).displacements for eps in (made, measured))
        doubts.append(float(np.median(np.linalg.norm(one - other, axis=2).mean(axis=1))))
    return min(doubts, default=None)
