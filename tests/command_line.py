"""The `twin` command: run in the test's own process, which saves a start of seconds, or in one of its own."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest

from twin import cli
from twin.cli import terminal

WIDTH = 250  # columns, so that no line of text is broken


class Done(NamedTuple):
    """How a command ended and what it wrote, as `subprocess.CompletedProcess` names it."""

    returncode: int
    stdout: str
    stderr: str


def twin(*arguments: object, cwd: Path) -> Done:
    """Run a command in this process, in folder `cwd`; its way to end the interpreter becomes an exception."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(cwd)
        patch.setattr(sys, "argv", ["twin", *map(str, arguments)])
        patch.setattr(cli, "_leave", sys.exit)
        for console in (terminal.out, terminal.err):
            patch.setattr(console, "width", WIDTH)
        try:
            cli.main()
        except SystemExit as end:
            code = int(end.code or 0)
    return Done(code, out.getvalue(), err.getvalue())


def twin_process(*arguments: object, cwd: Path) -> Done:
    """Run a command in a process of its own, as a user does."""
    command = [sys.executable, "-m", "twin.cli", *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, env={**os.environ, "COLUMNS": str(WIDTH)})
    return Done(done.returncode, done.stdout, done.stderr)
