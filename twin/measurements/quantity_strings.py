"""Units as people write them, turned into SI and back: the one place where pint is used.

A reading y in the declared unit is x = factor y + offset in SI. The offset is zero but for degC and degF; noise is a
difference and takes the factor alone.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.errors import DataError

if TYPE_CHECKING:
    import pint

# SI unit of everything a measurement set may hold -> what a user would write.
EXAMPLES = {
    "N": "N, mN, gf", "m": "m, mm", "A": "A, mA", "V": "V, mV", "K": "K, degC", "ohm": "ohm, kohm",
    "rad": "rad, deg", "N*m": "N*m, mN*m", "kg": "kg, g", "m/s^2": "m/s^2",
}  # fmt: skip
_LONGEST = 200  # characters of a quantity string
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?)\s*(.*)", re.DOTALL)
_UNIT_CHARACTERS = re.compile(r"[A-Za-zµμΩ\u2126°·_*/^(). 0-9-]{1,60}")
# Towers of powers would keep pint busy for ever: an exponent is one or two digits on a name, and nothing sits on top of it.
_POWER_TOWER = re.compile(r"\d{3}|(?:\*\*|\^)\s*-?\s*(?!\d)|\)\s*(?:\*\*|\^)|(?:\*\*|\^)[\s\d-]*(?:\*\*|\^)")


@dataclass(frozen=True)
class Scale:
    """Declared unit to SI: x = numerator / denominator y + offset. A mm is 1 / 1000 m, so that 12.3 mm is exactly 0.0123 m."""

    numerator: float
    denominator: float
    offset: float

    def difference(self) -> Scale:
        """The scale of differences, such as noise: no offset."""
        return Scale(self.numerator, self.denominator, 0.0)

    def to_si(self, declared: Any) -> Any:
        """Readings in the declared unit, any shape -> SI."""
        with np.errstate(over="ignore"):
            return declared * self.numerator / self.denominator + self.offset

    def from_si(self, si: np.ndarray) -> np.ndarray:
        """SI values (n,) -> declared unit, chosen among the nearest floats so that `to_si` gives the same bits where it can."""
        if self == Scale(1.0, 1.0, 0.0):
            return si
        plain = (si - self.offset) * self.denominator / self.numerator
        tidy = np.array([float(f"{value:.12g}") for value in plain])  # 12.3 rather than 12.300000000000001
        candidates = (tidy, plain, np.nextafter(plain, np.inf), np.nextafter(plain, -np.inf))
        result, settled = plain.copy(), np.zeros(plain.shape, bool)
        for candidate in candidates:
            exact = ~settled & (self.to_si(candidate) == si)
            result[exact] = candidate[exact]
            settled |= exact
        return result


@cache
def _registry() -> pint.UnitRegistry:
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=1024)
def unit_scale(unit: str, si_unit: str) -> Scale:
    """How `unit` becomes `si_unit`.

    Raises DataError for a unit pint does not know and for one of another dimension.
    """
    way_out = f"; allowed is any unit like {EXAMPLES[si_unit]}"
    text = unit.strip().replace("²", "**2").replace("³", "**3")
    if not _UNIT_CHARACTERS.fullmatch(text) or _POWER_TOWER.search(text) or "delta" in text:
        raise DataError(f"{shown(unit)} is not a unit{way_out}")
    registry = _registry()
    try:
        parsed = registry.parse_units(text)
        zero, one = registry.Quantity(0.0, parsed), registry.Quantity(1.0, parsed)
        # Root units, not dimensions: pint calls angles, counts and percent all dimensionless.
        fits = one.to_root_units().units == registry.Quantity(1.0, si_unit).to_root_units().units
        factor, offset = (float((one - zero).to(si_unit).magnitude), float(zero.to(si_unit).magnitude)) if fits else (0.0, 0.0)
    except Exception:  # pint answers odd text with AttributeError, ValueError, AssertionError, TokenError and more
        raise DataError(f"unknown unit {shown(unit)}{way_out}") from None
    if not fits:
        raise DataError(f"unit {shown(unit)} has the wrong dimension{way_out}")
    if not (1e-30 < factor < 1e30 and math.isfinite(offset)):
        raise DataError(f"unit {shown(unit)} has no sensible size in {si_unit}{way_out}")
    parts = round(1.0 / factor)
    if parts > 1 and math.isclose(parts * factor, 1.0, rel_tol=1e-12):
        return Scale(1.0, float(parts), offset)
    return Scale(factor, 1.0, offset)


def quantity(value: object, si_unit: str) -> float:
    """A quantity string such as "10 g" or "23 degC" -> its SI value.

    Raises DataError for anything but a finite number followed by a unit of the right dimension.
    """
    example = f'"10 {EXAMPLES[si_unit].split(", ")[-1]}"'
    if not isinstance(value, str):
        raise DataError(f"{shown(value)} has no unit; write a quantity in quotes, such as {example}")
    match = _NUMBER.fullmatch(value) if len(value) <= _LONGEST else None
    if match is None:
        raise DataError(f"{shown(value)} is no quantity; write a number and a unit, such as {example}")
    size, unit = float(match[1]), match[2].strip()
    if not unit:
        raise DataError(f"{shown(value)} has no unit; write a number and a unit, such as {example}")
    scale = unit_scale(unit, si_unit)
    result = float(scale.to_si(np.float64(size)))
    if not math.isfinite(result):
        raise DataError(f"{shown(value)} is not finite; write a number that is")
    return result


def vector(value: object, si_unit: str) -> np.ndarray:
    """Three components -> (3,) in SI, from a list of numbers (SI), of quantity strings, or a string like "[0, 0, 0.1] N".

    Raises DataError unless there are three finite components of the right dimension.
    """
    if isinstance(value, str):
        match = re.fullmatch(r"\s*\[([^\[\]]*)\]\s*(.*)", value, re.DOTALL) if len(value) <= _LONGEST else None
        components: list[object] = [f"{part} {match[2]}" for part in match[1].split(",")] if match else []
    else:
        components = list(value) if isinstance(value, list) else []
    if len(components) != 3:
        raise DataError(f"{shown(value)} is no three-vector; write [x, y, z] in {si_unit}, such as [0.0, 0.0, 1.0]")
    return np.array([quantity(part, si_unit) if isinstance(part, str) else number(part) for part in components])


def number(value: object) -> float:
    """A TOML integer or float -> a finite float. Raises DataError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f"{shown(value)} is not a number; write a finite number")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise DataError(f"{shown(value)} is not finite; write a finite number")
    return result


def shown(value: object) -> str:
    """What came, in one short line for a message."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
