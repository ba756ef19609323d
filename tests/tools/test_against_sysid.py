"""`mujoco.sysid` beside the twin, on one trial and two numbers: an arm's first servo."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mujoco import sysid

from tools.benchmarks.solvers import against_sysid
from tools.simulators.articulated.day import Recipe, make_set
from twin.diagnosis.calibration.model import Model
from twin.measurements import read
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin

NUMBERS = ("actuator.shoulder_servo.kp", "joint.shoulder.damping")


@pytest.mark.skipif(not hasattr(sysid, "optimize"), reason='needs pip install "mujoco[sysid]"')
def test_both_predict_a_trial_alike(tmp_path: Path) -> None:
    """Their fit of two numbers lowers the twin's own misfit: same commands, readings, units and times on both sides.

    Without the times of readings set right it would not: half a millisecond late is a noise of the shoulder's encoder.
    """
    make_set(tmp_path, Recipe("servo_arm", (), 1.0, 71000))
    recording = read(tmp_path / "measured")
    recording = replace(recording, trials=tuple(t for t in recording.trials if t.name.startswith("steps")))
    against_sysid._add_sensors(tmp_path / "measured" / "robot", recording)
    twin = Twin.of_recording(recording)
    prepared, whole = prepare(recording, twin.robot), Model.base(twin.robot)
    few = Model(whole.twin, tuple(f for f in whole.free if f.parameter.name in NUMBERS))
    x = against_sysid.by_sysid(prepared, [0], few, 1)
    assert (np.abs(x) < 5.0).all()
    found = few.at(
        np.array([(f.parameter.value + f.parameter.std * d) / f.parameter.step for f, d in zip(few.free, x, strict=True)])
    )
    before, after = (against_sysid._misfit(m.twin, prepared, [0]) for m in (few, found))
    assert after < before
