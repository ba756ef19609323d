"""What a family of bodies reads of a `robot.toml`: one `Row` a parameter, and the counts that say how long its lists are.

A family declares a `Schema`; the check of a file, the reference page and the starter of `twin new` all come from it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from twin.errors import DataError, did_you_mean, shown
from twin.forms import Form
from twin.measurements.quantity_strings import number
from twin.quantities import Parameter
from twin.units import Scale, unit_scale

NOT_WRITTEN = "not written: the default"  # the source of a number that a file leaves out
ROOM = 5.0  # std to either side of the value that a fit may go where a file gives no `low` and `high`


@dataclass(frozen=True)
class Row:
    """One physical parameter: what it is called, means and may be.

    `low` and `high` (SI, both ends allowed) hold for its value and its bounds. `shape` names the counts its list runs over: () for
    one number, ("tendon",) for one a tendon, ("tendon", "disk") for a list a tendon of one a disk; with `for_all` one number may
    stand for all of them. It belongs to structures of the kinds `only` (all, if empty). Left out, it is `default`; None: it must be
    written, but those of a `group` only where another of the group is. `stated`: it may be left out, and is checked, no parameter.
    """

    name: str
    unit: str  # SI
    usual: str  # the unit people write
    meaning: str
    low: float
    high: float
    shape: tuple[str, ...] = ()
    for_all: bool = True
    only: frozenset[str] = frozenset()
    default: float | None = None
    group: str = ""
    stated: bool = False

    def range(self) -> str:
        """Its range in its usual unit, for people."""
        low, high = unit_scale(self.usual, self.unit).from_si(np.array([self.low, self.high]))
        return f"{low:.4g} to {high:.4g}" + ("" if self.usual == "1" else f" {self.usual}")


class Structure(Form):
    """The [structure] of a file: whole numbers and choices."""

    def counts(self) -> dict[str, int]:
        """How many of each there are, by the names that `Row.shape` uses; one that is not here is free, but two at least."""
        return {}

    def kinds(self) -> frozenset[str]:
        """The kinds of robot this is, by the names that `Row.only` uses."""
        return frozenset()

    def objections(self) -> list[str]:
        """What is wrong between its keys."""
        return []


@dataclass(frozen=True)
class Schema:
    """All a family reads. `accuracy` is the row of the description's own error; `objections` says what is wrong between parameters
    (SI, by name) that are each in order; `logged` lists what is usually logged of it, as (channel, role, unit, noise); `picture`
    shows the frames."""

    structure: type[Structure]
    rows: tuple[Row, ...]
    accuracy: Row
    objections: Callable[[Any, Mapping[str, float]], list[str]]
    logged: Callable[[Any], list[tuple[str, str, str, float]]]
    picture: str

    def taken(self, structure: Structure) -> dict[str, Row]:
        """The rows a robot of this structure has, by name."""
        return {row.name: row for row in self.rows if not row.only or row.only & structure.kinds()}


GRAVITY = Row("gravity", "m/s^2", "m/s^2", "gravity, [x, y, z] in the base frame", -50.0, 50.0, ("axis",), for_all=False)


class Fact(Form):
    """A number or a list that is taken as exact."""

    value: Any
    unit: str
    source: str


class Quantity(Fact):
    """One that may be uncertain. `value`, `std`, `low` and `high` are looked at by `parameters`."""

    std: Any = None
    low: Any = None
    high: Any = None


def parameters(row: Row, entry: Quantity, counts: Mapping[str, int]) -> list[Parameter]:
    """The parameters of one entry, SI: one, or one each under name_1, name_2, ... (name_1_1, ... of a list of lists).

    Raises DataError for a source that says nothing, a unit of another dimension, a list that is too short or too long, numbers
    outside the row's range or the entry's bounds, and a spread that is none.
    """
    if not entry.source.strip():
        raise DataError("source is empty; say where the number comes from, or that it is assumed")
    if row.stated and not (entry.std is entry.low is entry.high is None):
        raise DataError("it is only checked, never fitted; remove its std, low and high")
    scale = unit_scale(entry.unit, row.unit)
    values = numbers(row, entry.value, counts)
    si = {index: _inside(row, "value", v, scale, entry.unit) for index, v in values.items()}
    std = None if entry.std is None else float(scale.difference().to_si(_named("std", entry.std)))
    if std is not None and not std > 0.0:
        raise DataError(f"std is {shown(entry.std)}; one standard deviation above zero is needed, none where the number is exact")
    bounds = {
        key: _inside(row, key, _named(key, v), scale, entry.unit)
        for key, v in (("low", entry.low), ("high", entry.high))
        if v is not None
    }
    if bounds.get("low", row.low) >= bounds.get("high", row.high):
        raise DataError(f"low = {shown(entry.low)} is not below high = {shown(entry.high)}")
    out = []
    for index, v in si.items():
        room = ROOM * std if std is not None else np.inf
        low, high = bounds.get("low", max(row.low, v - room)), bounds.get("high", min(row.high, v + room))
        if not low <= v <= high:
            raise DataError(f"value {shown(values[index])} lies outside low = {shown(entry.low)}, high = {shown(entry.high)}")
        if std is not None and std > high - low:
            raise DataError(f"std is {shown(entry.std)}, wider than all that low and high allow; widen them or write a smaller one")
        name = "_".join([row.name, *map(str, index)])
        out.append(Parameter(name, v, row.unit, low, high, entry.source, std, written=entry.unit))
    return out


def absent(row: Row) -> Parameter:
    """The parameter a row is where a file does not write it."""
    assert row.default is not None
    return Parameter(row.name, row.default, row.unit, row.low, row.high, NOT_WRITTEN, written=row.usual)


def numbers(row: Row, value: object, counts: Mapping[str, int]) -> dict[tuple[int, ...], float]:
    """The numbers of a value by their index from 1; one number alone has the index (). Raises DataError for another shape."""
    if not isinstance(value, list):
        if row.shape and not row.for_all:
            raise DataError(f"value is {shown(value)}; a list is needed, one number a {' and '.join(row.shape)}")
        return {(): _named("value", value)}
    if not row.shape:
        raise DataError(f"value is {shown(value)}; one number is needed, not a list")
    out: dict[tuple[int, ...], float] = {}
    for index, found in _flat(value, row.shape, counts):
        out[index] = _named("value", found)
    return out


def _flat(value: object, shape: tuple[str, ...], counts: Mapping[str, int]) -> list[tuple[tuple[int, ...], object]]:
    if not shape:
        return [((), value)]
    kind = shape[0]
    needed = counts.get(kind)
    if not isinstance(value, list) or (len(value) < 2 if needed is None else len(value) != needed):
        came = f"{len(value)} numbers" if isinstance(value, list) else shown(value)
        each = f"one a {kind}" if len(shape) == 1 else f"one a {kind}, each a list of one a {' of one a '.join(shape[1:])}"
        raise DataError(f"value is {came}; a list of {needed or 'two or more'} is needed, {each}")
    deeper = (_flat(each, shape[1:], counts) for each in value)
    return list(itertools.chain.from_iterable([((k, *i), v) for i, v in found] for k, found in enumerate(deeper, 1)))


def _named(key: str, value: object) -> float:
    try:
        return number(value)
    except DataError as error:
        raise DataError(f"{key}: {error}") from None


def _inside(row: Row, key: str, value: float, scale: Scale, unit: str) -> float:
    """A number of the file in SI. Raises DataError where it is outside what the row allows."""
    si = float(scale.to_si(value))
    if not row.low <= si <= row.high:
        raise DataError(f"{key} = {value:g} {unit} is not plausible; allowed is {row.range()}")
    return si


def unknown(name: str, schema: Schema, taken: Mapping[str, Row]) -> str:
    """Why a parameter of this name is refused."""
    if any(row.name == name for row in schema.rows):
        kinds = sorted(set().union(*(row.only for row in schema.rows if row.name == name)))
        return f"{name!r} is not read: it belongs to {' or '.join(kinds)}; remove it, or change [structure]"
    return f"no parameter {shown(name)} is known{did_you_mean(name, taken)}"
