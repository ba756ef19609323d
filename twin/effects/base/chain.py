"""The chain of effects in force, applied in the order of the signal.

Prediction, loaded robots, controllers and rollouts all apply effects through it:

    reported -> command -> drive -> drive train
             -> [the body, edited, under surround, route, spring, deform, soften] -> drive train -> sense -> reported
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce

import numpy as np

from twin.body import ROPE_FEATURES, Bearing, Body, Bumpers, Creep, Loads, Route, Rubbing, Signals
from twin.body.drives.drive_train import DriveTrain
from twin.body.drives.spring import Spring
from twin.effects import Effect
from twin.foundation.errors import DataError


@dataclass(frozen=True)
class EffectChain:
    """Effects in the order in which they act on a signal, and the robot's own drive train between them and its tendons."""

    effects: tuple[Effect, ...]
    train: DriveTrain = field(default_factory=DriveTrain)

    def edit(self, body: Body, robot: str) -> None:
        """Change a body that is not compiled yet. Raises DataError as `check_body`."""
        self.check_body(body, robot)
        for effect in self.effects:
            effect.edit(body)

    def check_body(self, body: Body, robot: str) -> None:
        """Raise DataError for an effect that cannot act on the body of the `robot`."""
        for effect in self.effects:
            if missing := effect.needs - body.features:
                what = " and ".join(sorted(missing))
                raise DataError(f"effect {effect.id} acts on {what}, which robot {robot!r} has not: remove the effect")
            if effect.depends_on_tendons() and effect.n_tendon != body.n_tendon:
                raise DataError(
                    f"effect {effect.id} has parameters for {effect.n_tendon} tendons and robot {robot!r} has {body.n_tendon} "
                    f"tendons: give n_tendon={body.n_tendon}"
                )
            if np.isfinite(effect.route().stall_tension) and not body.features >= ROPE_FEATURES:
                raise DataError(f"effect {effect.id}: motors that stall are not solved on robot {robot!r}: leave `stall` out")
            if effect.route().bedding > 0.0 and body.pushes:
                raise DataError(f"effect {effect.id}: rope beds in, and robot {robot!r} has rods: leave `toe` out")

    def command(self, reported: Signals) -> Signals:
        """Return the true inputs from the reported ones."""
        for effect in reversed(self.effects):
            reported = effect.command(reported)
        return reported

    def drive(self, command: Signals) -> Signals:
        """Return what the drives deliver for a command."""
        for effect in self.effects:
            command = effect.drive(command)
        return self.train.deliver(command)

    def surround(self, loads: Loads) -> Loads:
        """Return the loads that act on the body."""
        for effect in self.effects:
            loads = effect.surround(loads)
        return loads

    def stiffness(self, temperature: np.ndarray, clock: np.ndarray) -> np.ndarray:
        """Return the body's stiffness over the described one (n,) at `temperature` (n,) K and `clock` (n,) s."""
        stiffness = np.ones(len(clock))
        for effect in self.effects:
            stiffness = stiffness * effect.soften(temperature, clock)
        return stiffness

    def spring(self, spring: Spring) -> Spring:
        """Return the SMA springs that pull."""
        for effect in self.effects:
            spring = effect.spring(spring)
        return spring

    @property
    def route(self) -> Route:
        """The tendons' properties: the first friction, bedding and backlash of all effects, the sum of stretch, the least stall."""
        routes = [e.route() for e in self.effects]
        friction = next((r for r in routes if r.mu > 0.0), Route())
        bedding = next((r for r in routes if r.bedding > 0.0), Route())
        backlash = next((r for r in routes if any(r.backlash)), Route())
        route = Route(
            mu=friction.mu,
            presliding=friction.presliding,
            mu_shares=friction.mu_shares,
            stretch=sum(r.stretch for r in routes),
            bedding=bedding.bedding,
            bedding_tension=bedding.bedding_tension,
            bearing=next((r.bearing for r in routes if r.bearing != Bearing()), Bearing()),
            rubbing=reduce(Rubbing.beside, (r.rubbing for r in routes), Rubbing()),
            bumpers=next((r.bumpers for r in routes if r.bumpers.give > 0.0), Bumpers()),
            rest_bend_share=max((r.rest_bend_share for r in routes), default=0.0),
            stall_tension=min((r.stall_tension for r in routes), default=np.inf),
            initial_stretch_share=max((r.initial_stretch_share for r in routes), default=0.0),
            backlash=backlash.backlash,
            crossing_travel=backlash.crossing_travel,
        )
        return self.train.add_to(route)

    @property
    def creep(self) -> Creep:
        """The creep elements of all effects, one after the other."""
        creeps = [e.deform() for e in self.effects]
        return Creep(tuple(a for c in creeps for a in c.amplitude), tuple(t for c in creeps for t in c.time))

    def sense(self, true: Signals) -> Signals:
        """Return the reported signals from the true ones."""
        true = self.train.read(true)
        for effect in self.effects:
            true = effect.sense(true)
        return true
