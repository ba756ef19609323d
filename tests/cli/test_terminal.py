"""The terminal: any encoding, and no raw message of a library."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from twin.cli import library_messages
from twin.cli.library_messages import route_library_messages

UNUSUAL = "finger 3 \u00b1 0.1\u00b0, \u4e2d, \udcff"  # a Chinese character, and a byte of a file's name that is no text


def run(code: str, **env: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=300, env={**os.environ, **env})


def twin(*arguments: str, **env: str) -> subprocess.CompletedProcess[bytes]:
    return run(f"import sys; sys.argv = {['twin', *arguments]!r}; from twin.cli import main; main()", **env)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_every_encoding_takes_every_character(encoding: str) -> None:
    code = (
        "from twin.cli.terminal import accept_any_encoding, err, out; accept_any_encoding()\n"
        f"out.print({UNUSUAL!r}); err.print({UNUSUAL!r}); print({UNUSUAL!r})"
    )
    done = run(code, PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    expected = {"ascii": "finger 3 +/- 0.1 deg, ?, ?", "latin-1": "finger 3 ± 0.1°, ?, ?", "utf-8": "finger 3 ± 0.1°, 中, ?"}
    assert done.stdout.decode(encoding).splitlines() == [expected[encoding]] * 2
    assert done.stderr.decode(encoding).splitlines() == [expected[encoding]]


@pytest.mark.parametrize("env", [{"PYTHONIOENCODING": "ascii"}, {"LANG": "C", "LC_ALL": "C"}, {"PYTHONIOENCODING": "latin-1"}])
@pytest.mark.parametrize("arguments", [("--help",), ("robots",), ("diagnose", "n\u00f6where \u4e2d")])
def test_commands_write_in_any_encoding(arguments: tuple[str, ...], env: dict[str, str]) -> None:
    done = twin(*arguments, **env)
    assert b"Traceback" not in done.stderr
    assert done.returncode == (2 if arguments[0] == "diagnose" else 0)
    assert len(done.stderr.splitlines()) == (1 if arguments[0] == "diagnose" else 0)


@pytest.fixture
def routed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> pytest.CaptureFixture[str]:
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    monkeypatch.setattr(logging, "lastResort", logging.lastResort)
    monkeypatch.setattr(library_messages, "_shown", set())
    monkeypatch.setattr(sys, "warnoptions", [])
    monkeypatch.setenv("PYTHONWARNINGS", "")
    route_library_messages()
    warnings.simplefilter("always")
    return capsys


def test_a_warning_is_one_plain_line_once(routed: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        np.log(np.array([0.0]))
        warnings.warn("first line\nsecond line", UserWarning, stacklevel=1)
    assert routed.readouterr().err.splitlines() == ["note: divide by zero encountered in log", "note: first line"]


def test_warnings_for_developers_are_not_shown(routed: pytest.CaptureFixture[str]) -> None:
    for category in (DeprecationWarning, PendingDeprecationWarning, FutureWarning, ResourceWarning):
        warnings.warn("for developers", category, stacklevel=1)
    assert routed.readouterr().err == ""


def test_log_records_are_one_line_or_none(routed: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logging.getLogger(), "handlers", [])  # pytest's own would take the records
    try:
        raise RuntimeError("in a library")
    except RuntimeError:
        logging.getLogger("a_library").exception("it failed")
        logging.getLogger("websockets.server").exception("opening handshake failed")
    assert routed.readouterr().err.splitlines() == ["note: it failed"]


def test_errors_are_not_touched(routed: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(FloatingPointError), np.errstate(divide="raise"):
        np.log(np.array([0.0]))


def test_python_s_own_option_shows_warnings_as_they_are() -> None:
    code = "from twin.cli.library_messages import route_library_messages as r; r(); import warnings; warnings.warn('a\\nb')"
    assert b"UserWarning: a\nb" in run(code, PYTHONWARNINGS="default").stderr
    assert run(code, PYTHONWARNINGS="").stderr == b"note: a\n"


def test_a_cache_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    code = f"""
import sys, tempfile
import numba.core.caching as caching
ensure = caching._CacheLocator.ensure_cache_path
def refuse(self):
    if not self.get_cache_path().startswith({str(tmp_path)!r}):
        raise PermissionError(13, "read-only")
    ensure(self)
caching._CacheLocator.ensure_cache_path = refuse
tempfile.tempdir = {str(tmp_path)!r}
sys.argv = ["twin", "effects"]
from twin.cli import main
main()
import twin.mechanics.rod
"""
    done = run(code, NUMBA_CACHE_DIR="", COLUMNS="400", PYTHONWARNINGS="")
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.decode().splitlines()
    assert line.startswith("note: numba can write its cache of compiled code neither beside the program nor in your home")
    assert line.endswith("set NUMBA_CACHE_DIR to a folder you may write to")
    assert str(tmp_path) in line
