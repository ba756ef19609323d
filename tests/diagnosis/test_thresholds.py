"""Every threshold of the diagnosis stands in one table, with its reason and its evidence."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import twin.diagnosis
from twin.diagnosis import thresholds
from twin.diagnosis.thresholds import TABLE

FILES = sorted(p for p in Path(twin.diagnosis.__file__).parent.rglob("*.py") if p.name != "thresholds.py")


def numbers(tree: ast.Module) -> list[str]:
    """Names of a module's constants that are numbers, or tuples and tables of numbers."""
    found = []
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(
            isinstance(x, ast.Constant) and isinstance(x.value, int | float) for x in ast.walk(node.value)
        ):
            found += [ast.unparse(t) for t in node.targets]
    return found


@pytest.mark.parametrize("file", FILES, ids=lambda p: p.stem)
def test_no_other_module_has_a_number_for_a_constant(file: Path) -> None:
    assert numbers(ast.parse(file.read_text(encoding="utf-8"))) == []


def test_every_row_has_a_unit_a_reason_and_evidence() -> None:
    for name, row in TABLE.items():
        assert row.unit, name
        assert len(row.reason.split()) >= 4 or row.evidence.startswith("derivation"), name
        assert row.evidence.startswith(("derivation: ", "judgement", "python -m ", "tools/")), name


def test_every_number_is_a_row_and_every_row_is_used() -> None:
    named = {n: v for n, v in vars(thresholds).items() if n.isupper() and isinstance(v, int | float)}
    rows = dict(TABLE)
    for name, value in named.items():
        row = rows.get(name) or next(r for n, r in rows.items() if n.startswith("MEMORY_") and r.value == value)
        assert row.value == value
    text = "\n".join(f.read_text(encoding="utf-8") for f in FILES)
    pairs = [v for n, v in vars(thresholds).items() if n.isupper() and isinstance(v, tuple) and n in text]  # MEMORY, EARTH, ...
    assert [n for n, row in TABLE.items() if n not in text and not any(row.value in pair for pair in pairs)] == []


def test_a_number_that_is_derived_is_what_its_derivation_gives() -> None:
    """By the row's own words, to the digits it is rounded to."""
    value = {name: row.value for name, row in TABLE.items()}
    two_sealed = next(n for n in range(2, 100) if round(value["SEALED"] * n) >= 2)
    for name, derived, within in (
        ("FEW", two_sealed, 0.0), ("PACE", value["FAST"] ** 0.5, 0.0), ("COARSE", 1000.0 * 0.1, 0.0),
        ("HUNDREDS", 1000.0**0.5, 0.06),
        ("SAME_NOISE", 0.6745 * 2.0**0.5 / 3.0, 0.1), ("MEETS", 4.0 * 0.01 / 2.0, 0.0), ("HASTY", 1.0 / 5.0, 0.0),
        ("GUMBEL_99", -(6.0**0.5) / np.pi * (0.5772 + np.log(-np.log(0.99))), 1e-3), ("CLEAR", 5.0**2, 0.0),
        ("SESSION", 3 * 24 * 3600.0, 0.0), ("WINDOW", 2 * 3 + 1, 0.0), ("FAINT", 1.0 / 3.0, 0.0), ("ROUNDING", 1.0, 0.0),
        ("EXPLAINED", value["FITS"], 0.0), ("STILL", value["MEETS"], 0.0),
    ):  # fmt: skip
        assert abs(value[name] - derived) <= within * abs(derived), name
    assert 9.70 <= value["LEAST_GRAVITY"] < 9.78 < 9.83 < value["MOST_GRAVITY"] <= 9.91
    assert 2.0 * stats.norm.sf(value["LAG"]) == pytest.approx(2.0 / 30000.0, rel=0.1)
    assert 2.0 * stats.norm.sf(value["DOUBTFUL"]) == pytest.approx(0.003, rel=0.15)
    assert value["APART"] > (8.0 / 7.0) ** 2
    assert value["STEP"] < 1.0 / 4.0


@pytest.mark.parametrize("file", [*FILES, Path(thresholds.__file__)], ids=lambda p: p.stem)
def test_functions_are_short_and_take_little(file: Path) -> None:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            assert (node.end_lineno or 0) - node.lineno < 60, node.name
            assert len([*node.args.args, *node.args.kwonlyargs]) <= 7, node.name
