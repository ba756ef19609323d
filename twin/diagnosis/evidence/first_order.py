"""First-order patterns of the effects that a model lacks: the change of the whitened residual as each is switched on."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.calibration.objective import Objective
from twin.effects import FitStart, catalogue
from twin.effects.base.scaling import scaled_parameters, scaled_starts
from twin.foundation.errors import TwinError
from twin.prediction.prepared import PreparedRecording
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class Pattern:
    """The first-order pattern of an effect: its start, the amplitudes switched on one by one, and the indices of their columns."""

    effect: str
    start: FitStart
    amplitudes: tuple[str, ...]
    where: tuple[int, ...]

    def least(self, n_tendon: int) -> np.ndarray:
        """Return the least value of each amplitude, counted from OFF (n,): zero for a one-sided one."""
        table = {p.name: p for p in catalogue()[self.effect].all_parameters(n_tendon)}
        return np.array([0.0 if table[n].low >= table[n].value else -np.inf for n in self.amplitudes])


@dataclass(frozen=True)
class Dictionary:
    """First-order patterns of all effects not yet in a fitted model: white columns (n, n_column), per unit of each amplitude."""

    patterns: tuple[Pattern, ...]
    columns: np.ndarray

    def beside(self, effects: Collection[str]) -> Dictionary:
        """Return the dictionary without the patterns of these effects and of those confusable with them."""
        left = [
            p for p in self.patterns if p.effect not in effects and not set(catalogue()[p.effect].confusable_with) & set(effects)
        ]
        return Dictionary(tuple(left), self.columns)


def dictionary(objective: Objective, fit: Fit, among: Collection[str] | None = None) -> Dictionary:
    """Return patterns of the effects of the catalogue (or `among` these) that the model lacks.

    Left out are effects whose needs the robot or the data do not meet, and those confusable with one in the model.
    """
    prepared = objective.prepared
    present = {e.id for e in fit.model.twin.effects}
    predicted = [fit.model.twin.effect_chain.sense(t.true) for t in fit.evaluation.traces.values()]
    patterns: list[Pattern] = []
    neighbours: dict[Twin, tuple[Model, float]] = {}
    index: dict[Twin, int] = {}  # several starts may share a pattern
    parts = prepared.robot.build().features
    for identifier, law in catalogue().items():
        if (
            identifier in present
            or present & set(law.confusable_with)
            or not law.needs <= parts
            or not (among is None or identifier in among)
        ):
            continue
        for start in (s for s in scaled_starts(law, predicted, prepared.n_tendon, prepared.robot.size) if s.needs <= parts):
            try:
                models, names = _patterns(fit.model, prepared, identifier, start)
            except TwinError:
                continue
            where = tuple(index.setdefault(m.twin, len(index)) for m, _ in models)
            patterns.append(Pattern(identifier, start, tuple(names), where))
            neighbours |= {m.twin: (m, size) for m, size in models}
    # a model without an equilibrium has a column of zeros, and so no gain
    return Dictionary(tuple(patterns), objective.columns(fit.evaluation, list(neighbours.values()), unsolved="zeros"))


def _patterns(
    model: Model, prepared: PreparedRecording, identifier: str, start: FitStart
) -> tuple[list[tuple[Model, float]], list[str]]:
    """Return, for each amplitude of the effect, the model with that amplitude alone switched on, and by how much."""
    law = catalogue()[identifier]
    off = {p.name: p.value for p in scaled_parameters(law, prepared.n_tendon, prepared.robot.size)}
    shape = {k: v for k, v in start.values.items() if k in law.inactive_when_off}
    names = [n for n in start.free if n not in law.inactive_when_off]
    models = []
    for name in names:
        value = start.values.get(name, off[name])
        models.append((model.with_effect(identifier, {**shape, name: value}, (), prepared.n_tendon), value - off[name]))
    return models, names
