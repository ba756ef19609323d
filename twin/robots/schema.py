"""Schemas of a `robot.toml`: one `Row` for each parameter, and the counts that give the lengths of its lists.

Each family declares a `Schema`; the check of a file, the reference page and the starter of `twin new` all use it.
"""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from twin.foundation.errors import DataError, did_you_mean, short_repr
from twin.foundation.file_schema import TableSchema
from twin.foundation.parameters import Parameter
from twin.foundation.units import Scale, unit_scale
from twin.measurements.parsing.quantity_strings import parse_number

SOURCE_OF_DEFAULT = "not written: the default"  # the source of a number that a file leaves out
BOUND_STDS = 5.0  # standard deviations from the value to the bounds of a fit, if a file gives no `low` and `high`
FULL_TURN = 2.0 * np.pi  # rad


@dataclass(frozen=True)
class Row:
    """One physical parameter: name, units, meaning and range.

    `low` and `high` (SI, inclusive) bound its value and its fit's bounds. `shape` names the counts of its list: () is one number,
    ("tendon",) one for each tendon, ("tendon", "disk") for each tendon a list of one for each disk. With `one_for_all` one number
    may stand for all. It applies to structures of `for_kinds` (all, if empty). `default` is its value if it is not written; None
    means that it must be written, but in a `group` only if another of the group is. With `checked_only` it may be left out, is
    checked against others, and is no parameter.
    """

    name: str
    unit: str  # SI
    usual_unit: str  # of files
    meaning: str
    low: float
    high: float
    shape: tuple[str, ...] = ()
    one_for_all: bool = True
    for_kinds: frozenset[str] = frozenset()
    default: float | None = None
    group: str = ""
    checked_only: bool = False

    def range_text(self) -> str:
        """Return the range in the usual unit, as text."""
        low, high = unit_scale(self.usual_unit, self.unit).from_si(np.array([self.low, self.high]))
        return f"{low:.4g} to {high:.4g}" + ("" if self.usual_unit == "1" else f" {self.usual_unit}")


class Structure(TableSchema):
    """The [structure] of a file: whole numbers and choices."""

    def counts(self) -> dict[str, int]:
        """Return the counts by the names that `Row.shape` uses; a list over another name has any length from two."""
        return {}

    def kinds(self) -> frozenset[str]:
        """Return the kinds of robot this is, by the names that `Row.for_kinds` uses."""
        return frozenset()

    def find_conflicts(self) -> list[str]:
        """Return the contradictions between its keys."""
        return []


@dataclass(frozen=True)
class ModelFile:
    """How a family reads a robot whose numbers are those of a model beside its robot.toml.

    `located` returns the structure with the model's place, given the folder; `parameters` reads [parameters] of that, adding
    problems; `gravity` is the model's own; `notices` says what was assumed.
    """

    located: Callable[[Any, Path], dict[str, object]]
    parameters: Callable[[Mapping[str, object], Mapping[str, Any], list[str]], list[Parameter]]
    gravity: Callable[[Mapping[str, object]], np.ndarray]
    notices: Callable[[Mapping[str, object], Mapping[str, Any]], tuple[str, ...]]


@dataclass(frozen=True)
class Schema:
    """All that a family reads of a file."""

    structure: type[Structure]
    rows: tuple[Row, ...]
    accuracy: Row  # the description's own error
    find_conflicts: Callable[[Any, Mapping[str, float]], list[str]]  # contradictions between valid parameters (SI, by name)
    usual_channels: Callable[[Any], list[tuple[str, str, str, float]]]  # usually logged: (channel, role, unit, noise)
    diagram: str  # of the frames
    model_file: ModelFile | None = None  # of a family whose numbers are those of a model

    def applicable_rows(self, structure: Structure) -> dict[str, Row]:
        """Return the rows of a robot of this structure, by name."""
        return {row.name: row for row in self.rows if not row.for_kinds or row.for_kinds & structure.kinds()}


GRAVITY_ROW = Row("gravity", "m/s^2", "m/s^2", "gravity, [x, y, z] in the base frame", -50.0, 50.0, ("axis",), one_for_all=False)


class ExactEntry(TableSchema):
    """A number or a list that is exact."""

    value: Any
    unit: str
    source: str


class UncertainEntry(ExactEntry):
    """A number or a list that may be uncertain; `row_parameters` checks `value`, `std`, `low` and `high`."""

    std: Any = None
    low: Any = None
    high: Any = None


def row_parameters(row: Row, entry: UncertainEntry, counts: Mapping[str, int]) -> list[Parameter]:
    """Return the parameters of one entry, SI: one, or name_1, name_2, ... of a list (name_1_1, ... of a list of lists).

    Raises DataError for an empty source, a unit of another dimension, a list of another length, numbers outside the row's range or
    the entry's bounds, and a std that is not positive or wider than the bounds.
    """
    if not entry.source.strip():
        raise DataError("source is empty; say where the number comes from, or that it is assumed")
    if row.checked_only and not (entry.std is entry.low is entry.high is None):
        raise DataError("it is only checked, never fitted; remove its std, low and high")
    scale = unit_scale(entry.unit, row.unit)
    values = indexed_numbers(row, entry.value, counts)
    si = {index: _to_si_in_range(row, "value", v, scale, entry.unit) for index, v in values.items()}
    std = None if entry.std is None else float(scale.without_offset().to_si(_parse_keyed("std", entry.std)))
    if std is not None and not std > 0.0:
        raise DataError(
            f"std is {short_repr(entry.std)}; one standard deviation above zero is needed, none where the number is exact"
        )
    bounds = {
        key: _to_si_in_range(row, key, _parse_keyed(key, v), scale, entry.unit)
        for key, v in (("low", entry.low), ("high", entry.high))
        if v is not None
    }
    if bounds.get("low", row.low) >= bounds.get("high", row.high):
        raise DataError(f"low = {short_repr(entry.low)} is not below high = {short_repr(entry.high)}")
    out = []
    for index, v in si.items():
        width = BOUND_STDS * std if std is not None else np.inf
        low, high = bounds.get("low", max(row.low, v - width)), bounds.get("high", min(row.high, v + width))
        if not low <= v <= high:
            raise DataError(
                f"value {short_repr(values[index])} lies outside low = {short_repr(entry.low)}, high = {short_repr(entry.high)}"
            )
        if std is not None and std > high - low:
            raise DataError(
                f"std is {short_repr(entry.std)}, wider than all that low and high allow; widen them or write a smaller one"
            )
        name = "_".join([row.name, *map(str, index)])
        out.append(Parameter(name, v, row.unit, low, high, entry.source, std, file_unit=entry.unit))
    return out


def default_parameter(row: Row) -> Parameter:
    """Return the parameter of a row that a file does not write."""
    assert row.default is not None
    return Parameter(row.name, row.default, row.unit, row.low, row.high, SOURCE_OF_DEFAULT, file_unit=row.usual_unit)


def indexed_numbers(row: Row, value: object, counts: Mapping[str, int]) -> dict[tuple[int, ...], float]:
    """Return the numbers of a value by index from 1; a single number has index (). Raises DataError for another shape."""
    if not isinstance(value, list):
        if row.shape and not row.one_for_all:
            raise DataError(f"value is {short_repr(value)}; a list is needed, one number a {' and '.join(row.shape)}")
        return {(): _parse_keyed("value", value)}
    if not row.shape:
        raise DataError(f"value is {short_repr(value)}; one number is needed, not a list")
    out: dict[tuple[int, ...], float] = {}
    for index, found in _flatten(value, row.shape, counts):
        out[index] = _parse_keyed("value", found)
    return out


def _flatten(value: object, shape: tuple[str, ...], counts: Mapping[str, int]) -> list[tuple[tuple[int, ...], object]]:
    if not shape:
        return [((), value)]
    kind = shape[0]
    needed = counts.get(kind)
    if not isinstance(value, list) or (len(value) < 2 if needed is None else len(value) != needed):
        came = f"{len(value)} numbers" if isinstance(value, list) else short_repr(value)
        each = f"one a {kind}" if len(shape) == 1 else f"one a {kind}, each a list of one a {' of one a '.join(shape[1:])}"
        raise DataError(f"value is {came}; a list of {needed or 'two or more'} is needed, {each}")
    deeper = (_flatten(each, shape[1:], counts) for each in value)
    return list(itertools.chain.from_iterable([((k, *i), v) for i, v in found] for k, found in enumerate(deeper, 1)))


def _parse_keyed(key: str, value: object) -> float:
    try:
        return parse_number(value)
    except DataError as error:
        raise DataError(f"{key}: {error}") from None


def _to_si_in_range(row: Row, key: str, value: float, scale: Scale, unit: str) -> float:
    """Convert a number of the file to SI. Raises DataError if it is outside the row's range."""
    si = float(scale.to_si(value))
    if not row.low <= si <= row.high:
        raise DataError(f"{key} = {value:g} {unit} is not plausible; allowed is {row.range_text()}")
    return si


def why_unknown(name: str, schema: Schema, rows: Mapping[str, Row]) -> str:
    """Return why a parameter of this name is refused; `rows` are those of the robot's structure."""
    if any(row.name == name for row in schema.rows):
        kinds = sorted(set().union(*(row.for_kinds for row in schema.rows if row.name == name)))
        return f"{name!r} is not read: it belongs to {' or '.join(kinds)}; remove it, or change [structure]"
    return f"no parameter {short_repr(name)} is known{did_you_mean(name, rows)}"
