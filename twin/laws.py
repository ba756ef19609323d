"""The effects in force, applied together in the order of the signal: the one place where laws meet.

Prediction, a loaded robot, controllers and rollouts all go through here:

    reported -> command -> drive -> [the body, edited, under surround, route, spring, deform, soften] -> sense -> reported
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from twin.effects import ROPES, Bearing, Creep, Effect, Loads, Route, Signals
from twin.errors import DataError
from twin.springs import Spring


@dataclass(frozen=True)
class Laws:
    """Effects in the order in which they act on a signal."""

    effects: tuple[Effect, ...]

    def edit(self, body: Any, robot: str) -> None:
        """Change a body that is not compiled yet. Raises DataError for an effect that finds nothing to act on in the `robot`."""
        self.find(body, robot)
        for effect in self.effects:
            effect.edit(body)

    def find(self, body: Any, robot: str) -> None:
        """Raises DataError for an effect that finds nothing to act on in the body of the `robot`."""
        for effect in self.effects:
            if lacking := effect.needs - body.parts:
                what = " and ".join(sorted(lacking))
                raise DataError(f"effect {effect.id} acts on {what}, which robot {robot!r} has not: remove the effect")
            if np.isfinite(effect.route().stall) and not body.parts >= ROPES:
                raise DataError(f"effect {effect.id}: motors that stall are not solved on robot {robot!r}: leave `stall` out")

    def command(self, reported: Signals) -> Signals:
        """The true inputs behind what was reported."""
        for effect in reversed(self.effects):
            reported = effect.command(reported)
        return reported

    def drive(self, command: Signals) -> Signals:
        """What the motors do of what they are told."""
        for effect in self.effects:
            command = effect.drive(command)
        return command

    def surround(self, loads: Loads) -> Loads:
        for effect in self.effects:
            loads = effect.surround(loads)
        return loads

    def stiffness(self, temperature: np.ndarray, clock: np.ndarray) -> np.ndarray:
        """(n,) of the body over that described."""
        stiffness = np.ones(len(clock))
        for effect in self.effects:
            stiffness = stiffness * effect.soften(temperature, clock)
        return stiffness

    def spring(self, spring: Spring) -> Spring:
        for effect in self.effects:
            spring = effect.spring(spring)
        return spring

    @property
    def route(self) -> Route:
        """Along the tendons: the first friction of each kind, the first that beds in or has play, all stretch, the least stall."""
        routes = [e.route() for e in self.effects]
        rubbing, beds = (next((r for r in routes if getattr(r, kind) > 0.0), Route()) for kind in ("mu", "bedding"))
        loose = next((r for r in routes if any(r.play)), Route())
        bearing = next((r.bearing for r in routes if r.bearing != Bearing()), Bearing())
        return Route(
            rubbing.mu, rubbing.presliding, sum(r.stretch for r in routes), beds.bedding, beds.bedding_tension,
            bearing, max((r.mounted for r in routes), default=0.0), min((r.stall for r in routes), default=np.inf),
            max((r.hooked for r in routes), default=0.0), loose.play, loose.swap,
        )  # fmt: skip

    @property
    def creep(self) -> Creep:
        """The delayed strains of all of them, one element after the other."""
        creeps = [e.deform() for e in self.effects]
        return Creep(tuple(a for c in creeps for a in c.amplitude), tuple(t for c in creeps for t in c.time))

    def sense(self, true: Signals) -> Signals:
        """What the sensors say of the true signals."""
        for effect in self.effects:
            true = effect.sense(true)
        return true
