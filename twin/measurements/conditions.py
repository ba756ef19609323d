"""Conditions of a trial: those the twin understands, in SI, and the others, kept by name."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from twin.errors import DataError
from twin.measurements.files import located
from twin.measurements.quantity_strings import quantity, vector

SCALARS = {"tip_payload": "kg", "ambient_temperature": "K"}  # never negative
VECTORS = {"gravity": "m/s^2", "tip_force": "N"}  # base frame
_TRIAL_KEYS = ("file", "start", "cloud")  # what a [[trial]] says besides its conditions


def read_conditions(trial: Mapping[str, object]) -> tuple[dict[str, float | np.ndarray], dict[str, object]]:
    """Understood conditions in SI, and the others as written, of one [[trial]] table.

    Raises DataError, naming the condition, for a wrong dimension, an unreadable quantity and a negative mass or temperature.
    """
    known: dict[str, float | np.ndarray] = {}
    other: dict[str, object] = {}
    for name, written in trial.items():
        with located(name):
            if name in SCALARS:
                known[name] = quantity(written, SCALARS[name])
                if known[name] < 0.0:
                    raise DataError(f"{written!r} is below zero {SCALARS[name]}; write what was really there")
            elif name in VECTORS:
                known[name] = vector(written, VECTORS[name])
            elif name not in _TRIAL_KEYS:
                other[name] = written
    return known, other
