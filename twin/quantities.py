"""A parameter: value, unit, bounds, prior, source.

Values are SI everywhere inside the program. Units as people write them are converted here, at the border, by pint.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from twin.errors import DataError, TwinError

if TYPE_CHECKING:
    import pint

Values = Mapping[str, float]


@cache
def unit_registry() -> pint.UnitRegistry:
    """The one pint registry of the program, loaded at first use."""
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


@cache
def si_factor(unit: str, where: str) -> float:
    """Factor from `unit` to its SI base unit, for quantities without an offset.

    Raises DataError, naming `where`, for a unit pint does not know.
    """
    import pint

    try:
        return float(unit_registry().Quantity(1.0, unit).to_base_units().magnitude)
    except (pint.errors.PintError, AttributeError, TypeError, ValueError) as error:
        raise DataError(f"{where}: unknown unit {unit!r} ({error}); write one that pint knows, e.g. 'mm', 'GPa', '1'") from None


SI_UNITS = (
    "1",
    "m",
    "kg",
    "s",
    "N",
    "Pa",
    "K",
    "A",
    "V",
    "ohm",
    "N*m",
    "m/s^2",
    "1/m",
    "N/m",
    "N/s",
    "J/K",
    "W/K",
    "W/K^2",
    "W/K^3",
    "W/(K*m)",
    "W/(K*m^2)",
    "W/(K^2*m)",
    "N/K",
    "kg/m^3",
    "1/K",
    "1/N",
    "1/s",
    "m/N",
)


@cache
def si_unit(unit: str, where: str) -> str:
    """The SI unit a value in `unit` is kept in: "GPa" -> "Pa", "deg" -> "rad". Raises DataError for one the twin does not use."""
    si_factor(unit, where)
    if unit.startswith(("deg", "rad")):
        return "rad"
    registry = unit_registry()
    for si in SI_UNITS:
        if registry.Unit(si).dimensionality == registry.Unit(unit).dimensionality:
            return si
    raise DataError(f"{where}: unit {unit!r} is none the twin uses; it must be convertible to one of {', '.join(SI_UNITS)}, rad")


@dataclass(frozen=True)
class Parameter:
    """One number of a robot or an effect.

    `value` is nominal for a robot and OFF for an effect; `low` and `high` are hard bounds; `std` is one standard
    deviation of what is believed beforehand (None: known exactly for a robot, unknown within bounds for an effect);
    `scale` is the size of a change worth looking at, used for derivatives and to start a fit.
    """

    name: str
    value: float
    unit: str
    low: float
    high: float
    source: str
    std: float | None = None
    scale: float | None = None

    def __post_init__(self) -> None:
        if not self.low <= self.value <= self.high:
            raise DataError(f"parameter {self.name}: value {self.value:g} lies outside its bounds [{self.low:g}, {self.high:g}]")
        if self.std is not None and not self.std > 0:
            raise DataError(f"parameter {self.name}: std must be positive, got {self.std:g}")

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
            raise TwinError(f"no parameter named {name!r}; available: {', '.join(sorted(table))}")
        check_bounds(table[name], value)
    return {name: float(values.get(name, p.value)) for name, p in table.items()}


def check_bounds(parameter: Parameter, value: float) -> None:
    """Raises TwinError where `value` is not a finite number inside the parameter's bounds (to rounding)."""
    slack = 1e-9 * max(1.0, abs(parameter.low), abs(parameter.high))
    if not (np.isfinite(value) and parameter.low - slack <= value <= parameter.high + slack):
        raise TwinError(
            f"parameter {parameter.name} = {value:g} {parameter.unit}: allowed is [{parameter.low:g}, {parameter.high:g}]"
        )
