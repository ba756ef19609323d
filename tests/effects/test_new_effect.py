"""A law that is new to the program, one file and nothing else touched: found, screened, fitted, claimed, plotted and reported."""

from __future__ import annotations

import importlib
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.recorded_days import half, recorded_day
from twin import effects, report
from twin.diagnosis import Settings, diagnose
from twin.effects import catalogue
from twin.prediction.twin_file.storage import read_twin
from twin.report.plots.effect_plot import choose_residual_plots
from twin.report.plots.variables import variables

ORIGINAL, NEW = "stiffness_asymmetry", "flattened_wire"


@pytest.fixture
def newcomer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The catalogue with one law under another name: nobody else in the program can know it."""
    source = Path(effects.__path__[0])
    shutil.copytree(source, tmp_path / "effects", ignore=shutil.ignore_patterns("__pycache__", f"{ORIGINAL}.py"))
    text = (source / f"{ORIGINAL}.py").read_text()
    text = text.replace(f'id = "{ORIGINAL}"', f'id = "{NEW}"').replace("StiffnessAsymmetry", "FlattenedWire")
    (tmp_path / "effects" / f"{NEW}.py").write_text(text)
    monkeypatch.setattr(effects, "__path__", [str(tmp_path / "effects")])
    importlib.invalidate_caches()
    catalogue.cache_clear()
    yield NEW
    catalogue.cache_clear()
    sys.modules.pop(f"twin.effects.{NEW}", None)


def test_a_new_law_is_one_file(newcomer: str, tmp_path: Path) -> None:
    assert newcomer in catalogue()
    assert ORIGINAL not in catalogue()
    day, truth = recorded_day(ORIGINAL)
    found = diagnose(half(day), settings=Settings(jobs=1))
    assert newcomer in {v.effect for v in found.identifiability}, "screened"
    assert [c.effect for c in found.claims] == [newcomer]
    fitted = found.claims[0].parameters
    assert truth is not None
    assert np.hypot(*(p.value for p in fitted.values())) > 5 * max(p.std or 0.0 for p in fitted.values())
    report.write(found, tmp_path / "report", {})
    page = (tmp_path / "report/report.html").read_text("utf-8")
    assert "flattened wire" in page
    (plot,) = choose_residual_plots(found)
    assert plot.reason == "flattened wire varies with the direction of bending"
    assert plot.variable.title in [v.title for kind, v in variables(found.prepared) if kind == "azimuth"]
    assert read_twin(tmp_path / "report").effects[0].id == newcomer


def test_the_program_names_no_effect_outside_its_file() -> None:
    """But for a law's equations, which mechanics compile, and the two laws of lateness, which are weighed against each other."""
    root = Path(effects.__path__[0]).parent
    allowed = {"diagnosis/search/lag_or_delay.py"}
    names = re.compile(rf"[\"']({'|'.join(catalogue())})[\"']")
    conditions = {"tip_payload"}  # a trial's condition, too
    found = {
        f"{file.relative_to(root)}: {name}"
        for file in sorted(root.rglob("*.py"))
        if file.parent.name != "effects" and str(file.relative_to(root)) not in allowed
        for name in names.findall(file.read_text("utf-8"))
        if name not in conditions
    }
    assert found == set()
