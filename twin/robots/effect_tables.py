"""[[effect]] tables of robots and twins: an identifier and the values of its parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pydantic import Field

from twin.effects import Effect, effect_class
from twin.effects.base.scaling import scaled_effect, scaled_parameters
from twin.foundation.errors import DataError, TwinError, did_you_mean, short_repr
from twin.foundation.file_schema import TableSchema, validate_table
from twin.foundation.parameters import Parameter, Size, check_bounds
from twin.foundation.units import difference_scale, unit_scale
from twin.measurements.parsing.quantity_strings import parse_number


class EffectTable(TableSchema):
    """One [[effect]]."""

    id: str
    parameters: dict[str, Any] = Field({})


class ParameterValue(TableSchema):
    """A parameter's value in a twin's file."""

    value: Any
    unit: str
    std: Any = None


def read_effects(entries: Sequence[object], n_tendon: int, size: Size, problems: list[str]) -> list[Effect]:
    """Read the effects of a robot of this size; their problems are added to `problems`."""
    effects: list[Effect] = []
    for at, entry in enumerate(entries, 1):
        table = validate_table(EffectTable, entry, f"effect {at}", problems)
        if table is None:
            continue
        try:
            effect = effect_class(table.id)
        except TwinError as error:
            problems.append(str(error))
            continue
        if any(e.id == table.id for e in effects):
            problems.append(f"effect {table.id} is there twice; merge the two")
        n_problems = len(problems)
        values = read_values(table.parameters, scaled_parameters(effect, n_tendon, size), f"effect {table.id}", problems)
        if len(problems) == n_problems:
            effects.append(scaled_effect(effect, values, n_tendon, size))
    return effects


def read_uncertain(entries: Sequence[object], effects: Sequence[Effect], size: Size) -> tuple[tuple[str, Parameter], ...]:
    """Return the parameters with a std of effects read from these entries, as (effect's identifier, prior in SI)."""
    uncertain = []
    for entry, effect in zip(entries, effects, strict=True):
        table = EffectTable.model_validate(entry).parameters
        for parameter in scaled_parameters(type(effect), effect.n_tendon, size):
            written = table.get(parameter.name)
            if isinstance(written, Mapping) and written.get("std") is not None:
                std = difference_scale(str(written["unit"]), parameter.unit).to_si(parse_number(written["std"]))
                uncertain.append((effect.id, replace(parameter, value=effect[parameter.name], std=float(std))))
    return tuple(uncertain)


def read_values(table: Mapping[str, object], declared: Sequence[Parameter], where: str, problems: list[str]) -> dict[str, float]:
    """Read values, SI, from a table of plain SI numbers or {value, unit, std}; their problems are added to `problems`.

    A temperature in a robot's own parameters (those with a `file_unit`) is absolute, in an effect's it is a difference.
    """
    known = {p.name: p for p in declared}
    out: dict[str, float] = {}
    for name, entry in table.items():
        if name not in known:
            available = ", ".join(sorted(known)) + did_you_mean(name, known)
            problems.append(f"{where}: no parameter named {short_repr(name)}; available: {available}")
            continue
        try:
            out[name] = _parse_value(known[name], entry)
            check_bounds(known[name], out[name])
        except TwinError as error:
            problems.append(f"{where}: {error}" if name in str(error) else f"{where}: {name}: {error}")
    return out


def _parse_value(parameter: Parameter, entry: object) -> float:
    if not isinstance(entry, Mapping):
        if isinstance(entry, bool) or not isinstance(entry, int | float):
            raise DataError(f"{short_repr(entry)} is no number; write one in {parameter.unit}, or {{ value = ..., unit = ... }}")
        return entry if isinstance(entry, float) else parse_number(entry)
    problems: list[str] = []
    written = validate_table(ParameterValue, entry, parameter.name, problems)
    if written is None:
        raise DataError("; ".join(problems))
    scale = (unit_scale if parameter.file_unit else difference_scale)(written.unit, parameter.unit)
    if written.std is not None and not parse_number(written.std) > 0.0:
        raise DataError(f"std is {short_repr(written.std)}; a number above zero is needed")
    return float(scale.to_si(parse_number(written.value)))
