"""Twins drawn from what is not known of a robot: the errors of its diagnosis, doubtful effects, and plain ranges.

Parameters are drawn together, normal about their values with the standard errors of twin.toml and the correlations of the report
beside it (one by one where there is no report), and cut at their bounds.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from twin.effects import Effect, catalogue
from twin.effects.similar import declared, on
from twin.errors import DataError, UnknownNameError
from twin.measurements.files import is_file
from twin.quantities import Parameter
from twin.robots.toml_file import opened
from twin.storage import FORMAT
from twin.twin import Twin
from twin.units import unit_scale


@dataclass(frozen=True)
class Spread:
    """One standard deviation (SI) of what is not known, by "parameter" of the robot or "effect.parameter", and how errors go
    together, by pairs of these; and of each effect how probable it is."""

    std: Mapping[str, float] = field(default_factory=dict)
    probability: Mapping[str, float] = field(default_factory=dict)
    correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)

    def drawn(self, rng: np.random.Generator) -> dict[str, float]:
        """How far off each is (SI)."""
        names = sorted(self.std)
        together = np.array([[1.0 if a == b else self.correlation.get((a, b), 0.0) for b in names] for a in names])
        values, vectors = np.linalg.eigh(together.reshape(len(names), len(names)))
        # What is rounded in a report may leave a direction slightly below zero.
        z = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(names)))
        return {n: self.std[n] * float(x) for n, x in zip(names, z, strict=True)}


def read_spread(source: str | Path, twin: Twin) -> Spread:
    """What a twin.toml (or the report's folder) says of its own uncertainty; of a robot's name alone, its description's."""
    path = Path(source)
    path = path / "twin.toml" if is_file(path / "twin.toml") else path
    if path.suffix != ".toml":
        return Spread({p.name: p.std for p in twin.robot.nuisance if p.std is not None})
    std: dict[str, float] = {}
    with opened(path, FORMAT) as table:
        units = {p.name: p.unit for p in twin.robot.parameters}
        std |= _stds(table.get("parameters", {}), units, "")
        for entry in table.get("effect", []):
            laws = {p.name: p.unit for e in twin.effects if e.id == entry["id"] for p in e.declared(e.n_tendon)}
            std |= _stds(entry.get("parameters", {}), laws, f"{entry['id']}.")
    report = path.with_name("report.json")
    said = json.loads(report.read_text("utf-8")) if is_file(report) else {}
    known = {e.id for e in twin.effects}
    probability = {
        c["id"]: float(c["probability"]) for c in said.get("effects", []) if c.get("probability") is not None and c["id"] in known
    }
    together = said.get("correlation", {"parameters": [], "matrix": []})
    names = together["parameters"]
    correlation = {
        (a, b): float(x) for a, row in zip(names, together["matrix"], strict=True) for b, x in zip(names, row, strict=True)
    }
    return Spread(std, probability, correlation)


def _stds(table: Mapping[str, Any], units: Mapping[str, str], prefix: str) -> dict[str, float]:
    given = {n: e for n, e in table.items() if isinstance(e, Mapping) and e.get("std") is not None}
    return {prefix + n: float(unit_scale(str(e["unit"]), units[n]).difference().to_si(float(e["std"]))) for n, e in given.items()}


def draw(twin: Twin, spread: Spread, ranges: Mapping[str, tuple[float, float]], rng: np.random.Generator) -> Twin:
    """A twin of `spread` about `twin`, and evenly from `ranges` (SI) by the same names; an effect it has not yet joins it there.

    Raises UnknownNameError for a name that is no parameter.
    """
    own, off = {p.name: p for p in twin.robot.parameters}, spread.drawn(rng)
    values = {**{n: own[n].value for n in spread.std if n in own}, **twin.values}
    values = {n: _drawn(own[n], v, off.get(n), ranges.get(n), rng) for n, v in sorted(values.items())}
    values |= {n: _drawn(own[n], own[n].value, None, r, rng) for n, r in sorted(ranges.items()) if n in own and n not in values}
    effects = {e.id: e for e in twin.effects if rng.random() < spread.probability.get(e.id, 1.0)}
    for name in sorted(ranges):
        effect, _, parameter = name.partition(".")
        if name in own:
            continue
        if effect not in catalogue():
            raise UnknownNameError("parameter to draw", name, [*own, *(f"{e}.{p.name}" for e in catalogue() for p in _of(e, twin))])
        effects.setdefault(effect, on(catalogue()[effect], {}, twin.robot.n_tendon, twin.robot.size))
        if parameter not in effects[effect].values:
            raise UnknownNameError("parameter to draw", name, [f"{effect}.{n}" for n in effects[effect].values])
    return replace(twin, values=values, effects=tuple(_redrawn(e, twin, off, ranges, rng) for _, e in sorted(effects.items())))


def _of(effect: str, twin: Twin) -> tuple[Parameter, ...]:
    return declared(catalogue()[effect], twin.robot.n_tendon, twin.robot.size)


def _redrawn(
    effect: Effect, twin: Twin, off: Mapping[str, float], ranges: Mapping[str, tuple[float, float]], rng: np.random.Generator
) -> Effect:  # fmt: skip
    values = {
        p.name: _drawn(p, effect[p.name], off.get(f"{effect.id}.{p.name}"), ranges.get(f"{effect.id}.{p.name}"), rng)
        for p in _of(effect.id, twin)
    }
    return type(effect)(values, effect.n_tendon)


def _drawn(
    p: Parameter, value: float, off: float | None, span: tuple[float, float] | None, rng: np.random.Generator
) -> float:  # fmt: skip
    if span is not None:
        low, high = span
        if not p.low <= low <= high <= p.high:
            raise DataError(f"range [{low:g}, {high:g}] of {p.name}: allowed is within [{p.low:g}, {p.high:g}] {p.unit}")
        return float(rng.uniform(low, high))
    return value if off is None else float(np.clip(value + off, p.low, p.high))
