"""How fast the viewer is: seconds from command to first picture, and pictures a second of a replay that never waits.

    python -m tools.benchmarks.viewer.speed [ROBOT ...]

Figures belong to the machine and what else it does: report ratios and medians.
"""

import subprocess
import sys
import time

import numpy as np
import tyro
import viser

from twin.measurements import read
from twin.prediction.twin import Twin
from twin.robots.robot import models_folder
from twin.viewer import TwinPanel

SETS = {"continuum": "friday", "finger": "drift"}  # samples bundled with the robots
PICTURES_TIMED = 120
VIEWER_STARTS = 3


def pictures(robot: str) -> float:
    """Return the pictures a second of a replay whose loop never sleeps."""
    server = viser.ViserServer(host="127.0.0.1", port=8700, verbose=False)
    try:
        app = TwinPanel(server, [(robot, Twin.of(robot))], read(models_folder() / robot / "samples" / SETS[robot]))
        app.tick()
        app.scrubber.play.value = True
        app.tick()
        began = time.perf_counter()
        for _ in range(PICTURES_TIMED):
            app.tick()
        return PICTURES_TIMED / (time.perf_counter() - began)
    finally:
        server.stop()


def start(robot: str) -> float:
    """Return the seconds from the command to its printed address, which follows the first picture."""
    began = time.perf_counter()
    command = [sys.executable, "-m", "twin.cli", "view", robot]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        told = any("http://" in line for line in process.stdout)
        taken = time.perf_counter() - began
        process.terminate()
    if not told:
        raise SystemExit(f"{' '.join(command)} printed no address")
    return taken


def main(robots: tyro.conf.Positional[tuple[str, ...]] = tuple(SETS)) -> None:
    """Print the figures of each robot."""
    for robot in robots:
        first, rate = np.median([start(robot) for _ in range(VIEWER_STARTS)]), pictures(robot)
        print(f"{robot}: first picture after {first:.2f} s (median of {VIEWER_STARTS}), {rate:.0f} pictures a second")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
