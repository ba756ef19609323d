"""Effects on robots of other sizes, by dimensional analysis.

An effect's numbers and starts are written for the reference robot, of size 1 (`Size`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from twin.body import Signals
from twin.effects.base.effect import Effect, FitStart
from twin.foundation.parameters import Parameter, Size


def scaled_parameters(effect: type[Effect], n_tendon: int, size: Size) -> tuple[Parameter, ...]:
    """Return `Effect.all_parameters` for a robot of this size: values, bounds and steps."""
    return tuple(p.scaled_to(size) for p in effect.all_parameters(n_tendon))


def scaled_effect(effect: type[Effect], values: Mapping[str, float], n_tendon: int, size: Size) -> Effect:
    """Return the effect with these values; the others are those of a robot of this size."""
    return effect({**{p.name: p.value for p in scaled_parameters(effect, n_tendon, size)}, **values}, n_tendon)


def scaled_starts(effect: type[Effect], predicted: list[Signals], n_tendon: int, size: Size) -> Iterator[FitStart]:
    """Yield `Effect.fit_starts` for a robot of this size."""
    for start in effect.fit_starts([_to_reference_size(s, size) for s in predicted], n_tendon):
        yield _from_reference_size(start, effect, n_tendon, size)


def scaled_extended_starts(effect: Effect, predicted: list[Signals], size: Size) -> Iterator[FitStart]:
    """Yield `Effect.extended_starts` for a robot of this size."""
    for start in at_reference_size(effect, size).extended_starts([_to_reference_size(s, size) for s in predicted]):
        yield _from_reference_size(start, type(effect), effect.n_tendon, size)


def at_reference_size(effect: Effect, size: Size) -> Effect:
    """Return the effect on the reference robot that is similar to this one on a robot of `size`."""
    values = {p.name: effect[p.name] / size.factor(p.unit) for p in effect.all_parameters(effect.n_tendon)}
    return type(effect)(values, effect.n_tendon)


def _to_reference_size(signals: Signals, size: Size) -> Signals:
    return signals.with_changes(
        tension=signals.tension / size.force, displacement=signals.displacement / size.length, markers=signals.markers / size.length
    )


def _from_reference_size(start: FitStart, effect: type[Effect], n_tendon: int, size: Size) -> FitStart:
    units = {p.name: p.unit for p in effect.all_parameters(n_tendon)}
    return replace(start, values={name: value * size.factor(units[name]) for name, value in start.values.items()})
