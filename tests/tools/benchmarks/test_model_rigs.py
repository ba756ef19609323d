"""The importers of public logs of robots that have an MJCF, on logs made here."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tools.benchmarks.hardware.models import aero_hand, go2_legs, xl330
from twin.measurements import read
from twin.prediction.prepared import prepare
from twin.robots import load


def test_a_servos_torque_is_its_firmwares(tmp_path: Path) -> None:
    """Gains, clip and back-EMF as three controls of one joint, at states within and beyond the clip, and switched off."""
    log = {"kp": 400, "vin": 7.4, "trajectory": "made", "entries": []}
    rng = np.random.default_rng(3)
    for k, on in enumerate([True] * 40 + [False] * 5):
        position, goal = rng.uniform(-1.0, 1.0, 2)
        log["entries"].append(
            {"timestamp": 0.01 * k, "position": position, "goal_position": goal, "input_volts": 7.4, "torque_enable": on}
        )
    raw = tmp_path / "raw"
    raw.mkdir()
    (raw / "a.json.gz").write_bytes(gzip.compress(json.dumps(log).encode()))
    _, judged = xl330.write_sets(raw, tmp_path / "set")
    (trial,) = read(judged, least_trials=1).trials
    model = mujoco.MjModel.from_xml_string(xl330.MODEL)
    data, clipped = mujoco.MjData(model), 0
    for k, row in enumerate(log["entries"]):
        data.qpos[0], data.qvel[0] = row["position"], 3.0
        data.ctrl[:] = [trial.values[name][k] for name in ("goal", "stiffness", "back_emf")]
        mujoco.mj_forward(model, data)
        duty = 400 * (row["goal_position"] - row["position"]) * 4096 / (2 * np.pi * 256 * 885)
        clipped += abs(duty) > 1.0
        kt, resistance = 0.52 / 1.47, 5 / 1.47
        torque = (kt * 7.4 / resistance * np.clip(duty, -1, 1) - kt**2 / resistance * 3.0) if row["torque_enable"] else 0.0
        assert data.qfrc_actuator[0] == pytest.approx(torque, abs=1e-12)
    assert 3 < clipped < 40


LEGS = """<mujoco><option impratio="100"/><worldbody><body name="base">{legs}</body></worldbody>
  <actuator><motor name="old" joint="FL_hip_joint"/></actuator></mujoco>"""
LEG = """<body name="{n}_hip"><joint name="{n}_hip_joint" axis="1 0 0"/><geom size=".03"/><body name="{n}_thigh" pos="0 0 -.1">
  <joint name="{n}_thigh_joint" axis="0 1 0"/><geom size=".03"/><body name="{n}_calf" pos="0 0 -.2"><joint name="{n}_calf_joint"
  axis="0 1 0"/><geom size=".02"/></body></body></body>"""


def test_right_legs_are_mirrored(tmp_path: Path) -> None:
    raw = tmp_path / "raw"
    (raw / "model").mkdir(parents=True)
    (raw / "model/m.xml").write_text(LEGS.format(legs="".join(LEG.format(n=n) for n in go2_legs.LEGS)))
    names = [f"{what}_{leg}_{j}" for what in ("q", "qdes") for leg in go2_legs.LEGS for j in go2_legs.JOINTS]
    rows = ["time_s," + ",".join(names), *(f"{5.0 * k}," + ",".join(str(i + k) for i in range(24)) for k in range(5))]
    (raw / "traj_0.csv.gz").write_bytes(gzip.compress("\n".join(rows).encode()))
    fitted, judged = (read(path, least_trials=1) for path in go2_legs.write_sets(raw, tmp_path / "set"))
    assert [len(t.time) for t in fitted.trials] == [3] * 4  # 0, 5, 10 s
    assert [len(t.time) for t in judged.trials] == [5] * 4
    right = judged.trials[1].values
    assert [right[f"{j}_angle"][0] for j in go2_legs.JOINTS] == [-3.0, 4.0, 5.0]
    ready = prepare(judged, load(judged.robot, judged.folder))
    assert (ready.n_tendon, ready.robot.n_tendon.joints) == (3, tuple(f"FL_{j}_joint" for j in go2_legs.JOINTS))  # type: ignore[attr-defined]


HAND = "<mujoco><worldbody>{bodies}</worldbody><actuator>{drives}</actuator></mujoco>"


def test_commands_are_held_and_readings_stand_where_they_were_made(tmp_path: Path) -> None:
    raw, names = tmp_path / "raw", [name for name, _ in aero_hand.MOTORS.values()]
    (raw / "model").mkdir(parents=True)
    (raw / "raw_data").mkdir()
    bodies = "".join(f'<body><joint name="{n}" type="slide"/><geom size=".01"/></body>' for n in names)
    drives = "".join(f'<position name="{n}" joint="{n}" ctrlrange="0 0.1"/>' for n in names)
    (raw / "model/m.xml").write_text(HAND.format(bodies=bodies, drives=drives))
    for motor in aero_hand.MOTORS:
        rows = [f"timestamp,servo_{motor}_sent,servo_{motor}_read", "100.0,0,0", "100.25,65535,0", "100.5,65535,65535"]
        (raw / f"raw_data/motor_data_{motor}.csv").write_text("\n".join(rows))
    _, judged = (read(path, least_trials=1) for path in aero_hand.write_sets(raw, tmp_path / "set"))
    trial, travel = judged.trials[0], 0.04445
    command, seen = trial.values[f"{names[0]}_command"], trial.values[f"{names[0]}_travel"]
    np.testing.assert_allclose(command[[0, 24, 25, 50]], 0.1 - travel * np.array([0, 0, 1, 1]), atol=1e-12)
    assert np.flatnonzero(np.isfinite(seen)).tolist() == [0, 25, 50]
    np.testing.assert_allclose(seen[[0, 25, 50]], 0.1 - travel * np.array([0, 0, 1]), atol=1e-12)
    assert not np.isfinite(trial.values[f"{names[1]}_travel"]).any()
