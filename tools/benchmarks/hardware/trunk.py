"""A trunk that motors pull, from public data: python -m tools.benchmarks.hardware.trunk FOLDER OUT

FOLDER holds runs of StanfordASL/trunk-stack, as observations_controlled_1.csv.gz. Run 1, in six pieces of 25 s at 10 Hz, is fitted
but for the held-out pieces; run 2 is predicted. The rival is a quadratic of the six motor angles, fitted to all of run 1.
"""

import gzip
from pathlib import Path

import numpy as np
import tyro

from tools.benchmarks.table import markdown
from twin.diagnosis import Settings
from twin.diagnosis.pipeline import calibrated_fit
from twin.measurements import Channel, Recording, Trial
from twin.prediction.evaluate import evaluate
from twin.prediction.twin import Twin
from twin.robots import load

RATE, PIECES, STEP = 100.0, 6, 10  # rows a second of the log; pieces of a run; rows of the log for one that is kept
MOTORS = tuple(Channel(f"motor_{i}_angle", "input", "deg", np.radians(0.1)) for i in range(1, 7))
DISKS = tuple(Channel(f"disk_{k}_{a}", "output", "mm", 1e-4) for k in (1, 2, 3) for a in "xyz")
ROBOT = """format = "twin-robot/1"
family = "continuum"
title  = "ASL trunk: a hose, three disks, six motors with antagonistic pairs"
[structure]
disks       = 3
tendons     = 12
tendons_end = [1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]
motors      = [[5, -6], [9, -10], [1, -2], [11, -12], [3, -4], [7, -8]]
pieces      = 4
[parameters]
"backbone.radius"         = { value = 5.0, unit = "mm", source = "an equivalent solid rod; a guess" }
"backbone.mass"           = { value = 120.0, unit = "g", source = "guess" }
"backbone.youngs_modulus" = { value = 0.5, unit = "GPa", std = 0.5, low = 0.005, high = 20.0, source = "guess" }
"backbone.poisson_ratio"  = { value = 0.4, unit = "1", source = "guess" }
"disks.mass"              = { value = [40, 40, 150], unit = "g", std = 15, low = 5, high = 400, source = "guess" }
"disks.radius"            = { value = 65.0, unit = "mm", source = "guess" }
"disks.pitch"             = { value = [105.0, 95.0, 115.0], unit = "mm", std = 3, source = "at rest: y = -106, -201, -316 mm" }
"tendons.radius"          = { value = 36.0, unit = "mm", std = 4, low = 20, high = 60, source = "guess" }
"tendons.angle"           = { value = [195, 15, 105, 285, 315, 135, 45, 225, 255, 75, 165, 345], unit = "deg"ANGLE_STD, \
source = "twelve channels, where the robot was seen to move" }
"motors.radius"           = { value = RADII, unit = "mm", std = 5.0, low = 5, high = 60, source = "guess" }
"motors.zero"             = { value = [0, 0, 0, 0, 0, 0], unit = "deg", std = 4, source = "rest angles, set anew by hand" }
"tendons.pretension"      = { value = 10.0, unit = "N", std = 8, low = 0, high = 60, source = "guess: spring-loaded sleds" }
"tendons.stretch"         = { value = 0.3, unit = "mm/N", std = 0.3, low = 0.005, high = 5, source = "guess: the same" }
"frame.turn_x"            = { value = 90.0, unit = "deg", std = 3, source = "motion capture has y upwards" }
"frame.turn_y"            = { value = 0.0, unit = "deg", std = 3, source = "motion capture" }
"frame.turn_z"            = { value = 0.0, unit = "deg", std = 3, source = "motion capture" }
"frame.shift_x"           = { value = 100.0, unit = "mm", std = 5, source = "at rest" }
"frame.shift_y"           = { value = 0.0, unit = "mm", std = 5, source = "at rest" }
"frame.shift_z"           = { value = 106.0, unit = "mm", std = 5, source = "at rest" }
"damping.time"            = { value = 50.0, unit = "ms", source = "guess" }
[gravity]
value = [0.0, 0.0, 9.81]
unit = "m/s^2"
source = "it hangs"
[accuracy]
value = 1.0
unit = "mm"
source = "guess"
"""
DESCRIPTIONS = {"one spool radius for all": ("16.0", ""), "six radii, hole angles free": ("[16, 16, 16, 16, 16, 16]", ", std = 5")}


def main(folder: tyro.conf.Positional[Path], out: tyro.conf.Positional[Path]) -> None:
    """Calibrate two descriptions of the trunk to run 1 and judge them on run 2.

    Args:
        folder: the raw data
        out: folder for the robots
    """
    first, second = (_run(folder / f"observations_controlled_{k}.csv.gz", 1000.0 * k) for k in (1, 2))
    rows = []
    for k, (name, (radii, angle_std)) in enumerate(DESCRIPTIONS.items()):
        place = out / f"robot_{k + 1}"
        place.mkdir(parents=True, exist_ok=True)
        (place / "robot.toml").write_text(ROBOT.replace("RADII", radii).replace("ANGLE_STD", angle_std), "utf-8")
        robot = load(str(place))
        found, held_out, _ = calibrated_fit(first, Twin.of(robot), Settings(jobs=1))
        described = evaluate(Twin.of(robot), second)["rmse"]
        rows.append((name, held_out, f"{evaluate(found.model.twin, second)['rmse']:.2f} mm", f"{described:.1f} mm"))
    rows.append(("quadratic of the motor angles, fitted to run 1", "", f"{1e3 * _quadratic(first, second):.2f} mm", ""))
    print(markdown(("description", "held-out pieces of run 1", "run 2", "run 2, as described"), rows))


def _run(file: Path, start: float) -> Recording:
    """Return a run as pieces. A motor's angle is refreshed every fifth row or so: between, it runs straight."""
    with gzip.open(file, "rt") as text:
        names = text.readline().strip().split(",")
        log = dict(zip(names, np.loadtxt(text, delimiter=",").T, strict=True))
    time = np.arange(len(log["ID"])) / RATE
    values = {f"disk_{k}_{a}": log[f"{a}{k}"] for k in (1, 2, 3) for a in "xyz"}
    for i in range(1, 7):
        new = np.flatnonzero(np.concatenate([[True], np.diff(log[f"phi{i}"]) != 0.0]))
        values[f"motor_{i}_angle"] = np.radians(np.interp(time, time[new], log[f"phi{i}"][new]))
    trials = []
    for k, piece in enumerate(np.array_split(np.arange(len(time)), PIECES)):
        kept = piece[::STEP]
        columns = {name: column[kept] for name, column in values.items()}
        trials.append(Trial(f"{file.name}_{k + 1}", time[kept] - time[kept[0]], columns, start=start + time[kept[0]]))
    return Recording("trunk", file.stem, "hardware: StanfordASL/trunk-stack", None, (*MOTORS, *DISKS), tuple(trials))


def _quadratic(first: Recording, second: Recording) -> float:
    """Return the RMS error (m) on a run of a quadratic of the motor angles that was fitted to another."""
    shown = []
    for run in (first, second):
        angles, seen = (
            np.concatenate([np.column_stack([t.values[c.name] for c in of]) for t in run.trials]) for of in (MOTORS, DISKS)
        )
        products = [angles[:, i] * angles[:, j] for i in range(6) for j in range(i, 6)]
        shown.append((np.column_stack([np.ones(len(angles)), angles, *products]), seen))
    (a, fitted), (b, judged) = shown
    left = judged - b @ np.linalg.lstsq(a, fitted, rcond=None)[0]
    return float(np.sqrt((left.reshape(len(left), -1, 3) ** 2).sum(axis=2).mean()))


if __name__ == "__main__":
    tyro.cli(main)
