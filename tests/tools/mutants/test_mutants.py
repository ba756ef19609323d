"""The mutants themselves: each changes one line, still is a program, and those written down by hand still have a line to change."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tools.mutants.by_hand import CHANGES, by_hand
from tools.mutants.groups import GROUPS, group_of
from tools.mutants.mutant import Mutant
from tools.mutants.operators import mutants

ROOT = Path(__file__).parents[3]
TEXT = '''"""Words - 1 < 2."""
def f(x: int = 3) -> float:
    if not (x < 2.0 and x != 1):
        x += 1
    if x > 9:
        raise ValueError(x + 7)
    return -max(x, 4) * 0.5
'''


def test_every_operator_finds_its_place_and_words_are_left_alone() -> None:
    lines = {m.new.strip() for m in mutants("f.py", TEXT)}
    for new in (
        "def f(x: int = 4) -> float:", "if (x < 2.0 and x != 1):", "if not (x <= 2.0 and x != 1):", "if not (x < 4.0 and x != 1):",
        "if not (x < 2.0 or x != 1):", "if not (x < 2.0 and x == 1):", "x -= 1", "x += 2", "pass", "return max(x, 4) * 0.5",
        "return -min(x, 4) * 0.5", "return -max(x, 5) * 0.5", "return -max(x, 4) / 0.5", "return -max(x, 4) * 0.25",
    ):  # fmt: skip
        assert new in lines, new
    assert not any("Words" in line or "raise" in line for line in lines)


@pytest.mark.parametrize("group", GROUPS)
def test_every_mutant_is_a_program_with_one_line_changed(group: str) -> None:
    files = [p for p in (ROOT / "twin").rglob("*.py") if group_of(p.relative_to(ROOT).as_posix()) == group]
    assert files, "a group without modules"
    for path in files:
        text = path.read_text()
        for mutant in mutants(path.relative_to(ROOT).as_posix(), text)[::7]:
            changed = mutant.applied(text)
            ast.parse(changed)
            assert sum(a != b for a, b in zip(text.split("\n"), changed.split("\n"), strict=True)) == 1


def test_changes_by_hand_still_have_their_line() -> None:
    texts = {file: (ROOT / file).read_text() for file, _, _ in CHANGES}
    made = by_hand(texts)
    assert len(made) == len(CHANGES)
    for mutant in made:
        ast.parse(mutant.applied(texts[mutant.file]))
        assert group_of(mutant.file), mutant.file


def test_a_line_that_reads_otherwise_is_refused() -> None:
    with pytest.raises(ValueError, match=r"f.py:2 reads"):
        Mutant("f.py", 2, "def g():", "def h():", "by hand").applied(TEXT)
    with pytest.raises(ValueError, match=r"no line with 'y'"):
        Mutant.of("f.py", "x", "y", "z")
