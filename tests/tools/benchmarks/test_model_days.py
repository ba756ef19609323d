"""Days of models that plain MuJoCo steps, in small; whole: `tools.benchmarks.diagnosis.days.model_days`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tools.benchmarks.diagnosis.days.model_days import right, run
from tools.simulators.plain_mujoco import day
from twin.measurements import read
from twin.prediction.evaluate import evaluate
from twin.prediction.twin import Twin
from twin.robots.starter import write_model_starter


@pytest.mark.parametrize("model", day.MODELS)
def test_a_day_without_effect_is_as_described_and_one_with_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    """Robots built exactly as described, two trials of 1 s: the twin's steps agree with MuJoCo's to within half of the noise."""
    for name, value in (("MASS_SPREAD", 0.0), ("SPRING_SPREAD", 0.0), ("DAMPER_SPREAD", 0.0), ("LASTS", 1.0), ("TRIALS", 2)):
        monkeypatch.setattr(day, name, value)
    off = {}
    for effect in ("none", "actuator_gain"):
        folder, _ = write_model_starter(f"{model}_{effect}", day.HERE / f"{model}.xml", tmp_path)
        day.write_log(model, effect, folder, 3)
        recording = read(folder / "samples/first")
        channels = evaluate(Twin.of_recording(recording), recording)["by_channel"]
        off[effect] = max(c["rmse"] for name, c in channels.items() if name.startswith("joint."))
    assert np.degrees(day.ANGLE_NOISE) < off["none"] < 1.12 * np.degrees(day.ANGLE_NOISE)
    assert off["actuator_gain"] > 3.0 * off["none"]


def test_a_day_is_diagnosed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hand on an arm that swings for 1 s, six times, as built; of 600 held-out angles the RMS is known to 3 %."""
    monkeypatch.setattr(day, "LASTS", 1.0)
    monkeypatch.setattr(day, "TRIALS", 6)
    row = run("gripper_arm", "none", tmp_path, 5)
    assert (row["verdict"], row["claims"]) == ("noise", [])
    assert 0.9 < row["over_floor"] < 1.1


def test_an_answer_is_right_if_the_effect_comes_first_or_nothing_is_claimed_without_one() -> None:
    assert right({"claims": [], "effect": "none"})
    assert right({"claims": ["tip_payload", "base_tilt"], "effect": "tip_payload"})
    assert not right({"claims": ["base_tilt"], "effect": "none"})
    assert not right({"claims": [], "effect": "tip_payload"})
