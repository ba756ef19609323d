"""Fits and what follows from them, kept in memory while one day is decided again and again.

A fit is known again by its trials, its start, the derivatives given to it, and its stop rule; what is computed of a fit by that
fit. While a memory is in force, the modules of `twin.diagnosis` that import one of the kept functions get it from there.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from twin.diagnosis.calibration.fit import Fit, StopRule, fit
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.calibration.objective import Evaluation, Objective
from twin.diagnosis.evidence.first_order import Dictionary, dictionary
from twin.diagnosis.evidence.half_session import halves
from twin.diagnosis.evidence.left_out import LeftOut, left_out
from twin.diagnosis.evidence.null_distribution import NullDraws, draws
from twin.diagnosis.evidence.scored_model import ScoredModel, score_model
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search.choose import solves
from twin.foundation.errors import SolveError
from twin.prediction.twin import Twin


class Memory:
    """What was computed for one day."""

    def __init__(self) -> None:
        self.known: dict[Any, Any] = {}
        self.kept: list[Any] = []  # objects known by identity live as long as this

    def _once(self, key: Any, made: Callable[[], Any]) -> Any:
        """Return what is known by a key; a SolveError is known, too."""
        if key not in self.known:
            try:
                self.known[key] = made()
            except SolveError as error:
                self.known[key] = error
        found = self.known[key]
        if isinstance(found, SolveError):
            raise found
        return found

    def _same(self, thing: Any) -> int:
        self.kept.append(thing)
        return id(thing)

    def fit(
        self, objective: Objective, model: Model, *, near: Evaluation | None = None, J: np.ndarray | None = None,
        refresh: bool = False, stop: StopRule | None = None,
    ) -> Fit:  # fmt: skip
        """Return `fit` of these, made once."""
        stop = stop or StopRule()
        whitener, trials = self._same(objective.whitener.noise), tuple(objective.trials)
        key = ("fit", whitener, trials, _model(model), near and _model(near.model), _bytes(J), refresh, stop)
        return self._once(key, lambda: fit(objective, model, near=near, J=J, refresh=refresh, stop=stop))

    def dictionary(self, objective: Objective, fitted: Fit, among: Any = None) -> Dictionary:
        """Return `dictionary` of these, made once."""
        key = ("dictionary", self._same(fitted), None if among is None else tuple(sorted(among)))
        return self._once(key, lambda: dictionary(objective, fitted, among))

    def draws(self, context: FitContext, base: Fit, known: Dictionary, seed: int) -> NullDraws:
        """Return `draws` of these, made once."""
        return self._once(("draws", self._same(base), self._same(known), seed), lambda: draws(context, base, known, seed))

    def left_out(self, context: FitContext, fitted: Fit, groups: Any = None) -> LeftOut:
        """Return `left_out` of these, made once."""
        return self._once(("left out", self._same(fitted), repr(groups)), lambda: left_out(context, fitted, groups))

    def halves(self, context: FitContext, weighed: ScoredModel) -> LeftOut:
        """Return `halves` of these, made once."""
        return self._once(("halves", self._same(weighed.fit)), lambda: halves(context, weighed))

    def score_model(self, context: FitContext, fitted: Fit) -> ScoredModel:
        """Return `score_model` of these, made once."""
        return self._once(("score", self._same(fitted)), lambda: score_model(context, fitted))

    def solves(self, context: FitContext, twin: Twin) -> bool:
        """Return `solves` of these, made once."""
        return self._once(("solves", _twin(twin)), lambda: solves(context, twin))

    @contextmanager
    def in_force(self) -> Iterator[None]:
        """Let the diagnosis take what is kept from here."""
        kept = {
            fit: self.fit, dictionary: self.dictionary, draws: self.draws, left_out: self.left_out, halves: self.halves,
            score_model: self.score_model, solves: self.solves,
        }  # fmt: skip
        with replaced(kept):
            yield


@contextmanager
def replaced(by: dict[Any, Any]) -> Iterator[None]:
    """Put other functions in the place of these, in all modules of `twin.diagnosis` that know them by name."""
    changed = []
    for name, module in list(sys.modules.items()):
        if name.startswith("twin.diagnosis"):
            for attribute, value in list(vars(module).items()):
                if callable(value) and getattr(value, "__hash__", None) and value in by:
                    changed.append((module, attribute, value))
                    setattr(module, attribute, by[value])
    try:
        yield
    finally:
        for module, attribute, value in changed:
            setattr(module, attribute, value)


def _twin(twin: Twin) -> Any:
    effects = tuple((e.id, tuple(sorted(e.values.items()))) for e in twin.effects)
    return tuple(sorted(twin.values.items())), effects


def _model(model: Model) -> Any:
    return _twin(model.twin), tuple(f.label for f in model.free)


def _bytes(J: np.ndarray | None) -> bytes | None:
    return None if J is None else hashlib.blake2b(np.ascontiguousarray(J).tobytes()).digest()
