"""Tip error of the twin's static solve against the independent rod simulator, in per cent of the length.

    python -m tools.benchmarks.solvers.accuracy [--poses 200]

Random tensions 0-4 N, payload 0-30 g hanging and sideways (0-10 g upright), gravity along any axis. In plane: one tendon,
gravity and payload in its plane. Also printed: RMS over all markers in mm, which is what `accuracy` in robot.toml claims,
before and after the nuisance parameters have absorbed what they can (the twin is always calibrated first).
"""

import numpy as np
import tyro

from tools.simulators.rod.mechanics.rod import Rod, solve
from twin.body import Loads, Problem
from twin.mechanics.rod import Equilibrium
from twin.robots import load

GRAVITY_SIZE = 9.81
AXES = {
    "hanging": [0, 0, GRAVITY_SIZE],
    "+x": [GRAVITY_SIZE, 0, 0],
    "-x": [-GRAVITY_SIZE, 0, 0],
    "+y": [0, GRAVITY_SIZE, 0],
    "-y": [0, -GRAVITY_SIZE, 0],
    "upright": [0, 0, -GRAVITY_SIZE],
}
BODY_LENGTH = 0.12


def draw_poses(rng: np.random.Generator, count: int, heaviest: float, planar: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return tensions (count, 3) N and payloads (count,) kg."""
    tension = np.zeros((count, 3))
    if planar:
        tension[:, 0] = rng.uniform(0, 4, count)
    else:
        tension = rng.uniform(0, 4, (count, 3)) * (rng.uniform(size=(count, 3)) < 0.7)
    return tension, rng.uniform(0, heaviest, count)


def compare(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Return marker errors (count, 8, 3) m by case."""
    rng = np.random.default_rng(seed)
    solver = Equilibrium(load("continuum").build())
    out = {}
    for name, gravity in AXES.items():
        for planar in (True, False):
            if planar and name in ("+y", "-y"):
                continue
            tension, payload = draw_poses(rng, count, 0.01 if name == "upright" else 0.03, planar)
            errors = []
            for T, m in zip(tension, payload, strict=True):
                path = solver.solve(Problem(np.zeros(1), T[None], Loads(np.array(gravity, float), payload=m)))
                if path.unstable_start or not path.status.all():
                    continue
                errors.append(path.markers[0, :8] - solve(Rod(), T, gravity=gravity, payload=m).disks)
            out[f"{name}, {'in plane' if planar else '3D'}"] = np.array(errors)
    return out


def main(poses: int = 200) -> None:
    """Print tip and marker errors by case."""
    print(f"{'case':>20} {'n':>5} {'median %':>9} {'p95 %':>7} {'max %':>7} {'RMS mm, markers':>16}")
    for name, e in compare(poses).items():
        tip = 100 * np.linalg.norm(e[:, -1], axis=1) / BODY_LENGTH
        rms = 1e3 * np.sqrt((e**2).sum(axis=2).mean())
        print(f"{name:>20} {len(e):>5} {np.median(tip):>9.3f} {np.quantile(tip, 0.95):>7.3f} {tip.max():>7.3f} {rms:>16.3f}")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
