"""The verdict from its signs, and the probabilities: by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnose.judge import Signs, probability, verdict
from twin.diagnose.null import Thresholds

BARS = Thresholds()
CLEAN = Signs(before=2.0, after=0.02, unseen=0.03, line=(2.0, 0.1), halved=True, strange=False, strained=())


@pytest.mark.parametrize(
    ("added", "changed", "said"),
    [
        (True, {}, "explained"),
        (True, {"strange": True}, "partly_explained"),
        (True, {"after": 0.35}, "partly_explained"),  # above 0.12 and 15 % of 2.0
        (True, {"after": 0.25}, "explained"),  # above 0.12, below 15 % of 2.0
        (True, {"unseen": 0.5}, "partly_explained"),  # much on trials left out
        (True, {"unseen": 0.5, "halved": False}, "unexplained"),
        (True, {"line": (31.0, 0.1)}, "partly_explained"),
        (False, {}, "noise"),
        (False, {"after": 0.29, "before": 0.29}, "noise"),
        (False, {"after": 0.31, "before": 0.31}, "unexplained"),
        (False, {"line": (11.0, 0.1)}, "unexplained"),  # no law was fitted that could leave a line of 10
        (False, {"unseen": 0.5}, "unexplained"),
    ],
)
def test_the_verdict_follows_its_signs(added: bool, changed: dict[str, Any], said: str) -> None:
    assert verdict(added, replace(CLEAN, **changed), BARS) == said


def sets(**scores: float) -> Any:
    made = [SimpleNamespace(effects=tuple(n.split("__")) if n != "none" else (), score=s) for n, s in scores.items()]
    return SimpleNamespace(all=tuple(made))


def test_probability_is_the_tempered_share_of_the_sets_with_the_effect() -> None:
    found = sets(friction=0.0, creep=-20.0, none=-400.0)
    weights = np.exp(np.array([0.0, -1.0, -20.0]))  # a factor e for 20 of score
    assert probability(found, "friction", set()) == pytest.approx(weights[0] / weights.sum())
    assert probability(found, "creep", set()) == pytest.approx(weights[1] / weights.sum())


def test_a_set_with_an_immaterial_effect_does_not_count() -> None:
    found = sets(friction=0.0, friction__delay=30.0, creep=0.0)
    assert probability(found, "friction", {"delay"}) == pytest.approx(0.5)
    assert probability(found, "friction", set()) > 0.5
