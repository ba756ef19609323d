"""The stages in order: what each hands on is what the next one gets."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.diagnosis.checks.test_design import bench
from tests.report.small_diagnosis import diagnosis
from tools.simulators.rod.design import bench_day
from twin.diagnosis import Settings, pipeline
from twin.diagnosis.budget import Budget
from twin.diagnosis.diagnosis import Missed
from twin.diagnosis.pipeline import conclude
from twin.diagnosis.split import blind


def test_every_stage_gets_what_the_one_before_made(monkeypatch: pytest.MonkeyPatch) -> None:
    got: dict[str, tuple[Any, ...]] = {}

    def stage(name: str, result: Any) -> None:
        def run(*arguments: Any) -> Any:
            got[name] = arguments
            return result

        monkeypatch.setattr(pipeline, name, run)

    screening: Any = SimpleNamespace(patterns="patterns", limits="bars")
    study = SimpleNamespace(budget=Budget(0.0), prepared=SimpleNamespace(inputs=()))
    assert not study.budget.allows("friction")
    stage("calibrate", (study, "base", ["a note"]))
    stage("fast_motion", None)
    stage("screen", screening)
    stage("search", "found")
    stage("choose", "chosen")
    stage("lag_or_delay", "told")
    stage("gate", "gated")
    stage("resolve_ties", ("all told", "settled"))
    stage("judge", "judged")
    unsure = SimpleNamespace(verdict="explained")
    stage("with_systematic", unsure)
    settings = Settings(seed=7)
    made = conclude("bench", "twin", [2], "nominal", settings, "progress")  # type: ignore[arg-type]
    assert got == {
        "calibrate": ("bench", "twin", [2], "nominal", settings, "progress"),
        "fast_motion": (study, "base", "bench"),
        "screen": (study, "base", 7),
        "search": (study, "base", "patterns", "bars"),
        "choose": (study, "found", "bars"),
        "lag_or_delay": (study, "chosen"),
        "gate": (study, "told", screening),
        "resolve_ties": (study, "told", "gated", "bars"),
        "judge": (study, "all told", "settled", "bars"),
        "with_systematic": (study, "judged", "patterns"),
    }
    assert (made.context, made.found, made.gated, made.judged) == (study, "all told", "settled", unsure)
    assert made.notices[0] == "a note"
    assert "not tried: friction" in made.notices[1]


def test_what_was_measured_on_sealed_trials_is_not_there() -> None:
    day = bench(bench_day("default", np.random.default_rng(0)))
    hidden = blind(day, [1, 4])
    assert [k for k, y in enumerate(hidden.measured) if np.isnan(y).all()] == [1, 4]
    assert all(np.isfinite(y).all() for y in day.measured)
    assert hidden.inputs == day.inputs


@pytest.mark.parametrize(
    ("before", "claims", "folds", "after"),
    [
        ("explained", ("friction",), (), "partly_explained"),
        ("noise", (), (), "unexplained"),
        ("explained", ("friction",), ("each in turn",), "explained"),
        ("partly_explained", ("friction",), (), "partly_explained"),
    ],
)
def test_a_missed_held_out_trial_bars_explained_and_noise(
    before: str, claims: tuple[Any, ...], folds: tuple[Any, ...], after: str
) -> None:
    """Where trials were held out in turn, the final twin was fitted to the one that a part of them misses; it is told all the same.
    Where the fitted trials are not explained either, it is nothing new."""
    d = replace(diagnosis(before), claims=claims, folds=folds)
    missed = replace(d, errors=replace(d.errors, missed=(Missed(4, "marker", 1.2e-3, 0.44e-3),)))
    words = (
        "it misses held-out circle_4 by 1.2 mm in position (noise floor 0.44 mm): "
        "the fitted trials do not show everything that happens there"
    )
    doubted = pipeline._doubted(missed)
    assert doubted.verdict == after
    assert doubted.caveats == (d.caveats if before == "partly_explained" else (*d.caveats, words))
    assert pipeline._doubted(d) is d
