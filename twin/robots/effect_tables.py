"""The [[effect]] tables of robots and twins: an identifier and the values of its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pydantic import Field

from twin.effects import Effect, named
from twin.effects.similar import declared, on
from twin.errors import DataError, TwinError, did_you_mean, shown
from twin.forms import Form, fill
from twin.measurements.quantity_strings import number
from twin.quantities import Parameter, Size, check_bounds
from twin.units import difference_scale, unit_scale


class EffectTable(Form):
    """One [[effect]]."""

    id: str
    parameters: dict[str, Any] = Field({})


class Value(Form):
    """A parameter's value as twins write it."""

    value: Any
    unit: str
    std: Any = None


def read_effects(entries: Sequence[object], n_tendon: int, size: Size, problems: list[str]) -> list[Effect]:
    """The effects of a file, of a robot of this size; all that is wrong with them is added to `problems`."""
    found: list[Effect] = []
    for at, entry in enumerate(entries, 1):
        table = fill(EffectTable, entry, f"effect {at}", problems)
        if table is None:
            continue
        try:
            law = named(table.id)
        except TwinError as error:
            problems.append(str(error))
            continue
        if any(e.id == table.id for e in found):
            problems.append(f"effect {table.id} stands there twice; merge the two")
        before = len(problems)
        values = read_values(table.parameters, declared(law, n_tendon, size), f"effect {table.id}", problems)
        if len(problems) == before:
            found.append(on(law, values, n_tendon, size))
    return found


def read_uncertain(entries: Sequence[object], effects: Sequence[Effect], size: Size) -> tuple[tuple[str, Parameter], ...]:
    """Of the effects as they were read from these entries, the parameters whose std is given: what is believed of each, SI, beside
    its effect's identifier."""
    found = []
    for entry, law in zip(entries, effects, strict=True):
        table = EffectTable.model_validate(entry).parameters
        for parameter in declared(type(law), law.n_tendon, size):
            written = table.get(parameter.name)
            if isinstance(written, Mapping) and written.get("std") is not None:
                std = difference_scale(str(written["unit"]), parameter.unit).to_si(number(written["std"]))
                found.append((law.id, replace(parameter, value=law[parameter.name], std=float(std))))
    return tuple(found)


def read_values(table: Mapping[str, object], declared: Sequence[Parameter], where: str, problems: list[str]) -> dict[str, float]:
    """Values, SI, of a table of plain SI numbers or {value, unit, std}; all that is wrong with them is added to `problems`.

    In a robot's own parameters (those with a `written` unit) a temperature is absolute, in an effect's it is a difference.
    """
    known = {p.name: p for p in declared}
    out: dict[str, float] = {}
    for name, entry in table.items():
        if name not in known:
            available = ", ".join(sorted(known)) + did_you_mean(name, known)
            problems.append(f"{where}: no parameter named {shown(name)}; available: {available}")
            continue
        try:
            out[name] = _value(known[name], entry)
            check_bounds(known[name], out[name])
        except TwinError as error:
            problems.append(f"{where}: {error}" if name in str(error) else f"{where}: {name}: {error}")
    return out


def _value(parameter: Parameter, entry: object) -> float:
    if not isinstance(entry, Mapping):
        if isinstance(entry, bool) or not isinstance(entry, int | float):
            raise DataError(f"{shown(entry)} is no number; write one in {parameter.unit}, or {{ value = ..., unit = ... }}")
        return entry if isinstance(entry, float) else number(entry)
    problems: list[str] = []
    written = fill(Value, entry, parameter.name, problems)
    if written is None:
        raise DataError("; ".join(problems))
    scale = (unit_scale if parameter.written else difference_scale)(written.unit, parameter.unit)
    if written.std is not None and not number(written.std) > 0.0:
        raise DataError(f"std is {shown(written.std)}; a number above zero is needed")
    return float(scale.to_si(number(written.value)))
