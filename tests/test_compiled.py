"""Machine code kept on disk: never that of another signature, nor of a function that has changed since."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from twin import compiled
from twin.compiled import Kept
from twin.equilibrium import linear


def kept(folder: Path, stamp: str = "now") -> Kept:
    return Kept(str(folder), "f-1.py3", stamp)


def test_two_processes_that_compile_at_once_do_not_take_each_others_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second has looked before the first was done, and is done before it."""
    first, second = kept(tmp_path), kept(tmp_path)
    write = first._save_data
    monkeypatch.setattr(second, "_load_index", dict)

    def overtaken(name: str, data: Any) -> None:
        second.save("of arrays", "code for arrays")
        write(name, data)

    monkeypatch.setattr(first, "_save_data", overtaken)
    first.save("of numbers", "code for numbers")
    assert kept(tmp_path).load("of arrays") == "code for arrays"
    assert kept(tmp_path).load("of numbers") in (None, "code for numbers")


def test_code_of_other_sources_is_not_taken_and_does_not_stay(tmp_path: Path) -> None:
    kept(tmp_path, "before").save("of numbers", "old code")
    assert kept(tmp_path, "before").load("of numbers") == "old code"
    assert kept(tmp_path).load("of numbers") is None
    kept(tmp_path).save("of arrays", "new code")
    assert kept(tmp_path).load("of arrays") == "new code"
    assert len(list(tmp_path.glob("*.nbc"))) == 1


def test_sources_are_those_of_all_that_is_compiled(tmp_path: Path) -> None:
    (tmp_path / "inner.py").write_text("from twin.compiled import inner\n")
    (tmp_path / "page.py").write_text("TITLE = 1\n")
    before = compiled._compiled(tmp_path)
    (tmp_path / "page.py").write_text("TITLE = 2\n")
    assert compiled._compiled(tmp_path) == before
    (tmp_path / "inner.py").write_text("from twin.compiled import inner\n\n")
    assert compiled._compiled(tmp_path) != before


@pytest.mark.parametrize("function", [linear.factorise, linear.substitute, compiled.cross, compiled.assign])
def test_a_compiled_function_is_kept_so(function: Any) -> None:
    cache = function._cache._cache_file
    assert isinstance(cache, Kept)
    assert compiled._SOURCES in cache._source_stamp
