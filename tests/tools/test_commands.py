"""Every command that a page names: its module exists, its options are known, and the short ones run."""

from __future__ import annotations

import importlib.util
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from tools.benchmarks.solvers import statics
from twin.body import Problem
from twin.cli import main as twin_main
from twin.mechanics.rod import Equilibrium
from twin.robots import load
from twin.robots.robot import models_folder

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted(p for part in ("twin", "models", "tools") for p in (ROOT / part).rglob("*.md"))]
COMMAND = re.compile(r"(?:^|[;\s])(python3? -m tools[\w.]*|twin [a-z]+)((?: [^;|#`]*)?)")
FRIDAY = models_folder() / "continuum/samples/friday"


def commands(page: str) -> set[tuple[str, frozenset[str]]]:
    """The commands of a page's code, as what is run and the options it is given."""
    found = set()
    for n, part in enumerate(page.split("```")):
        spans = part.splitlines() if n % 2 else [*re.findall(r"^    (.+)$", part, re.M), *re.findall(r"`([^`]+)`", part)]
        for span in spans:
            for what, words in COMMAND.findall(span.replace("\n", " ").partition("#")[0]):
                found.add((what.replace("python3", "python"), frozenset(re.findall(r"(--[\w-]+)", words))))
    return found


NAMED = sorted({found for page in PAGES for found in commands(page.read_text("utf-8"))}, key=str)


def run(monkeypatch: pytest.MonkeyPatch, what: str, *arguments: str) -> None:
    """Run a command in this process; SystemExit goes through."""
    if what.startswith("python -m "):
        module = what.removeprefix("python -m ")
        monkeypatch.setattr(sys, "argv", [module, *arguments])
        runpy.run_module(module, run_name="__main__")
    else:
        monkeypatch.setattr(sys, "argv", [*what.split(), *arguments])
        twin_main()


def test_pages_name_commands() -> None:
    assert len(NAMED) > 40
    assert ("twin diagnose", frozenset({"--out"})) in NAMED


@pytest.mark.parametrize("what", sorted({what for what, _ in NAMED}))
def test_a_command_that_a_page_names_has_the_options_it_is_given(
    what: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if what.startswith("python -m "):
        assert importlib.util.find_spec(what.removeprefix("python -m ")), f"{what}: there is no such module"
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit) as ended:
        run(monkeypatch, what, "--help")
    assert not ended.value.code, capsys.readouterr().err
    told = capsys.readouterr().out
    given = set().union(*(options for name, options in NAMED if name == what))
    assert not [option for option in sorted(given) if not re.search(re.escape(option) + r"\b", told)], f"{what} lacks options"


@pytest.mark.parametrize(
    ("what", "arguments"),
    [
        ("twin robots", ()), ("twin effects", ()), ("twin tasks", ()), ("twin new", ("snake", "--family", "continuum")),
        ("twin evaluate", ("continuum", str(FRIDAY))), ("twin rollout", ("continuum", "--random", "1", "--out", "rolled")),
        ("python -m tools.mutants", ("table",)), ("python -m tools.benchmarks.solvers.accuracy", ("--poses", "1")),
        ("python -m tools.benchmarks.diagnosis.similitude", (str(FRIDAY), "out", "--lengths", "3", "--masses", "20")),
        ("python -m tools.benchmarks.diagnosis.mistakes", (str(FRIDAY), "gravity in g")),
    ],
)  # fmt: skip
def test_a_short_command_runs(
    what: str, arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run(monkeypatch, what, *arguments)
    assert capsys.readouterr().out


def test_raw_data_that_are_not_there_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SystemExit, match="missing"):
        run(monkeypatch, "python -m tools.benchmarks.hardware.fetch", str(tmp_path), "--check")
    with pytest.raises(SystemExit, match="is not there; it should hold the raw data"):
        run(monkeypatch, "python -m tools.benchmarks.hardware.run", str(tmp_path), "tentacle")


def test_the_statics_benchmark_times_warm_solves(capsys: pytest.CaptureFixture[str]) -> None:
    """On a few samples: a problem is built of times, tensions, loads and route."""
    rng, solver = np.random.default_rng(0), Equilibrium(load("continuum").build())
    time, tension = statics.wandering_tensions(rng, 30)
    for route in (statics.Route(), statics.FRICTION_ROUTE):
        assert 0.0 < statics.seconds(solver.solve, time, tension, statics.LOAD_CASES["hanging"], route) < 10.0
        assert solver.solve(Problem(time, tension, statics.LOAD_CASES["hanging"], route)).status.all()
    statics.convergence(solver, rng, 3)
    assert "0 not found" in capsys.readouterr().out
