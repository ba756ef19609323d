"""A parameter: value, unit, bounds, prior, source.

Values are SI everywhere inside the program; units as people write them are converted at the border (twin/units.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin.errors import DataError, TwinError, did_you_mean

Values = Mapping[str, float]
ABOVE = 5e-324  # the least number above zero

# With which powers of a robot's length and force quantities grow: weights are forces, times stay. Units not listed do not grow.
POWERS = {
    "m": (1, 0), "1/m": (-1, 0), "N": (0, 1), "kg": (0, 1), "N/s": (0, 1), "m/N": (1, -1), "N/m": (-1, 1), "N*m": (1, 1),
    "N*m*s/rad": (1, 1),
}  # fmt: skip


@dataclass(frozen=True)
class Size:
    """How long, and how strong, a robot is beside the one for which effects' numbers are written (`HingeChain.size`)."""

    length: float = 1.0
    force: float = 1.0

    def of(self, unit: str) -> float:
        """By how much a quantity in this SI unit is larger on such a robot, by dimensional analysis."""
        length, force = POWERS.get(unit, (0, 0))
        return self.length**length * self.force**force


@dataclass(frozen=True)
class Parameter:
    """One number of a robot or an effect.

    `value` is nominal for a robot and OFF for an effect; `low` and `high` are hard bounds; `std` is one standard
    deviation of what is believed beforehand (None: known exactly for a robot, unknown within bounds for an effect);
    `scale` is the size of a change worth looking at, used for derivatives and to start a fit; `written` the unit a robot's file
    gives it in.
    """

    name: str
    value: float
    unit: str
    low: float
    high: float
    source: str
    std: float | None = None
    scale: float | None = None
    written: str = ""

    def __post_init__(self) -> None:
        if not self.low <= self.value <= self.high:
            raise DataError(f"parameter {self.name}: value {self.value:g} lies outside its bounds [{self.low:g}, {self.high:g}]")
        if self.std is not None and not self.std > 0:
            raise DataError(f"parameter {self.name}: std must be positive, got {self.std:g}")

    def on(self, size: Size) -> Parameter:
        """The same of a robot of this size, where it is written for one of size 1."""
        by = size.of(self.unit)
        std, scale = (None if x is None else x * by for x in (self.std, self.scale))
        return replace(self, value=self.value * by, low=self.low * by, high=self.high * by, std=std, scale=scale)

    @property
    def anywhere(self) -> Parameter:
        """The same with the bounds of robots of any size: of what grows with them its sign."""
        if self.unit not in POWERS:
            return self
        low = -np.inf if self.low < 0.0 else ABOVE if self.low > 0.0 else 0.0
        return replace(self, low=low, high=np.inf)

    @property
    def step(self) -> float:
        """The size of a change worth looking at, in the parameter's unit."""
        if self.scale is not None:
            return self.scale
        return self.std if self.std is not None else 0.05 * (self.high - self.low)


@dataclass(frozen=True)
class Fitted:
    """A value with its standard error (None where the data did not fix it)."""

    value: float
    std: float | None
    unit: str


def overrides(parameters: Iterable[Parameter], values: Values) -> dict[str, float]:
    """All values of `parameters`, nominal where `values` says nothing. Raises TwinError for an unknown name or a broken bound."""
    table = {p.name: p for p in parameters}
    for name, value in values.items():
        if name not in table:
            raise TwinError(f"no parameter named {name!r}; available: {', '.join(sorted(table))}{did_you_mean(name, table)}")
        check_bounds(table[name], value)
    return {name: float(values.get(name, p.value)) for name, p in table.items()}


def check_bounds(parameter: Parameter, value: float) -> None:
    """Raises TwinError where `value` is not a finite number inside the parameter's bounds (to rounding)."""
    slack = 1e-9 * max((abs(b) for b in (parameter.low, parameter.high) if np.isfinite(b)), default=1.0)
    if not (np.isfinite(value) and parameter.low - slack <= value <= parameter.high + slack):
        end = {0.0: "0 or more", ABOVE: "more than 0", -np.inf: "any finite number"}
        both = f"[{parameter.low:g}, {parameter.high:g}]"
        allowed = end.get(parameter.low, both) if parameter.high == np.inf else both
        raise TwinError(f"parameter {parameter.name} = {value:g} {parameter.unit}: allowed is {allowed}")


def each(values: Values, name: str, *counts: int) -> np.ndarray:
    """The numbers (n,), or (n, m), ..., of a parameter that is described one by one, as name_1, name_2, ... (name_1_1, ... of a
    list of lists), or by one number for all, as name."""
    out = np.empty(counts)
    for index in np.ndindex(*counts):
        own = "_".join([name, *(str(k + 1) for k in index)])
        out[index] = values[own] if own in values else values[name]
    return out
