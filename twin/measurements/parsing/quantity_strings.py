"""Quantities as text, such as "10 g" or "[0, 0, 0.1] N", to SI."""

import math
import re

import numpy as np

from twin.foundation.errors import DataError, short_repr
from twin.foundation.units import UNIT_EXAMPLES, unit_scale

_MAX_CHARACTERS = 200  # characters of a quantity string
_QUANTITY_PATTERN = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?)\s*(.*)", re.DOTALL)


def parse_quantity(value: object, si_unit: str) -> float:
    """Return the SI value of a quantity string such as "10 g" or "23 degC".

    Raises DataError for anything but a finite number followed by a unit of the right dimension.
    """
    example = f'"10 {UNIT_EXAMPLES.get(si_unit, si_unit).split(", ")[-1]}"'
    if not isinstance(value, str):
        raise DataError(f"{short_repr(value)} has no unit; write a quantity in quotes, such as {example}")
    match = _QUANTITY_PATTERN.fullmatch(value) if len(value) <= _MAX_CHARACTERS else None
    if match is None:
        raise DataError(f"{short_repr(value)} is no quantity; write a number and a unit, such as {example}")
    size, unit = float(match[1]), match[2].strip()
    if not unit:
        raise DataError(f"{short_repr(value)} has no unit; write a number and a unit, such as {example}")
    scale = unit_scale(unit, si_unit)
    result = float(scale.to_si(np.float64(size)))
    if not math.isfinite(result):
        raise DataError(f"{short_repr(value)} is not finite; write a number that is")
    return result


def parse_vector(value: object, si_unit: str) -> np.ndarray:
    """Return (3,) in SI from a list of numbers (SI), of quantity strings, or from a string like "[0, 0, 0.1] N".

    Raises DataError unless there are three finite components of the right dimension.
    """
    if isinstance(value, str):
        match = re.fullmatch(r"\s*\[([^\[\]]*)\]\s*(.*)", value, re.DOTALL) if len(value) <= _MAX_CHARACTERS else None
        components: list[object] = [f"{part} {match[2]}" for part in match[1].split(",")] if match else []
    else:
        components = list(value) if isinstance(value, list) else []
    if len(components) != 3:
        raise DataError(f"{short_repr(value)} is no three-vector; write [x, y, z] in {si_unit}, such as [0.0, 0.0, 1.0]")
    return np.array([parse_quantity(part, si_unit) if isinstance(part, str) else parse_number(part) for part in components])


def parse_number(value: object) -> float:
    """Return a TOML integer or float as a finite float. Raises DataError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f"{short_repr(value)} is not a number; write a finite number")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise DataError(f"{short_repr(value)} is not finite; write a finite number")
    return result
