"""Every threshold of the diagnosis stands in one table, with its reason and its evidence."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import twin.diagnose
from twin.diagnose import thresholds
from twin.diagnose.thresholds import TABLE

FILES = sorted(p for p in Path(twin.diagnose.__file__).parent.rglob("*.py") if p.name != "thresholds.py")


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


@pytest.mark.parametrize("file", [*FILES, Path(thresholds.__file__)], ids=lambda p: p.stem)
def test_functions_are_short_and_take_little(file: Path) -> None:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            assert (node.end_lineno or 0) - node.lineno < 60, node.name
            assert len([*node.args.args, *node.args.kwonlyargs]) <= 7, node.name
