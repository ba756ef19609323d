"""Machine code kept on disk: never that of another signature, nor of a function that has changed since."""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core import caching

from twin.foundation import compiled
from twin.foundation.compiled import CacheWarning, CodeCache
from twin.mechanics.rod.balance import linear


def kept(folder: Path, stamp: str = "now") -> CodeCache:
    return CodeCache(str(folder), "f-1.py3", stamp)


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
    (tmp_path / "inner.py").write_text("from twin.foundation.compiled import inner\n")
    (tmp_path / "page.py").write_text("TITLE = 1\n")
    before = compiled._source_digest(tmp_path)
    (tmp_path / "page.py").write_text("TITLE = 2\n")
    assert compiled._source_digest(tmp_path) == before
    (tmp_path / "inner.py").write_text("from twin.foundation.compiled import inner\n\n")
    assert compiled._source_digest(tmp_path) != before


@pytest.mark.parametrize("function", [linear.factorise, linear.substitute, compiled.cross, compiled.assign])
def test_a_compiled_function_is_kept_so(function: Any) -> None:
    cache = function._cache._cache_file
    assert isinstance(cache, CodeCache)
    assert compiled._SOURCE_DIGEST in cache._source_stamp


@pytest.fixture
def unwritable(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Return a temporary folder, the only one that caches may be written to."""
    ensure = caching._CacheLocator.ensure_cache_path

    def refuse(locator: Any) -> None:
        if not locator.get_cache_path().startswith(str(tmp_path)):
            raise PermissionError(13, "read-only")
        ensure(locator)

    monkeypatch.setattr(caching._CacheLocator, "ensure_cache_path", refuse)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    return tmp_path


def test_a_cache_that_cannot_be_written_moves_to_a_private_temporary_folder(unwritable: Path) -> None:
    def twice(x: float) -> float:
        return 2.0 * x

    with pytest.warns(CacheWarning, match="set NUMBA_CACHE_DIR to a folder you may write to") as told:
        functions = [compiled.jit(twice) for _ in range(2)]
    assert len(told) == 1
    assert functions[0](2.0) == 4.0
    (folder,) = unwritable.iterdir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert list(folder.rglob("*.nbc"))
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder)  # for worker processes


def test_a_temporary_folder_that_others_may_write_is_not_used(unwritable: Path) -> None:
    other = unwritable / f"twin-compiled-{os.getuid()}"
    other.mkdir()
    other.chmod(0o777)
    assert compiled._private_temporary_folder() != other
    other.rmdir()
    other.write_text("a file in the way")
    assert compiled._private_temporary_folder().is_dir()


def test_a_cache_that_fails_later_warns_and_the_function_works(unwritable: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def half(x: float) -> float:
        return 0.5 * x

    with pytest.warns(CacheWarning, match="it is now in"):
        function = compiled.jit(half)
    monkeypatch.setattr(CodeCache, "save", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.warns(CacheWarning, match=r"compiled code cannot be kept in .* \(No space left on device\); set NUMBA_CACHE_DIR"):
        assert function(3.0) == 1.5
