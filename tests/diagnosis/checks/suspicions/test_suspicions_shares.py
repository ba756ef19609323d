"""Controls that are shares of a range have no unit to be mistaken, however wrong the robot is."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.mechanics.mjcf.models import robot
from twin.diagnosis import Settings
from twin.diagnosis.checks.preview import preview_data
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin

ARM = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body name="arm">
      <inertial pos="0 0 -0.2" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/>
      <joint name="hinge" axis="0 1 0" stiffness="2" damping="0.3"/>
    </body>
  </worldbody>
  <actuator><muscle name="flexor" joint="hinge" lengthrange="-1 1" force="2"/></actuator>
</mujoco>"""


def test_a_share_of_a_muscle_is_in_no_other_unit(tmp_path: Path) -> None:
    """The hinge moves four times as far as the model's: any unit of another quantity would be tried, and shares have none."""
    arm = robot(tmp_path / "arm", ARM)
    channels = (Channel("actuator.flexor.ctrl", "input", "1", 1e-6), Channel("joint.hinge.position", "output", "rad", 1e-3))
    time, rng, trials = np.arange(0.0, 2.0, 0.02), np.random.default_rng(0), []
    for k in range(4):
        share = 0.5 + 0.4 * np.sin((2.0 + k) * time)
        moved = 2.0 * share + rng.normal(0.0, 1e-3, time.size)
        trials.append(Trial(f"{k}.csv", time, {channels[0].name: share, channels[1].name: moved}, start=60.0 * k))
    log = Recording("arm", "test", "hardware", arm.gravity, channels, tuple(trials))
    found = preview_data(prepare(log, arm), Twin.of(arm), Settings(), lambda words: None)
    assert not any("actuator.flexor.ctrl" in s.change for s in found.suspicions)
