"""The rules of the decision, each with what the diagnosis does without it.

A threshold is set to the value at which it decides nothing; a function is replaced by one that changes nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from tools.benchmarks.diagnosis.memory import Memory, replaced
from twin.diagnosis.checks.fit_warnings import far_from_description, strained
from twin.diagnosis.checks.mixed_robots import mixed_robots
from twin.diagnosis.evidence.fast_error import fast_error
from twin.diagnosis.evidence.left_out import proven
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.evidence.scored_model import ScoredModel, with_extended_law
from twin.diagnosis.explain.error_location import misbent_segment
from twin.diagnosis.explain.words import change
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.noise.friction import noise_credit
from twin.diagnosis.search import search as search_stage
from twin.diagnosis.search.choose import add_one_effect, halved, most_predictive, predicting
from twin.diagnosis.search.lag_or_delay import lag_or_delay
from twin.diagnosis.thresholds import THRESHOLDS
from twin.diagnosis.verdict import gate as gate_stage
from twin.diagnosis.verdict.judge import find_caveats, unsure
from twin.diagnosis.verdict.resolve_ties import resolve_ties

NEVER, ALWAYS = 1e12, 0.0


@dataclass(frozen=True)
class Rule:
    """A rule and its absence.

    `thresholds`: values at which these decide nothing. `functions`: what stands in their place. `method`: a method of the fit
    context, in the same way. `scores`: whether scores of fits depend on it.
    """

    name: str
    thresholds: dict[str, float] | None = None
    functions: dict[Callable[..., Any], Callable[..., Any]] | None = None
    method: tuple[str, Callable[..., Any]] | None = None
    scores: bool = False


def _threshold(name: str, value: float) -> Rule:
    return Rule(name, {name: value})


def _function(function: Callable[..., Any], instead: Callable[..., Any]) -> Rule:
    return Rule(function.__name__.lstrip("_"), functions={function: instead})


def _small(context: FitContext, limits: AcceptanceLimits, best: ScoredModel, without: ScoredModel) -> bool:
    return gate_stage.contribution(context, best, without) < limits.visible


RULES: tuple[Rule, ...] = (
    _threshold("LEAST_EVIDENCE", ALWAYS),
    _threshold("LEAST_CONTRIBUTION", ALWAYS),
    _threshold("STRUCTURE_AS_BUILT", ALWAYS),
    _threshold("LARGEST_SPECTRAL_LINE", NEVER),
    _threshold("FAINT_LINE_SHARE", 1.0),
    _threshold("CANDIDATES_REFITTED", 2),
    _threshold("STARTS_PER_EFFECT", 1),
    _threshold("BEAM_WIDTH", 1),
    _threshold("WHITER_MODEL_LEAVES", ALWAYS),
    _threshold("LAW_FORM_SHARE", ALWAYS),
    _threshold("LEFT_BY_EFFECTS", 1.0),
    _threshold("LEFT_BY_EACH_EFFECT", 1.0),
    _threshold("SETS_FITTED_TO_HALVES", 1),
    _threshold("WORSE_ERROR_RATIO", 1.0),
    _threshold("LEFTOVER_SHARE", NEVER),
    _threshold("LARGE_STRUCTURE", ALWAYS),
    _threshold("LARGE_STRUCTURE_WITHOUT_EFFECT", ALWAYS),
    _threshold("SCORE_TEMPERATURE", 2.0),
    _threshold("CLEAR_CHI_SQUARE", ALWAYS),
    _threshold("LOOP_SIGNIFICANCE", NEVER),
    _function(search_stage.exchanged, lambda context, best, known: best),
    Rule("leaner", functions={search_stage._leaner: lambda context, base, best, known, accept: best}),
    _function(noise_credit, lambda context, more, less: 0.0),
    _function(with_extended_law, lambda context, found, accept: found),
    _function(predicting, lambda context, found, accept: found.best),
    _function(most_predictive, lambda context, found: None),
    _function(add_one_effect, lambda context, core, found, limits: core),
    _function(lag_or_delay, lambda context, found: found),
    _function(gate_stage._may_be_form, lambda context, limits, best, without, least: False),
    _function(gate_stage._ambiguity, lambda context, found, screening, best, without: None),
    _function(gate_stage._immaterial, _small),
    _function(resolve_ties, lambda context, found, gated, limits: (found, gated)),
    _function(proven, lambda context, fitted, known: known),
    _function(mixed_robots, lambda prepared, trials, fitted: None),
    _function(find_caveats, lambda context, model: ()),
    _function(far_from_description, lambda fitted: ""),
    _function(strained, lambda fitted: []),
    _function(misbent_segment, lambda prepared, trials, rest, predicted: None),
    _function(change, lambda prepared, trials, z: None),
    _function(fast_error, lambda context, model: 0.0),
    _function(halved, lambda context, base, best: True),
    _function(unsure, lambda claims, either: ()),
    Rule("blocked_input_noise", method=("blocked_input_noise", lambda self, fitted: 0.0), scores=True),
)  # fmt: skip


@contextmanager
def without(rules: tuple[Rule, ...], memory: Memory) -> Iterator[None]:
    """Take rules out of the diagnosis."""
    with ExitStack() as stack:
        if any(rule.scores for rule in rules):
            stack.enter_context(_forgotten(memory))
        for rule in rules:
            if rule.thresholds:
                stack.enter_context(_set(rule.thresholds))
            if rule.functions:
                stack.enter_context(replaced(rule.functions))
            if rule.method:
                name, instead = rule.method
                own = getattr(FitContext, name)
                setattr(FitContext, name, instead)
                stack.callback(setattr, FitContext, name, own)
        yield


@contextmanager
def _set(values: dict[str, float]) -> Iterator[None]:
    """Give thresholds other values in all modules that import them."""
    changed = []
    for name, module in list(sys.modules.items()):
        for threshold, value in values.items():
            if name.startswith("twin.diagnosis.") and threshold in THRESHOLDS and hasattr(module, threshold):
                changed.append((module, threshold, getattr(module, threshold)))
                setattr(module, threshold, value)
    try:
        yield
    finally:
        for module, threshold, value in changed:
            setattr(module, threshold, value)


@contextmanager
def _forgotten(memory: Memory) -> Iterator[None]:
    """Let scores be computed anew, and not be kept."""
    known = memory.known
    memory.known = {k: v for k, v in known.items() if k[0] != "score"}
    try:
        yield
    finally:
        memory.known = known
