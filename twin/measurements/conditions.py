"""Conditions of a trial: known ones in SI, other ones as written."""

from collections.abc import Mapping

import numpy as np

from twin.foundation.errors import DataError, did_you_mean, short_repr
from twin.foundation.files import prefix_errors
from twin.measurements.parsing.quantity_strings import parse_quantity, parse_vector

SCALAR_CONDITIONS = {"tip_payload": "kg", "ambient_temperature": "K", "settle": "s"}
VECTOR_CONDITIONS = {"gravity": "m/s^2", "tip_force": "N"}  # base frame
PAYLOAD_AT = "payload."  # before the name of a site or body: the condition of a mass (kg) that hangs there
MAX_CONDITION = {
    "tip_payload": 100.0, "ambient_temperature": 1000.0, "gravity": 50.0, "tip_force": 1e4, "settle": 600.0,
}  # fmt: skip  # SI, plausible at most
_TRIAL_KEYS = ("file", "start", "cloud")  # keys of a [[trial]] that are no conditions


def read_conditions(trial: Mapping[str, object]) -> tuple[dict[str, float | np.ndarray], dict[str, object]]:
    """Return the known conditions of a [[trial]] table in SI, and the other ones as written.

    Raises DataError, naming the condition, for a wrong dimension, an unreadable quantity, a negative mass or temperature, and a
    name that is almost a known one.
    """
    known: dict[str, float | np.ndarray] = {}
    other: dict[str, object] = {}
    for name, written in trial.items():
        with prefix_errors(name):
            if name in SCALAR_CONDITIONS:
                known[name] = parse_quantity(written, SCALAR_CONDITIONS[name])
                if known[name] < 0.0:
                    raise DataError(f"{short_repr(written)} is below zero {SCALAR_CONDITIONS[name]}; write the true value")
            elif name in VECTOR_CONDITIONS:
                known[name] = parse_vector(written, VECTOR_CONDITIONS[name])
            elif name == "payload" and isinstance(written, Mapping):
                known |= {PAYLOAD_AT + at: _mass(at, mass) for at, mass in written.items()}
            elif name not in _TRIAL_KEYS:
                if close := did_you_mean(name, (*SCALAR_CONDITIONS, *VECTOR_CONDITIONS, *_TRIAL_KEYS)):
                    raise DataError(f"no such condition{close} A name of your own must differ more")
                other[name] = written
            if name in known and not np.all(np.abs(known[name]) <= MAX_CONDITION[name]):
                unit = SCALAR_CONDITIONS.get(name) or VECTOR_CONDITIONS[name]
                raise DataError(f"{short_repr(written)} is not plausible; at most {MAX_CONDITION[name]:g} {unit}")
    return known, other


def _mass(at: str, written: object) -> float:
    """Return a mass (kg) that hangs at a site. Raises DataError for what is none."""
    with prefix_errors(at):
        mass = parse_quantity(written, "kg")
        if not 0.0 <= mass <= MAX_CONDITION["tip_payload"]:
            raise DataError(f"{short_repr(written)} is not plausible; allowed is 0 to {MAX_CONDITION['tip_payload']:g} kg")
        return mass
