"""Every threshold of the diagnosis stands in one table, with its reason and its evidence."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import twin.diagnosis
from twin.diagnosis import thresholds
from twin.diagnosis.thresholds import THRESHOLDS

FILES = sorted(p for p in Path(twin.diagnosis.__file__).parent.rglob("*.py") if p.name != "thresholds.py")
ESTIMATORS = ("calibration", "noise")  # their numbers are tolerances of a method and stand beside its equation


def numbers(tree: ast.Module) -> list[str]:
    """Names of a module's constants that are numbers, or tuples and tables of numbers."""
    found = []
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(
            isinstance(x, ast.Constant) and isinstance(x.value, int | float) for x in ast.walk(node.value)
        ):
            found += [ast.unparse(t) for t in node.targets]
    return found


@pytest.mark.parametrize(
    "file", [f for f in FILES if f.parent.name not in ESTIMATORS and f.stem != "polynomial"], ids=lambda p: p.stem
)  # the polynomial is a rival's, and decides nothing
def test_no_other_module_that_decides_has_a_number_for_a_constant(file: Path) -> None:
    assert numbers(ast.parse(file.read_text(encoding="utf-8"))) == []


def test_every_row_has_a_unit_a_reason_and_evidence() -> None:
    for name, row in THRESHOLDS.items():
        assert row.unit, name
        assert len(row.reason.split()) >= 4 or row.evidence.startswith("derivation"), name
        assert row.evidence.startswith(("derivation: ", "judgement", "python -m ", "tools/")), name


def test_every_number_is_a_row_and_every_row_is_used() -> None:
    named = {n: v for n, v in vars(thresholds).items() if n.isupper() and isinstance(v, int | float)}
    rows = dict(THRESHOLDS)
    for name, value in named.items():
        row = rows.get(name) or next(r for n, r in rows.items() if n.startswith("MEMORY_") and r.value == value)
        assert row.value == value
    text = "\n".join(f.read_text(encoding="utf-8") for f in FILES)
    pairs = [v for n, v in vars(thresholds).items() if n.isupper() and isinstance(v, tuple) and n in text]  # GRAVITY_RANGE, ...
    assert [n for n, row in THRESHOLDS.items() if n not in text and not any(row.value in pair for pair in pairs)] == []


def test_a_number_that_is_derived_is_what_its_derivation_gives() -> None:
    """By the row's own words, to the digits it is rounded to."""
    value = {name: row.value for name, row in THRESHOLDS.items()}
    two_sealed = next(n for n in range(2, 100) if round(value["HELD_OUT_SHARE"] * n) >= 2)
    for name, derived, within in (
        ("FEWEST_TRIALS_FOR_HELD_OUT", two_sealed, 0.0), ("SAME_RATE_RATIO", value["TWO_RATES_RATIO"] ** 0.5, 0.0),
        ("LONGEST_SAMPLE_INTERVAL", 1000.0 * 0.1, 0.0), ("UNIT_MISTAKE_RATIO", 1000.0**0.5, 0.06),
        ("COPIED_TRIAL_DIFFERENCE", 0.6745 * 2.0**0.5 / 3.0, 0.1), ("SAME_COMMAND_DISTANCE", 4.0 * 0.01 / 2.0, 0.0),
        ("SHORTEST_TRIAL", 1.0 / 5.0, 0.0), ("CLEAR_CHI_SQUARE", 5.0**2, 0.0), ("LONGEST_SESSION", 3 * 24 * 3600.0, 0.0),
        ("GUMBEL_99_QUANTILE", -(6.0**0.5) / np.pi * (0.5772 + np.log(-np.log(0.99))), 1e-3), ("SPIKE_WINDOW", 2 * 3 + 1, 0.0),
        ("FAINT_LINE_SHARE", 1.0 / 3.0, 0.0), ("START_TIME_ROUNDING", 1.0, 0.0),
        ("LEFT_BY_PATTERN", value["LEFT_BY_FILE_CHANGE"], 0.0), ("STILL_COMMAND_SHARE", value["SAME_COMMAND_DISTANCE"], 0.0),
    ):  # fmt: skip
        assert abs(value[name] - derived) <= within * abs(derived), name
    assert 9.70 <= value["LEAST_GRAVITY"] < 9.78 < 9.83 < value["MOST_GRAVITY"] <= 9.91
    assert 2.0 * stats.norm.sf(value["LOOP_SIGNIFICANCE"]) == pytest.approx(2.0 / 30000.0, rel=0.1)
    assert 2.0 * stats.norm.sf(value["UNLIKELY_PARAMETER_DISTANCE"]) == pytest.approx(0.003, rel=0.15)
    assert value["SINGLE_MARKER_ERROR_RATIO"] > (8.0 / 7.0) ** 2
    assert value["STEP_LEFTOVER_SHARE"] < 1.0 / 4.0


@pytest.mark.parametrize("file", [*FILES, Path(thresholds.__file__)], ids=lambda p: p.stem)
def test_functions_are_short_and_take_little(file: Path) -> None:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            assert (node.end_lineno or 0) - node.lineno < 60, node.name
            assert len([*node.args.args, *node.args.kwonlyargs]) <= 7, node.name
