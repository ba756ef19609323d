"""Draw twins from the uncertainty of a robot: the errors of its diagnosis, doubtful effects, and plain ranges.

Parameters are drawn jointly, normal about their values with the full covariance of twin.toml: its standard errors and its
correlations, or for older files those of the report beside it (independently without either), and clipped to their bounds.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from twin.effects import Effect, catalogue
from twin.effects.base.scaling import scaled_effect, scaled_parameters
from twin.foundation.errors import DataError, UnknownNameError
from twin.foundation.files import is_file
from twin.foundation.parameters import Parameter
from twin.foundation.toml_file import open_toml
from twin.foundation.units import unit_scale
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import TWIN_FORMAT, correlations


@dataclass(frozen=True)
class ParameterSpread:
    """Uncertainty of a twin: one standard deviation (SI) by "parameter" of the robot or "effect.parameter", their correlations by
    pairs, and the probability of each effect."""

    std: Mapping[str, float] = field(default_factory=dict)
    probability: Mapping[str, float] = field(default_factory=dict)
    correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)

    def draw_errors(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw the error of each number (SI)."""
        names = sorted(self.std)
        correlation = np.array([[1.0 if a == b else self.correlation.get((a, b), 0.0) for b in names] for a in names])
        values, vectors = np.linalg.eigh(correlation.reshape(len(names), len(names)))
        # Rounding in a report may leave an eigenvalue slightly below zero.
        z = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(names)))
        return {n: self.std[n] * float(x) for n, x in zip(names, z, strict=True)}


def read_spread(source: str | Path, twin: Twin) -> ParameterSpread:
    """Read the uncertainty in a twin.toml (or the report's folder); for a robot's name alone, that of its description."""
    path = Path(source)
    path = path / "twin.toml" if is_file(path / "twin.toml") else path
    if path.suffix != ".toml":
        return ParameterSpread({p.name: p.std for p in twin.robot.nuisance if p.std is not None})
    std: dict[str, float] = {}
    with open_toml(path, TWIN_FORMAT) as table:
        units = {p.name: p.unit for p in twin.robot.parameters}
        std |= _read_stds(table.get("parameters", {}), units, "")
        for entry in table.get("effect", []):
            effect_units = {p.name: p.unit for e in twin.effects if e.id == entry["id"] for p in e.all_parameters(e.n_tendon)}
            std |= _read_stds(entry.get("parameters", {}), effect_units, f"{entry['id']}.")
    report = path.with_name("report.json")
    report_table = json.loads(report.read_text("utf-8")) if is_file(report) else {}
    known = {e.id for e in twin.effects}
    probability = {
        c["id"]: float(c["probability"])
        for c in report_table.get("effects", [])
        if c.get("probability") is not None and c["id"] in known
    }
    together = correlations(path)
    return ParameterSpread(std, probability, _reported_correlations(report_table) if together is None else together)


def _reported_correlations(report: Mapping[str, Any]) -> dict[tuple[str, str], float]:
    """Return the correlations by pairs of a report.json, for a twin.toml from before it kept its own; null stands for none."""
    table = report.get("correlation", {"parameters": [], "matrix": []})
    names = table["parameters"]
    return {
        (a, b): float(x)
        for a, row in zip(names, table["matrix"], strict=True)
        for b, x in zip(names, row, strict=True)
        if x is not None
    }


def _read_stds(table: Mapping[str, Any], units: Mapping[str, str], prefix: str) -> dict[str, float]:
    """Return the standard deviations (SI) of a table, by prefixed name."""
    given = {n: e for n, e in table.items() if isinstance(e, Mapping) and e.get("std") is not None}
    return {
        prefix + n: float(unit_scale(str(e["unit"]), units[n]).without_offset().to_si(float(e["std"]))) for n, e in given.items()
    }


def draw_twin(twin: Twin, spread: ParameterSpread, ranges: Mapping[str, tuple[float, float]], rng: np.random.Generator) -> Twin:
    """Draw a twin from `spread` about `twin`, and uniformly from `ranges` (SI) by the same names, with effects added where needed.

    Raises UnknownNameError for a name that is no parameter.
    """
    own, errors = {p.name: p for p in twin.robot.parameters}, spread.draw_errors(rng)
    values = {**{n: own[n].value for n in spread.std if n in own}, **twin.values}
    values = {n: _draw_value(own[n], v, errors.get(n), ranges.get(n), rng) for n, v in sorted(values.items())}
    values |= {
        n: _draw_value(own[n], own[n].value, None, r, rng) for n, r in sorted(ranges.items()) if n in own and n not in values
    }
    effects = {e.id: e for e in twin.effects if rng.random() < spread.probability.get(e.id, 1.0)}
    for name in sorted(ranges):
        effect, _, parameter = name.partition(".")
        if name in own:
            continue
        if effect not in catalogue():
            raise UnknownNameError(
                "parameter to draw", name, [*own, *(f"{e}.{p.name}" for e in catalogue() for p in _effect_parameters(e, twin))]
            )
        effects.setdefault(effect, scaled_effect(catalogue()[effect], {}, twin.robot.n_tendon, twin.robot.size))
        if parameter not in effects[effect].values:
            raise UnknownNameError("parameter to draw", name, [f"{effect}.{n}" for n in effects[effect].values])
    return replace(
        twin, values=values, effects=tuple(_redraw_effect(e, twin, errors, ranges, rng) for _, e in sorted(effects.items()))
    )


def _effect_parameters(effect: str, twin: Twin) -> tuple[Parameter, ...]:
    """Return the parameters of an effect, scaled to the robot's size."""
    return scaled_parameters(catalogue()[effect], twin.robot.n_tendon, twin.robot.size)


def _redraw_effect(
    effect: Effect, twin: Twin, errors: Mapping[str, float], ranges: Mapping[str, tuple[float, float]], rng: np.random.Generator
) -> Effect:  # fmt: skip
    """Return the effect with drawn parameters."""
    values = {
        p.name: _draw_value(p, effect[p.name], errors.get(f"{effect.id}.{p.name}"), ranges.get(f"{effect.id}.{p.name}"), rng)
        for p in _effect_parameters(effect.id, twin)
    }
    return type(effect)(values, effect.n_tendon)


def _draw_value(
    p: Parameter, value: float, error: float | None, span: tuple[float, float] | None, rng: np.random.Generator
) -> float:  # fmt: skip
    """Return a value drawn from the span, or with its error, within the bounds."""
    if span is not None:
        low, high = span
        if not p.low <= low <= high <= p.high:
            raise DataError(f"range [{low:g}, {high:g}] of {p.name}: allowed is within [{p.low:g}, {p.high:g}] {p.unit}")
        return float(rng.uniform(low, high))
    return value if error is None else float(np.clip(value + error, p.low, p.high))


def twin_arrays(twin: Twin) -> dict[str, np.ndarray]:
    """Return the values and effects of a twin as arrays by name."""
    values = [(e.id, name, value) for e in twin.effects for name, value in e.values.items()]
    return {
        "parameters": np.array(list(twin.values), str), "values": np.array(list(twin.values.values()), float),
        "effects": np.array([e.id for e in twin.effects], str), "effect_of_value": np.array([v[0] for v in values], str),
        "effect_parameters": np.array([v[1] for v in values], str), "effect_values": np.array([v[2] for v in values], float),
    }  # fmt: skip


def twin_from_arrays(described: Twin, arrays: Mapping[str, np.ndarray]) -> Twin:
    """Return the described robot's twin of such arrays."""
    effects = []
    for name in arrays["effects"]:
        rows = arrays["effect_of_value"] == name
        values = dict(zip(arrays["effect_parameters"][rows].tolist(), arrays["effect_values"][rows].tolist(), strict=True))
        effects.append(catalogue()[str(name)](values, described.robot.n_tendon))
    values = dict(zip(arrays["parameters"].tolist(), arrays["values"].tolist(), strict=True))
    return replace(described, values=values, effects=tuple(effects))
