"""Correct drift of the sensors since their alignment, from trials in free motion, for drift of any course in time.

Without contact, tendons give the strains (`tendon_strains.py`), and so the resistances of the aligned sensors. In a free trial k

    g_k = median over its samples of log(R / R_tendons),      sensor by sensor

is drift where it is one factor for the whole trial: with it corrected, tendons explain half of the samples or more. An undeclared
push is no such factor, and its trial is not used. Drift is taken for a random walk: between the trials used its mean is a straight
line in time, before the first and after the last it stays. A twin with an effect on more than its sensors is not corrected: the
strains are those of the finger as described.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twin.body.strain_cords import Cords, resistance, strain
from twin.foundation.errors import DataError
from twin.prediction.twin import Twin
from twin.shape.estimators.modal import ModalNetwork
from twin.shape.estimators.tendon_strains import TendonStrainNetwork, largest_deviation
from twin.shape.sensing import SensedTrial, sensing_finger

SMALLEST_DRIFT = 0.005  # of log R: sensors without drift show 0.0017 at most (four days of two simulators)
EXPLAINED_DEVIATION = 6.0  # standard deviations of the strains; half of the samples must deviate less


def correct_drift(
    trials: Sequence[SensedTrial], starts: Sequence[float | None], twin: Twin
) -> tuple[tuple[SensedTrial, ...], tuple[str, ...]]:
    """Return the trials with drift corrected, and notices. `starts` (s) on the day's clock, by order where one is unknown."""
    if any(effect.acts_on_robot for effect in twin.effects):
        return tuple(trials), ()  # its tendons make other strains than the network learned
    try:
        tendon_strains, cords = ModalNetwork.of(twin.robot).tendon_strains, sensing_finger(twin).cords
    except DataError:  # a robot without these weights
        return tuple(trials), ()
    clock = [float(k) if None in starts else float(s or 0.0) for k, s in enumerate(starts)]
    drift_at = [
        (t, g) for t, trial in zip(clock, trials, strict=True) if (g := _estimate_drift(trial, tendon_strains, cords)) is not None
    ]
    if not drift_at:
        return tuple(trials), ()
    times, drifts = np.array([t for t, _ in drift_at]), np.stack([g for _, g in drift_at])
    order = np.argsort(times)
    times, drifts = times[order], drifts[order]
    drifts[:, np.abs(drifts).max(axis=0) < SMALLEST_DRIFT] = 0.0
    if not drifts.any():
        return tuple(trials), ()
    at = np.stack([np.interp(clock, times, g) for g in drifts.T], axis=1)
    corrected = tuple(replace(t, resistance=t.resistance * np.exp(-g)) for t, g in zip(trials, at, strict=True))
    most = ", ".join(f"{100 * np.expm1(g[np.abs(g).argmax()]):+.1f} %" for g in drifts.T)
    return corrected, (f"in free motion the sensors read other resistances than at alignment, by up to {most}: drift, undone",)


def _estimate_drift(trial: SensedTrial, tendon_strains: TendonStrainNetwork, cords: Cords) -> np.ndarray | None:
    """Return the log factor (s,) of each sensor in a trial without contact, 0 where it is dead; None where it is no drift."""
    if trial.pushed:
        return None
    strains = tendon_strains(trial.displacement)
    log_ratio = np.log(trial.resistance / resistance(strains, cords))
    alive = np.isfinite(log_ratio).any(axis=0)
    g = np.zeros(log_ratio.shape[1])
    g[alive] = np.nanmedian(log_ratio[:, alive], axis=0)
    deviation = largest_deviation(strains, strain(trial.resistance * np.exp(-g), cords))
    return g if np.median(deviation) < EXPLAINED_DEVIATION else None
