"""The benchmark that takes rules out: one day by all rules and without some, what it leaves behind, and its tables."""

from __future__ import annotations

from typing import Any

import pytest

from tests.recorded_days import half, recorded_day
from tools.benchmarks.diagnosis import ablation
from tools.benchmarks.diagnosis.rules import RULES, Rule
from twin.diagnosis.evidence import null_distribution
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import THRESHOLDS
from twin.diagnosis.verdict import judge


def test_a_day_is_decided_with_and_without_rules() -> None:
    """A payload of 4 sigma: no evidence is enough for a rule that asks for endless evidence; without caveats it stays explained."""
    before = judge.find_caveats, null_distribution.LEAST_EVIDENCE, FitContext.blocked_input_noise
    rules = (
        Rule("endless evidence", {"LEAST_EVIDENCE": 1e9}),
        Rule("no caveats", functions={judge.find_caveats: lambda context, model: ()}),
        Rule("no blocked noise", method=("blocked_input_noise", lambda self, fitted: 0.0), scores=True),
    )
    day = ablation.Day(half(recorded_day("tip_payload", 4.0)[0]), 0)
    found = dict(day.answers(rules))
    assert found[ablation.AS_IT_IS]["claims"] == ["tip_payload"]
    assert found["endless evidence"]["claims"] == []
    assert set(found) == {ablation.AS_IT_IS, ablation.NO_WITHDRAWAL, "endless evidence"}, "the others change nothing"
    assert (judge.find_caveats, null_distribution.LEAST_EVIDENCE, FitContext.blocked_input_noise) == before
    assert day.floor


def test_rules_that_change_an_answer_only_together_are_listed_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of four, without `d` nothing is claimed; `a` and `b` stand in for each other."""
    day = object.__new__(ablation.Day)

    def answer(rules: tuple[Rule, ...], withdraws: bool) -> dict[str, Any]:
        out = {r.name for r in rules}
        claims = [] if "d" in out else ["tip_payload", *(["base_tilt"] if {"a", "b"} <= out else [])]
        return {"verdict": "explained", "claims": claims}

    monkeypatch.setattr(day, "_answer", answer)
    found = dict(day.answers(tuple(Rule(name) for name in "abcd")))
    assert set(found) == {ablation.AS_IT_IS, ablation.NO_WITHDRAWAL, ablation.TOGETHER, "d"}
    assert found[ablation.TOGETHER]["rules"] == ["a", "b"]
    assert found["d"]["claims"] == []


def test_rules_name_thresholds_that_there_are_and_each_once() -> None:
    names = [rule.name for rule in RULES]
    assert len(names) == len(set(names))
    assert {t for rule in RULES for t in rule.thresholds or {}} <= set(THRESHOLDS)


def row(seed: int, kind: str, true: list[str], **answers: dict[str, Any]) -> dict[str, Any]:
    told = {"probability": [1.0], "after": 5e-4, "calibrated": 9e-4}
    return {
        "seed": seed, "kind": kind, "true": true, "sigmas": [3.0] * len(true), "amplitude": 3.0, "floor": 5e-4,
        "answers": {name: {**told, **a} for name, a in answers.items()},
    }  # fmt: skip


def test_the_tables_count_changes_by_half(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ablation, "AS_IT_IS", "all")
    monkeypatch.setattr(ablation, "RULES", (Rule("a"), Rule("b")))
    right: dict[str, Any] = {"verdict": "explained", "claims": ["tip_payload"]}
    none: dict[str, Any] = {"verdict": "noise", "claims": []}
    rows = [
        row(2, "one", ["tip_payload"], all=right, a=none, b=right),
        row(4, "none", [], all=none, a=none, b=right),
        row(3, "one", ["tip_payload"], all=right, a=right, b=right),
    ]
    assert ablation.counts(rows[:2], "all")["one first"] == (1, 1)
    assert ablation.counts(rows[:2], "a")["one first"] == (0, 1)
    assert ablation.counts(rows[:2], "b")["false"] == (1, 1)
    developing, reporting = ablation.table(rows).split("Days for reporting: ")
    assert "| a | 1 |  | -1 |" in developing
    assert "| b | 1 | +1 |  |" in developing
    assert reporting.startswith("1")
    assert "+1" not in reporting
