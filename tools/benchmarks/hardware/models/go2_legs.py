"""Four legs of a Unitree Go2 on a fixed base (iit-DLSLab, BSD-3): one log of sweeps, 0 to 14 s fitted, 14 to 23.5 s judged.

The four legs are one leg four times: each is a trial of the front left one. The right ones are its mirror image, so that their hips
count the other way.
"""

import csv
import gzip
from pathlib import Path

import mujoco
import numpy as np

from twin.measurements import Channel, Recording, Trial, write
from twin.prediction.twin import Twin

LEGS, JOINTS = ("FL", "FR", "RL", "RR"), ("hip", "thigh", "calf")
KP, KD = 20.0, 1.5  # N m/rad, N m s/rad, of its controller
FITTED_UNTIL = 14.0  # s
ENCODER = 3e-5  # rad
ROBOT = """format = "twin-robot/1"
family = "mjcf"
title = "Go2 leg under position control"
accuracy = { value = 0.1, unit = "mm", source = "menagerie" }
[structure]
model = "model.xml"
timestep = 0.0025
"""


def write_sets(raw: Path, folder: Path) -> tuple[Path, Path]:
    """Write the fitted and the judged set, with the robot, from the raw log; return their folders."""
    robot = folder / "robot"
    robot.mkdir(parents=True, exist_ok=True)
    (robot / "model.xml").write_text(_leg(next((raw / "model").glob("*.xml"))))
    (robot / "robot.toml").write_text(ROBOT)
    with gzip.open(raw / "traj_0.csv.gz", "rt") as file:
        head, *rows = csv.reader(file)
    table = np.array(rows, float)
    time = table[:, 0] - table[0, 0]
    channels = (
        *(Channel(f"{j}_command", "input", "rad", quantity=f"actuator.FL_{j}_joint.ctrl") for j in JOINTS),
        *(Channel(f"{j}_angle", "output", "rad", ENCODER, f"joint.FL_{j}_joint.position") for j in JOINTS),
    )
    made = []
    for name, kept in (("fitted", time < FITTED_UNTIL), ("judged", np.ones(len(time), bool))):
        trials = []
        for leg in LEGS:
            values = {}
            for joint in JOINTS:
                sign = -1.0 if (leg[1], joint) == ("R", "hip") else 1.0
                for logged, kind in (("qdes", "command"), ("q", "angle")):
                    values[f"{joint}_{kind}"] = sign * table[kept, head.index(f"{logged}_{leg}_{joint}")]
            trials.append(Trial(f"{leg}.csv", time[kept], values))
        source = "hardware: iit-DLSLab/sim2real-robot-identification, BSD-3"
        write(Recording("../robot", f"Go2 legs, {name}", source, None, channels, tuple(trials)), folder / name)
        made.append(folder / name)
    return made[0], made[1]


def _leg(model: Path) -> str:
    """Return the front left leg's MJCF with its controller as position servos."""
    spec = mujoco.MjSpec.from_file(str(model))
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for leg in LEGS[1:]:
        spec.delete(spec.body(f"{leg}_hip"))
    for joint in JOINTS:
        servo = spec.add_actuator(name=f"FL_{joint}_joint", target=f"FL_{joint}_joint", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=KP, kv=KD)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.compile()
    return spec.to_xml()


def judge(twin: Twin, described: Twin, judged: Recording) -> str:
    """Return the RMS error (mrad) before and after 14 s, as described and by the twin."""
    words = []
    for name, one in (("described", described), ("twin", twin)):
        seen = one.predict(judged)
        late = judged.trials[0].time >= FITTED_UNTIL
        error = np.stack(
            [
                a.values[f"{j}_angle"] - b.values[f"{j}_angle"]
                for a, b in zip(judged.trials, seen.trials, strict=True)
                for j in JOINTS
            ]
        )
        words.append(
            f"{name} {1e3 * np.sqrt(np.mean(error[:, ~late] ** 2)):.1f} | {1e3 * np.sqrt(np.mean(error[:, late] ** 2)):.1f}"
        )
    return f"RMS to 14 s | later, mrad: {', '.join(words)} (bar 13 later)"
