"""Parameters: value, unit, bounds, prior and source.

Values are SI everywhere inside the program; files are converted on reading and writing (twin/foundation/units.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin.foundation.errors import DataError, TwinError, did_you_mean

Values = Mapping[str, float]
SMALLEST_POSITIVE = 5e-324  # the least number above zero

# Powers of a robot's length and force with which a quantity of this unit grows. Weights are forces; units not listed do not grow.
SIZE_EXPONENTS = {
    "m": (1, 0), "1/m": (-1, 0), "N": (0, 1), "kg": (0, 1), "N/s": (0, 1), "m/N": (1, -1), "N/m": (-1, 1), "N*m": (1, 1),
    "N*m*s/rad": (1, 1), "rad/(N*m)": (-1, -1), "N*m/rad": (1, 1), "kg*m^2": (2, 1),
}  # fmt: skip


@dataclass(frozen=True)
class Size:
    """A robot's length and force relative to the reference robot, for which effects' numbers are written (`HingeChain.size`)."""

    length: float = 1.0
    force: float = 1.0

    def factor(self, unit: str) -> float:
        """Return the factor by which a quantity of this SI unit is larger on such a robot, by dimensional analysis."""
        length, force = SIZE_EXPONENTS.get(unit, (0, 0))
        return self.length**length * self.force**force


@dataclass(frozen=True)
class Parameter:
    """One number of a robot or an effect.

    `value` is nominal for a robot and OFF for an effect. `low` and `high` are hard bounds. `std` is the prior standard deviation
    (None: known exactly for a robot, unknown within bounds for an effect). `scale` is the size of a noticeable change, used for
    derivatives and to start a fit. `file_unit` is the unit used in a robot's file.
    """

    name: str
    value: float
    unit: str
    low: float
    high: float
    source: str
    std: float | None = None
    scale: float | None = None
    file_unit: str = ""

    def __post_init__(self) -> None:
        if not self.low <= self.value <= self.high:
            raise DataError(f"parameter {self.name}: value {self.value:g} lies outside its bounds [{self.low:g}, {self.high:g}]")
        if self.std is not None and not self.std > 0:
            raise DataError(f"parameter {self.name}: std must be positive, got {self.std:g}")

    def scaled_to(self, size: Size) -> Parameter:
        """Return this parameter, written for the reference robot, for a robot of this size."""
        by = size.factor(self.unit)
        std, scale = (None if x is None else x * by for x in (self.std, self.scale))
        return replace(self, value=self.value * by, low=self.low * by, high=self.high * by, std=std, scale=scale)

    @property
    def without_size_bounds(self) -> Parameter:
        """The parameter with bounds for robots of any size: a quantity that grows with size is bounded by its sign only."""
        if self.unit not in SIZE_EXPONENTS:
            return self
        low = -np.inf if self.low < 0.0 else SMALLEST_POSITIVE if self.low > 0.0 else 0.0
        return replace(self, low=low, high=np.inf)

    @property
    def step(self) -> float:
        """The size of a noticeable change, in the parameter's unit."""
        if self.scale is not None:
            return self.scale
        return self.std if self.std is not None else 0.05 * (self.high - self.low)


@dataclass(frozen=True)
class FittedValue:
    """A fitted value with its standard error (None where the data did not determine it)."""

    value: float
    std: float | None
    unit: str


def fill_defaults(parameters: Iterable[Parameter], values: Values) -> dict[str, float]:
    """Return values of all parameters, nominal where `values` has none. Raises TwinError for an unknown name or a broken bound."""
    table = {p.name: p for p in parameters}
    for name, value in values.items():
        if name not in table:
            raise TwinError(f"no parameter named {name!r}; available: {', '.join(sorted(table))}{did_you_mean(name, table)}")
        check_bounds(table[name], value)
    return {name: float(values.get(name, p.value)) for name, p in table.items()}


def check_bounds(parameter: Parameter, value: float) -> None:
    """Raise TwinError unless `value` is a finite number inside the parameter's bounds (to rounding)."""
    slack = 1e-9 * max((abs(b) for b in (parameter.low, parameter.high) if np.isfinite(b)), default=1.0)
    if not (np.isfinite(value) and parameter.low - slack <= value <= parameter.high + slack):
        end = {0.0: "0 or more", SMALLEST_POSITIVE: "more than 0", -np.inf: "any finite number"}
        both = f"[{parameter.low:g}, {parameter.high:g}]"
        allowed = end.get(parameter.low, both) if parameter.high == np.inf else both
        raise TwinError(f"parameter {parameter.name} = {value:g} {parameter.unit}: allowed is {allowed}")


def parameter_array(values: Values, name: str, *counts: int) -> np.ndarray:
    """Return an array of shape `counts` from name_1, name_2, ... (name_1_1, ... of a list of lists), or from `name` for all."""
    out = np.empty(counts)
    for index in np.ndindex(*counts):
        own = "_".join([name, *(str(k + 1) for k in index)])
        out[index] = values[own] if own in values else values[name]
    return out
