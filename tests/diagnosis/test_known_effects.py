"""A robot described with friction of uncertain size: it is calibrated, reported with the robot's own numbers, and never claimed."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from twin.diagnosis import Settings, diagnose
from twin.measurements import read
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import read_twin
from twin.report import provenance, write
from twin.robots import load
from twin.robots.robot import models_folder

FRICTION = """[[effect]]
id = "tendon_friction"
parameters = { mu = { value = 0.1, unit = "1", std = 0.1 }, presliding = { value = 0.3, unit = "mm", std = 0.2 } }
"""


def test_what_a_robot_is_known_to_have_is_no_finding(tmp_path: Path) -> None:
    """The sample's friction is named, 0.218, where the description knows none; where it does, nothing is left to name."""
    text = (models_folder() / "continuum/robot.toml").read_text("utf-8")
    (tmp_path / "rubbing").mkdir()
    (tmp_path / "rubbing/robot.toml").write_text(text.replace("[gravity]", FRICTION + "[gravity]", 1), "utf-8")
    recording = read(models_folder() / "continuum/samples/friday")
    found = diagnose(recording, Twin.of(load("rubbing", relative_to=tmp_path)), Settings(jobs=2))
    assert (found.verdict, found.claims) == ("noise", ())
    mu = found.parameters["tendon_friction.mu"]
    assert mu.value == pytest.approx(0.218, abs=0.005)
    assert mu.std is not None
    write(found, tmp_path / "out", provenance(recording, Settings(jobs=2), "test"))
    told = json.loads((tmp_path / "out/report.json").read_text("utf-8"))
    assert told["effects"] == []
    assert told["parameters"]["tendon_friction.mu"]["value"] == pytest.approx(mu.value)
    assert "tendon_friction.mu" in (tmp_path / "out/report.html").read_text("utf-8")
    kept = read_twin(tmp_path / "out/twin.toml")
    assert kept.effects == found.twin.effects
    (table,) = tomllib.loads((tmp_path / "out/twin.toml").read_text("utf-8"))["effect"]
    assert table["parameters"]["mu"]["std"] == pytest.approx(mu.std)
