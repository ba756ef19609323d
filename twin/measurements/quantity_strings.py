"""Numbers with a unit as text, "10 g" or "[0, 0, 0.1] N", turned into SI."""

from __future__ import annotations

import math
import re

import numpy as np

from twin.errors import DataError, shown
from twin.units import EXAMPLES, unit_scale

_LONGEST = 200  # characters of a quantity string
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?)\s*(.*)", re.DOTALL)


def quantity(value: object, si_unit: str) -> float:
    """A quantity string such as "10 g" or "23 degC" -> its SI value.

    Raises DataError for anything but a finite number followed by a unit of the right dimension.
    """
    example = f'"10 {EXAMPLES.get(si_unit, si_unit).split(", ")[-1]}"'
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
