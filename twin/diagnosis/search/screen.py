"""Stage `screen`: what each effect would do to these data first, what noise alone would show, and what the design can tell."""

from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.checks.identifiability import Visibility, identifiability
from twin.diagnosis.evidence.first_order import Dictionary, dictionary
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits, acceptance_limits
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext


@dataclass(frozen=True)
class Screening:
    """First-order patterns of all effects that may be missing, what counts on this design, and what it tells of each effect."""

    patterns: Dictionary
    limits: AcceptanceLimits
    table: tuple[Visibility, ...]


def screen(context: FitContext, base: ScoredModel, seed: int) -> Screening:
    """Before any effect is sought; `seed` draws the no-effect sets."""
    patterns = dictionary(context.objective, base.fit)
    context.progress("no-effect sets of this design")
    limits = acceptance_limits(context, base.fit, patterns, seed)
    limits = replace(limits, accuracy=_accuracy(context))
    return Screening(patterns, limits, tuple(identifiability(context.objective, base.fit, patterns, limits.visible)))


def _accuracy(context: FitContext) -> float:
    """The twin's own accuracy over the mean sigma of the outputs it is declared for."""
    stated = context.accuracy[context.accuracy > 0.0]
    return 1.0 / float(np.mean(1.0 / stated)) if stated.size else 0.0
