"""The table that sets other ways to name an effect beside the diagnosis."""

from __future__ import annotations

from tests.recorded_days import recorded_day
from tools.benchmarks.diagnosis.second_opinion.forward_bic import forward_bic
from tools.benchmarks.diagnosis.second_opinion.start import Calibrated
from tools.benchmarks.diagnosis.second_opinion.table import table
from twin.diagnosis import Settings
from twin.prediction.twin import Twin


def answer(*named: str, missing: bool | None = None, after: float = 1.0) -> dict:
    return {"missing": bool(named) if missing is None else missing, "named": list(named), "after": after, "seconds": 1.0,
            "flagged": bool(missing) and not named}  # fmt: skip


def cells(text: str, label: str) -> list[str]:
    return next(line for line in text.splitlines() if line.startswith(label)).removeprefix(label).split()


def test_answers_are_counted_by_class_of_effects() -> None:
    tilt, camera, contact, friction = "base_tilt", "camera_misalignment", "contact", "tendon_friction"
    rows = [
        {"true": [], "answers": {"a": answer(), "b": answer(missing=True)}},
        {"true": [tilt], "answers": {"a": answer(camera), "b": answer(tilt, friction, after=2.0)}},
        {"true": [tilt], "answers": {"a": answer(missing=True), "b": answer(friction, tilt, after=2.0)}},
        {"true": ["helix"], "answers": {"a": answer(missing=True), "b": answer(tilt)}},
        {"true": [tilt, contact], "answers": {"a": answer(contact, tilt), "b": answer(contact, friction)}},
    ]
    text = table([{"floor": 1.0, "calibrated": 1.5, **row} for row in rows])
    assert cells(text, "false positives on no-effect sets") == ["0/1", "1/1"]
    assert cells(text, "out of catalogue, flagged") == ["1/1", "0/1"]
    assert cells(text, "says something is missing, one effect") == ["2/2", "2/2"]
    assert cells(text, "right effect first, one effect") == ["1/2", "1/2"]
    assert cells(text, "exact set, one effect") == ["1/2", "0/2"]
    assert cells(text, "first is a true one, two effects") == ["1/1", "1/1"]
    assert cells(text, "exact set, two effects") == ["1/1", "0/1"]
    assert cells(text, "held-out after / floor, singles") == ["1.00", "(1.00)", "2.00", "(2.00)"]
    assert cells(text, "worse than calibrated on held-out trials") == ["0/5", "2/5"]


def test_a_run_without_pairs_has_a_table() -> None:
    row = {"true": [], "floor": 1.0, "calibrated": 1.0, "answers": {"a": answer()}}
    assert cells(table([row]), "held-out after / floor, pairs") == ["-"]


def test_an_opinion_starts_where_the_diagnosis_does_and_names_friction() -> None:
    """2.5 times the drawn friction on six trials: what any selection must see."""
    recording = recorded_day("tendon_friction", 2.5)[0].select(["slow_1", "slow_2", "pair_3", "circle_1", "circle_2", "wander_3"])
    start = Calibrated.of(recording, Twin.of("continuum"), Settings())
    found = forward_bic(start)
    assert "tendon_friction" in found.named
    assert start.held_out(found.twin) < 0.8 * start.held_out(start.fit.model.twin)
