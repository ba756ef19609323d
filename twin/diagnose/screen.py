"""Stage `screen`: what each effect would do to these data first, what noise alone would show, and what the design can tell."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from twin.diagnose.identifiability import Visibility, identifiability
from twin.diagnose.null import Thresholds, thresholds
from twin.diagnose.patterns import Dictionary, dictionary
from twin.diagnose.study import Study
from twin.diagnose.weigh import Weighed


@dataclass(frozen=True)
class Screening:
    """First-order patterns of all effects that may be missing, what counts on this design, and what it tells of each effect."""

    patterns: Dictionary
    bars: Thresholds
    table: tuple[Visibility, ...]


def screen(study: Study, base: Weighed, seed: int) -> Screening:
    """Before any effect is sought; `seed` draws the no-effect sets."""
    patterns = dictionary(study.objective, base.fit)
    study.progress("no-effect sets of this design")
    bars = thresholds(study, base.fit, patterns, seed)
    bars = replace(bars, accuracy=_accuracy(study))
    return Screening(patterns, bars, tuple(identifiability(study.objective, base.fit, patterns, bars.visible)))


def _accuracy(study: Study) -> float:
    """The twin's own accuracy over the mean sigma of the outputs it is declared for."""
    stated = study.accuracy[study.accuracy > 0.0]
    return 1.0 / float(np.mean(1.0 / stated)) if stated.size else 0.0
