"""A twin with the parameters that a fit may move: the robot's own uncertain ones, and those of effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.effects import effect_class
from twin.effects.base.scaling import scaled_effect, scaled_parameters
from twin.foundation.parameters import Parameter
from twin.prediction.twin import Twin
from twin.robots import Robot


@dataclass(frozen=True)
class Free:
    """One free parameter of a fit: of the robot (`effect` None) or of an effect."""

    effect: str | None
    parameter: Parameter

    @property
    def label(self) -> str:
        return self.parameter.name if self.effect is None else f"{self.effect}.{self.parameter.name}"


@dataclass(frozen=True)
class Model:
    """A twin and its free parameters."""

    twin: Twin
    free: tuple[Free, ...]

    @staticmethod
    def base(robot: Robot, twin: Twin | None = None) -> Model:
        """Return the robot as described, with its nuisance parameters and the uncertain ones of its known effects free."""
        twin = twin or Twin.of(robot)
        known = {e.id for e in twin.effects}
        free = (*(Free(None, p) for p in robot.nuisance), *(Free(e, p) for e, p in robot.uncertain if e in known))
        return Model(twin, free)

    def value(self, free: Free) -> float:
        if free.effect is None:
            return float(self.twin.values.get(free.parameter.name, free.parameter.value))
        return next(e for e in self.twin.effects if e.id == free.effect)[free.parameter.name]

    def vector(self) -> np.ndarray:
        """Return the free parameters (n_free,) in units of their steps."""
        return np.array([self.value(f) / f.parameter.step for f in self.free])

    def at(self, x: np.ndarray) -> Model:
        """Return the same model with its free parameters at x (in steps)."""
        values = dict(self.twin.values)
        effects: dict[str, dict[str, float]] = {e.id: dict(e.values) for e in self.twin.effects}
        for f, v in zip(self.free, x, strict=True):
            target = values if f.effect is None else effects[f.effect]
            target[f.parameter.name] = float(np.clip(v * f.parameter.step, f.parameter.low, f.parameter.high))
        built = tuple(type(e)(effects[e.id], e.n_tendon) for e in self.twin.effects)
        return Model(replace(self.twin, values=values, effects=built), self.free)

    def with_effect(self, identifier: str, values: Mapping[str, float], names: Sequence[str], n_tendon: int) -> Model:
        """Return this model with one effect more, its named parameters free."""
        law = effect_class(identifier)
        table = {p.name: p for p in scaled_parameters(law, n_tendon, self.twin.robot.size)}
        effects = (*self.twin.effects, scaled_effect(law, values, n_tendon, self.twin.robot.size))
        return Model(replace(self.twin, effects=effects), (*self.free, *(Free(identifier, table[n]) for n in names)))

    def without_effect(self, identifier: str) -> Model:
        effects = tuple(e for e in self.twin.effects if e.id != identifier)
        return Model(replace(self.twin, effects=effects), tuple(f for f in self.free if f.effect != identifier))


def prior_weight(model: Model) -> np.ndarray:
    """Return 1 / std (n_free,) in steps, zero where there is no prior."""
    return np.array([0.0 if f.parameter.std is None else f.parameter.step / f.parameter.std for f in model.free])


def prior_pull(model: Model) -> np.ndarray:
    """Return half the gradient (n_free,) of the prior terms, per step."""
    prior = np.array([f.parameter.value / f.parameter.step for f in model.free])
    return prior_weight(model) ** 2 * (model.vector() - prior)
