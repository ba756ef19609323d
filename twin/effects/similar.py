"""Laws on robots of other sizes. A law's numbers, and where its fits begin, are written for a robot of size 1 (`Size`); what it
says of another is what it says of the similar one of that size, by dimensional analysis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from twin.effects.effect import Effect, Signals, Start
from twin.quantities import Parameter, Size


def declared(law: type[Effect], n_tendon: int, size: Size) -> tuple[Parameter, ...]:
    """`Effect.declared` of a robot of this size: values, bounds and steps."""
    return tuple(p.on(size) for p in law.declared(n_tendon))


def on(law: type[Effect], values: Mapping[str, float], n_tendon: int, size: Size) -> Effect:
    """The effect of these values on a robot of this size; what is not given is as such a robot has it."""
    return law({**{p.name: p.value for p in declared(law, n_tendon, size)}, **values}, n_tendon)


def starts(law: type[Effect], predicted: list[Signals], n_tendon: int, size: Size) -> Iterator[Start]:
    """`Effect.starts` on a robot of this size."""
    for start in law.starts([_shrunk(s, size) for s in predicted], n_tendon):
        yield _grown(start, law, n_tendon, size)


def fuller_starts(effect: Effect, predicted: list[Signals], size: Size) -> Iterator[Start]:
    """`Effect.fuller_starts` on a robot of this size."""
    for start in similar(effect, size).fuller_starts([_shrunk(s, size) for s in predicted]):
        yield _grown(start, type(effect), effect.n_tendon, size)


def similar(effect: Effect, size: Size) -> Effect:
    """The effect that is on a robot of size 1 what this one is on a robot of `size`."""
    values = {p.name: effect[p.name] / size.of(p.unit) for p in effect.declared(effect.n_tendon)}
    return type(effect)(values, effect.n_tendon)


def _shrunk(signals: Signals, size: Size) -> Signals:
    return signals.with_(
        tension=signals.tension / size.force, displacement=signals.displacement / size.length, markers=signals.markers / size.length
    )


def _grown(start: Start, law: type[Effect], n_tendon: int, size: Size) -> Start:
    units = {p.name: p.unit for p in law.declared(n_tendon)}
    return replace(start, values={name: value * size.of(units[name]) for name, value in start.values.items()})
