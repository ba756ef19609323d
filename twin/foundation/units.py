"""Conversion between units as people write them and SI; the only module that uses pint.

A reading y in the declared unit is x = factor y + offset in SI. Only degC and degF have an offset; a difference (noise, a
standard deviation) uses the factor alone.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from twin.foundation.errors import DataError, short_repr

if TYPE_CHECKING:
    import pint

# SI unit -> units that users write, for messages.
UNIT_EXAMPLES = {
    "N": "N, mN, gf", "m": "m, mm", "A": "A, mA", "V": "V, mV", "K": "K, degC", "ohm": "ohm, kohm", "rad": "rad, deg",
    "N*m": "N*m, mN*m", "kg": "kg, g", "Pa": "Pa, GPa", "s": "s, ms", "m/N": "m/N, mm/N", "1": "1 (a plain number)",
}  # fmt: skip
_UNIT_CHARACTERS = re.compile(r"[A-Za-zµμΩ\u2126°·_*/^(). 0-9-]{1,60}")
# pint never finishes with towers of powers: an exponent must be one or two digits on a name, without a further exponent.
_POWER_TOWER = re.compile(r"\d{3}|(?:\*\*|\^)\s*-?\s*(?!\d)|\)\s*(?:\*\*|\^)|(?:\*\*|\^)[\s\d-]*(?:\*\*|\^)")
_UNIT_NAME = re.compile(r"[^\W\d]+")


@dataclass(frozen=True)
class Scale:
    """Conversion to SI, x = numerator / denominator y + offset. A mm is 1 / 1000 m, so that 12.3 mm is exactly 0.0123 m."""

    numerator: float
    denominator: float
    offset: float

    def without_offset(self) -> Scale:
        """Return the scale for differences, such as noise."""
        return Scale(self.numerator, self.denominator, 0.0)

    def to_si(self, declared: Any) -> Any:
        """Convert readings in the declared unit, of any shape, to SI."""
        with np.errstate(over="ignore"):
            return declared * self.numerator / self.denominator + self.offset

    def from_si(self, si: np.ndarray) -> np.ndarray:
        """Convert SI values (n,) to the declared unit, to floats for which `to_si` returns the same bits where possible."""
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
    """Return the conversion from `unit` to `si_unit`.

    Raises DataError for a unit that pint does not know, for one of another dimension (angle counts as a dimension: neither "1" nor
    "rad/s" is a unit of it), and for one that names a unit twice.
    """
    way_out = f"; allowed is any unit like {UNIT_EXAMPLES.get(si_unit, si_unit)}"
    text = unit.strip().replace("²", "**2").replace("³", "**3")
    if not text:
        raise DataError(f"the unit is empty{way_out}")
    if not _UNIT_CHARACTERS.fullmatch(text) or _POWER_TOWER.search(text) or "delta" in text:
        raise DataError(f"{short_repr(unit)} is not a unit{way_out}")
    names = _UNIT_NAME.findall(text)
    if len(set(names)) < len(names):
        raise DataError(f"{short_repr(unit)} names a unit twice{way_out}")
    if text == si_unit:
        return Scale(1.0, 1.0, 0.0)
    registry = _registry()
    try:
        parsed = registry.parse_units(text)
        zero, one = registry.Quantity(0.0, parsed), registry.Quantity(1.0, parsed)
        # Root units, not dimensions: pint calls angles, counts and percent all dimensionless.
        fits = one.to_root_units().units == registry.Quantity(1.0, si_unit).to_root_units().units
        factor, offset = (float((one - zero).to(si_unit).magnitude), float(zero.to(si_unit).magnitude)) if fits else (0.0, 0.0)
    except Exception:  # pint answers odd text with AttributeError, ValueError, AssertionError, TokenError and more
        raise DataError(f"unknown unit {short_repr(unit)}{way_out}") from None
    if not fits or (offset and si_unit != "K"):  # decibels have an offset too
        raise DataError(f"unit {short_repr(unit)} has the wrong dimension{way_out}")
    if not (1e-30 < factor < 1e30 and math.isfinite(offset)):
        raise DataError(f"unit {short_repr(unit)} has no sensible size in {si_unit}{way_out}")
    parts = round(1.0 / factor)
    if parts > 1 and math.isclose(parts * factor, 1.0, rel_tol=1e-12):
        return Scale(1.0, float(parts), offset)
    return Scale(factor, 1.0, offset)


def difference_scale(unit: str, si_unit: str) -> Scale:
    """Return the conversion of a difference from `unit` to `si_unit`. Raises DataError as `unit_scale`, and for degC and degF."""
    scale = unit_scale(unit, si_unit)
    if scale.offset:
        raise DataError(f"unit {short_repr(unit)} has an offset and this is a difference; write {si_unit}")
    return scale
