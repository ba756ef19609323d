"""Each example runs, in small, and says what it is for; it is short enough to be read at once."""

from __future__ import annotations

import importlib
import pkgutil
import re
from pathlib import Path
from typing import Any

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


def test_a_policy_s_learning_is_logged_for_tensorboard(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="pip install '.[policy]'")
    pytest.importorskip("tensorboard", reason="pip install '.[policy]'")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    environment.learn(tmp_path, steps=400)
    (folder,) = tmp_path.iterdir()
    log = EventAccumulator(str(folder))
    log.Reload()
    (earned,) = log.Scalars("rollout/ep_rew_mean")
    assert earned.step == 400  # four episodes of a hundred steps
    assert earned.value < 0.0


def test_a_finger_feels_its_shape(capsys: pytest.CaptureFixture[str]) -> None:
    shape_from_strain.main(trials=1)
    assert "609 points" in capsys.readouterr().out


def test_the_tip_is_led_around_a_circle() -> None:
    assert pull_to_a_point.main() < 3e-3


def test_heated_springs_make_a_page(tmp_path: Path) -> None:
    heated_springs.main(tmp_path / "heat.html", seconds=60.0)
    assert "Tension against temperature (simulation" in (tmp_path / "heat.html").read_text(encoding="utf-8")


def test_the_readme_s_example_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And imports nothing but the program."""
    text = (Path(examples.__path__[0]).parents[1] / "README.md").read_text("utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert re.findall(r"^(?:import|from) (\S+)", code, re.MULTILINE) == ["twin"]
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(code, names)
    assert names["rougher"].effects[-1]["mu"] == 0.3
    assert names["predicted"].source.startswith("simulation")
