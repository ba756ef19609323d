"""Each example runs, in small, and says what it is for; it is short enough to be read at once."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import pytest

from tools import examples
from tools.examples import (
    diagnose_a_day,
    environment,
    heated_springs,
    own_effect,
    own_robot,
    pull_to_a_point,
    rollouts,
    shape_from_strain,
)
from twin.measurements import read

MOST_LINES = 60


@pytest.mark.parametrize("name", [m.name for m in pkgutil.iter_modules(examples.__path__)])
def test_an_example_is_short_and_says_what_it_is_for(name: str) -> None:
    module = importlib.import_module(f"tools.examples.{name}")
    assert module.__doc__
    assert len(Path(str(module.__file__)).read_text().splitlines()) <= MOST_LINES


def test_a_day_is_diagnosed_kept_and_predicted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    diagnose_a_day.main(tmp_path / "report")
    assert "tendon friction" in capsys.readouterr().out
    assert {f.name for f in (tmp_path / "report").iterdir()} == {"report.html", "report.json", "twin.toml"}


def test_a_robot_of_ones_own_bends_less_if_stiffer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own_robot.main(tmp_path / "snake")
    described, stiffer = (float(line.split(" by ")[1].split()[0]) for line in capsys.readouterr().out.splitlines()[-2:])
    assert 0.85 * described < stiffer < 0.95 * described  # EI 10 % more, the bend some 9 % less


def test_an_effect_of_ones_own_changes_the_error(capsys: pytest.CaptureFixture[str]) -> None:
    own_effect.main(trials=1)
    errors = [float(line.split("position")[1].split()[0]) for line in capsys.readouterr().out.splitlines()]
    assert len(set(errors)) == 3


def test_rollouts_are_a_set_to_read_again(tmp_path: Path) -> None:
    rollouts.main(tmp_path / "rolled", n=2)
    assert len(read(tmp_path / "rolled").trials) == 2


def test_the_tip_comes_nearer_to_its_goal(capsys: pytest.CaptureFixture[str]) -> None:
    best = environment.main(steps=30)
    away = float(capsys.readouterr().out.split(" mm away")[0].split()[-1])
    assert 1e3 * best < away


def test_a_finger_feels_its_shape(capsys: pytest.CaptureFixture[str]) -> None:
    shape_from_strain.main(trials=1)
    assert "609 points" in capsys.readouterr().out


def test_the_tip_is_led_around_a_circle() -> None:
    assert pull_to_a_point.main() < 3e-3


def test_heated_springs_make_a_page(tmp_path: Path) -> None:
    heated_springs.main(tmp_path / "heat.html", seconds=60.0)
    assert "Tension against temperature (simulation" in (tmp_path / "heat.html").read_text(encoding="utf-8")
