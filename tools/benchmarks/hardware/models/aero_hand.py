"""The six tendon motors of a TetherIA Aero hand (google-deepmind/mujoco_playground, PR 199, Apache-2.0): two thirds of each log are
fitted, the last third judged.

A log moves one motor in square steps, four rows a second, and reads that motor's encoder. Commands are held from row to row, so the
sets have a row every `ROW`, with a reading only where the log has one. A row's command is taken to be older than its reading.
"""

import csv
from pathlib import Path

import mujoco
import numpy as np

from twin.measurements import Channel, Recording, Trial, write
from twin.prediction.twin import Twin

# Number of a motor's log, its actuator, travel (m) of 65535 counts (the authors' data_transform.py).
MOTORS = {
    5: ("right_index_A_pip", 0.04445), 8: ("right_middle_A_pip", 0.04445), 11: ("right_ring_A_pip", 0.04445),
    14: ("right_pinky_A_pip", 0.04445), 1: ("right_th1_A_pip", 0.01657), 2: ("right_th2_A_pip", 0.02064),
}  # fmt: skip
ROW = 0.01  # s
FITTED_SHARE = 2.0 / 3.0
READING = 2e-5  # m, how motor encoders repeat
ROBOT = """format = "twin-robot/1"
family = "mjcf"
title = "Aero hand, right"
accuracy = { value = 0.1, unit = "mm", source = "its makers' model" }
[structure]
model = "model.xml"
timestep = 0.005
[parameters]
"joint.*.damping" = { relative_std = 0.3, source = "not written: usual of its kind" }
"actuator.*_pip.kp" = { relative_std = 0.05, source = "not written: usual of its kind" }
"""


def write_sets(raw: Path, folder: Path) -> tuple[Path, Path]:
    """Write the fitted and the judged set, with the robot, from the raw logs; return their folders."""
    robot = folder / "robot"
    robot.mkdir(parents=True, exist_ok=True)
    (robot / "model.xml").write_bytes(next((raw / "model").glob("*.xml")).read_bytes())
    (robot / "robot.toml").write_text(ROBOT)
    model = mujoco.MjModel.from_xml_path(str(robot / "model.xml"))
    names = [model.actuator(k).name for k in range(model.nu)]
    units = {n: "m" if n.endswith("_pip") else "rad" for n in names}
    channels = (
        *(Channel(f"{n}_command", "input", units[n], quantity=f"actuator.{n}.ctrl") for n in names),
        *(Channel(f"{n}_travel", "output", "m", READING, f"actuator.{n}.position") for n, _ in MOTORS.values()),
    )
    trials = {judged: [_trial(raw, model, motor, judged) for motor in MOTORS] for judged in (False, True)}
    source = "hardware: google-deepmind/mujoco_playground PR 199, TetherIA, Apache-2.0"
    for judged, name in ((False, "fitted"), (True, "judged")):
        write(Recording("../robot", f"Aero hand, {name}", source, None, channels, tuple(trials[judged])), folder / name)
    return folder / "fitted", folder / "judged"


def _trial(raw: Path, model: mujoco.MjModel, motor: int, judged: bool) -> Trial:
    """Return one motor's log, whole or its fitted part."""
    moved, travel = MOTORS[motor]
    with (raw / f"raw_data/motor_data_{motor}.csv").open() as file:
        rows = list(csv.DictReader(file))
    logged = np.array([float(r["timestamp"]) for r in rows])
    logged -= logged[0]
    sent, read = (np.array([float(r[f"servo_{motor}_{what}"]) for r in rows]) * travel / 65535.0 for what in ("sent", "read"))
    if not judged:
        kept = logged <= FITTED_SHARE * logged[-1]
        logged, sent, read = logged[kept], sent[kept], read[kept]
    time = ROW * np.arange(round(logged[-1] / ROW) + 1)
    held = sent[np.clip(np.searchsorted(logged, time + 1e-9, side="right") - 1, 0, None)]
    values: dict[str, np.ndarray] = {}
    for k in range(model.nu):
        name, high = model.actuator(k).name, float(model.actuator_ctrlrange[k, 1])
        values[f"{name}_command"] = high - held if name == moved else np.full(len(time), high if name.endswith("_pip") else 0.0)
    for name, _ in MOTORS.values():
        values[f"{name}_travel"] = np.full(len(time), np.nan)
    high = float(model.actuator(moved).ctrlrange[1])
    values[f"{moved}_travel"][np.round(logged / ROW).astype(int)] = high - read
    return Trial(f"{moved}.csv", time, values)


def judge(twin: Twin, described: Twin, judged: Recording) -> str:
    """Return the RMS error (mm) of each motor's travel in the last third of its log, as described and by the twin."""
    seen = [one.predict(judged) for one in (described, twin)]
    words = []
    for k, (trial, (name, _)) in enumerate(zip(judged.trials, MOTORS.values(), strict=True)):
        late = trial.time > FITTED_SHARE * trial.time[-1]
        error = [1e3 * (trial.values[f"{name}_travel"] - s.trials[k].values[f"{name}_travel"])[late] for s in seen]
        words.append(f"{name} {np.sqrt(np.nanmean(error[0] ** 2)):.2f} -> {np.sqrt(np.nanmean(error[1] ** 2)):.2f}")
    return f"RMS of the last third, mm: {', '.join(words)} (bar: 65 % of described on five of six)"
