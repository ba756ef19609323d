"""A continuum robot seen by one IMU, from public data: python -m tools.benchmarks.hardware.imu_robot FOLDER OUT

FOLDER holds const_theta20_0.csv.gz and on, and robot_guess.toml. Nine runs around a circle, in plateaus, logged by an unknown clock
(10 rows a second are assumed). With the heading among the outputs, and without, where runs are held out.
"""

import gzip
import json
import re
from pathlib import Path

import numpy as np
import tyro

from twin.diagnosis import Settings, diagnose
from twin.measurements import Channel, Recording, Trial
from twin.prediction.twin import Twin
from twin.robots import load

SIGN = (-1.0, 1.0, 1.0)  # of roll, pitch, yaw: with this roll the tip goes round the way the commands do
RATE, STEP = 10.0, 5  # rows a second, a guess; rows of the log for one that is kept
NOISE = np.radians(1.0)  # the log is in whole degrees
# Neither is published how the IMU sits on its disk nor what a motor winds, from which zero, and how tendons are held and give: a
# motor's angle here is that which the tendons should bend by.
UNKNOWN = """"motors.radius" = { value = [12.54, 12.54, 12.54], unit = "mm", std = 6, low = 2, high = 60, source = "unknown gain" }
"motors.zero" = { value = [0.0, 0.0, 0.0], unit = "deg", std = 10, source = "unknown" }
"tendons.stretch" = { value = 0.5, unit = "mm/N", std = 0.5, low = 0.02, high = 5, source = "unknown" }
"tendons.pretension" = { value = 1.0, unit = "N", std = 1, low = 0, high = 10, source = "unknown" }
""" + "\n".join(f'"markers.turn_{a}" = {{ value = 0.0, unit = "deg", std = 30, source = "unknown mount" }}' for a in "xyz")
PULLS = tuple(Channel(f"motor_{k}_angle", "input", "deg", np.radians(0.05)) for k in (1, 2, 3))


def main(folder: tyro.conf.Positional[Path], out: tyro.conf.Positional[Path]) -> None:
    """Diagnose the runs with and without the heading and print what is said and the errors on runs that no fit has seen.

    Args:
        folder: the raw data
        out: folder for the robot and the answers
    """
    place = out / "robot"
    place.mkdir(parents=True, exist_ok=True)
    described = re.sub(r'"(frame|markers)\.(turn|offset)_.\".*\n', "", (folder / "robot_guess.toml").read_text("utf-8"))
    structure = "markers = [5]\nmotors  = [[1], [2], [3]]"
    described = described.replace("markers = [5, 5]", structure).replace("[parameters]", f"[parameters]\n{UNKNOWN}")
    (place / "robot.toml").write_text(described, "utf-8")
    twin = Twin.of(load(str(place)))
    for name, axes in (("with its heading", ("roll", "pitch", "yaw")), ("without", ("roll", "pitch"))):
        channels = (*PULLS, *(Channel(f"marker_1_{a}", "output", "deg", NOISE) for a in axes))
        runs = tuple(_run(folder / f"const_theta20_{k}.csv.gz", 200.0 * k, channels) for k in range(9))
        found = diagnose(Recording("imu robot", "circles", "hardware: massemassiv", None, channels, runs), twin, Settings())
        print(f"## {name}\n{found.summary()}\n{json.dumps(found.errors.__dict__, default=str, indent=1)}")
        print("\n".join(f"{s.kind}: {s.words}; {s.change}" for s in found.suspicions))


def _run(file: Path, start: float, channels: tuple[Channel, ...]) -> Trial:
    """Return one run: commanded angles theta cos(gamma + 2 pi k / 3) of three motors, orientations as logged."""
    with gzip.open(file, "rt") as text:
        log = np.genfromtxt(text, delimiter=",", skip_header=1)[::STEP]
    time = np.arange(len(log)) * STEP / RATE
    gamma, theta = np.radians(log[:, 4]), np.radians(log[:, 5])
    values = {f"motor_{k + 1}_angle": theta * np.cos(gamma + 2.0 * np.pi * k / 3.0) for k in range(3)}
    values |= {f"marker_1_{a}": SIGN[j] * np.radians(log[:, 1 + j]) for j, a in enumerate(("roll", "pitch", "yaw"))}
    return Trial(file.name.removesuffix(".csv.gz"), time, {c.name: values[c.name] for c in channels}, start=start)


if __name__ == "__main__":
    tyro.cli(main)
