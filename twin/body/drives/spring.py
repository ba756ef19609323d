"""The parameters of the SMA springs that drive a robot, one array entry a spring."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from twin.foundation.errors import DataError


class Spring(NamedTuple):
    """Springs, SI, (n_spring,) each. Temperatures are absolute; forces and slopes are those of the whole spring."""

    resistance: np.ndarray  # ohm
    capacity: np.ndarray  # J/K
    coils: np.ndarray  # number
    loss: np.ndarray  # W/K, of a closed spring at ambient
    loss_warm: np.ndarray  # W/K^2, per kelvin above ambient
    loss_warm_2: np.ndarray  # W/K^3, per kelvin squared
    loss_open: np.ndarray  # W/(K m), per metre of elongation a coil
    loss_open_2: np.ndarray  # W/(K m^2)
    loss_warm_open: np.ndarray  # W/(K^2 m)
    martensite_start: np.ndarray  # K, unstressed
    martensite_finish: np.ndarray  # K
    austenite_start: np.ndarray  # K
    austenite_finish: np.ndarray  # K
    force_per_kelvin: np.ndarray  # N/K, rise of the transformation forces with temperature
    austenite_stiffness: np.ndarray  # N/m
    martensite_stiffness: np.ndarray  # N/m
    detwinning_start: np.ndarray  # N, of the cold spring's plateau
    detwinning_finish: np.ndarray  # N
    transformation_elongation: np.ndarray  # m
    initial_elongation: np.ndarray  # m, on the straight robot
    initial_tension: np.ndarray  # N
    loss_surroundings: np.ndarray  # 1/K, relative change of the loss per kelvin of the surroundings above 23 degC

    @property
    def records(self) -> np.ndarray:
        """(n_spring,) one record a spring, with the same fields: compiled code takes one array in a fraction of the time."""
        out = np.empty(len(self.capacity), _RECORD)
        for name, value in zip(self._fields, self, strict=True):
            out[name] = value
        return out


_RECORD = np.dtype([(name, float) for name in Spring._fields])
SPRING_UNITS = {
    "resistance": "ohm", "capacity": "J/K", "coils": "1", "loss": "W/K", "loss_warm": "W/K^2", "loss_warm_2": "W/K^3",
    "loss_open": "W/(K*m)", "loss_open_2": "W/(K*m^2)", "loss_warm_open": "W/(K^2*m)", "martensite_start": "K",
    "martensite_finish": "K", "austenite_start": "K", "austenite_finish": "K", "force_per_kelvin": "N/K",
    "austenite_stiffness": "N/m", "martensite_stiffness": "N/m", "detwinning_start": "N", "detwinning_finish": "N",
    "transformation_elongation": "m", "initial_elongation": "m", "initial_tension": "N",
}  # fmt: skip
SPRING_PREFIX = "springs."
SPRING_PARAMETERS = {
    SPRING_PREFIX + name: unit for name, unit in SPRING_UNITS.items()
}  # of a robot driven by springs, with their SI units


def build_springs(values: Mapping[str, float], n: int) -> Spring:
    """Return n equal springs from a robot's parameters (SI by name). Raises DataError if some are missing."""
    if missing := sorted(set(SPRING_PARAMETERS) - set(values)):
        raise DataError(
            f"the robot has no SMA springs to be heated by currents: parameter {missing[0]!r} is missing in its robot.toml; "
            "describe its springs there, or drive it by tensions or displacements"
        )
    numbers = {name: np.full(n, float(values[SPRING_PREFIX + name])) for name in SPRING_UNITS}
    return Spring(**numbers, loss_surroundings=np.zeros(n))


def placeholder_springs(n: int) -> Spring:
    """Return n placeholders for tendons without springs."""
    return Spring(*(np.ones(n) for _ in Spring._fields))
