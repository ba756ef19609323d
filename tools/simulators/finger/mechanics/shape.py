"""The true shape of a finger's test trials, as a scorer reads it: named points and the whole skin, every half second."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tools.simulators.finger.bench import Log
from tools.simulators.finger.mechanics.cables import interpolation
from tools.simulators.finger.mechanics.mesh import FINGER_LENGTH, radius
from tools.simulators.finger.mechanics.statics import Finger
from tools.simulators.finger.sensors import Built

UNIT = 0.01  # mm, of the stored integers
FRAMES = 0.5  # s


def surface() -> np.ndarray:
    """1,501 skin points (mm): 41 rings of 36 and 25 on the tip's face."""

    def ring(r: float, z: float, count: int) -> np.ndarray:
        a = 2 * np.pi * np.arange(count) / count
        return np.column_stack([r * np.cos(a), r * np.sin(a), np.full(count, z)])

    rings = [ring(float(radius(z)), z, 36) for z in np.linspace(0.0, FINGER_LENGTH, 41)]
    return np.concatenate([*rings, ring(0.0, FINGER_LENGTH, 1), ring(3.0, FINGER_LENGTH, 8), ring(6.0, FINGER_LENGTH, 16)])


def write_shape_truth(path: Path, table: Path, finger: Finger, built: Built, logs: Sequence[Log]) -> None:
    """NAME_time, NAME_vertices for every trial and NAME_surface for tests, in units of 0.01 mm in the base frame."""
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    points = np.array([[float(row[f"{a}_mm"]) for a in "xyz"] for row in rows])
    skin, turn = surface(), built.turn()
    of_points, of_skin = interpolation(finger.body, points), interpolation(finger.body, skin)
    arrays = {"names": np.array([row["name"] for row in rows]), "undeformed": points, "undeformed_surface": skin, "unit_mm": UNIT}
    for log in logs:
        name, time = log.trial.name, log.trial.time
        frames = np.searchsorted(time, np.arange(0.0, time[-1] + 1e-9, FRAMES) - 1e-9)
        arrays[f"{name}_time"] = time[frames]
        wanted = [("vertices", points, of_points)] + [("surface", skin, of_skin)] * name.startswith("test")
        for kind, start, weights in wanted:
            moved = np.array([(start + weights @ log.u[n]) @ turn.T for n in frames])
            arrays[f"{name}_{kind}"] = np.round(moved / UNIT).astype(np.int16)
    np.savez_compressed(path, **arrays)
