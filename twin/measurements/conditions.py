"""Conditions of a trial: those the twin understands, in SI, and the others, kept by name."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from twin.errors import DataError, did_you_mean, shown
from twin.measurements.files import located
from twin.measurements.quantity_strings import quantity, vector

SCALARS = {"tip_payload": "kg", "ambient_temperature": "K"}
VECTORS = {"gravity": "m/s^2", "tip_force": "N"}  # base frame
LARGEST = {
    "tip_payload": 100.0,
    "ambient_temperature": 1000.0,
    "gravity": 50.0,
    "tip_force": 1e4,
}  # SI: what robots meet, with room
_TRIAL_KEYS = ("file", "start", "cloud")  # what a [[trial]] says besides its conditions


def read_conditions(trial: Mapping[str, object]) -> tuple[dict[str, float | np.ndarray], dict[str, object]]:
    """Understood conditions in SI, and the others as written, of one [[trial]] table.

    Raises DataError, naming the condition, for a wrong dimension, an unreadable quantity, a negative mass or temperature, and
    a name that is almost one of these.
    """
    known: dict[str, float | np.ndarray] = {}
    other: dict[str, object] = {}
    for name, written in trial.items():
        with located(name):
            if name in SCALARS:
                known[name] = quantity(written, SCALARS[name])
                if known[name] < 0.0:
                    raise DataError(f"{shown(written)} is below zero {SCALARS[name]}; write what was really there")
            elif name in VECTORS:
                known[name] = vector(written, VECTORS[name])
            elif name not in _TRIAL_KEYS:
                if close := did_you_mean(name, (*SCALARS, *VECTORS, *_TRIAL_KEYS)):
                    raise DataError(f"no such condition{close} A name of your own must differ more")
                other[name] = written
            if name in known and not np.all(np.abs(known[name]) <= LARGEST[name]):
                unit = SCALARS.get(name) or VECTORS[name]
                raise DataError(f"{shown(written)} is not plausible; at most {LARGEST[name]:g} {unit}")
    return known, other
