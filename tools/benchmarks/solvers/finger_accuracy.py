"""The soft finger's statics against independent finite elements: cases of tension, shortening and side load.

    python -m tools.benchmarks.solvers.finger_accuracy [--cases 12] [--seed 0]

Prints a line a case and a table of errors: tip and centreline in mm, cord strain in % of 0.0741 (that at 2 N), side loads in % of
the tip's way; and the time of a warm solve beside that of the simulator. E is drawn from 125 kPa +- 15 %.
"""

import time

import numpy as np
import tyro

from tools.simulators.finger.mechanics.equilibria import Equilibrium, Finger, equilibrium
from twin.body import Drive, Loads, Problem
from twin.mechanics.silicone import SoftStatics
from twin.robots import load

STRAIN_AT_2_N = 0.0741  # strain at 2 N
LOAD_STEPS = 8


def twin(E: float, kind: Drive, command: np.ndarray, side: np.ndarray, gravity: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the centreline (19, 3) mm, strains (4,) and ms a warm solve."""
    robot = load("finger")
    body = robot.silicone(robot.build({"silicone.youngs_modulus": E}))
    solver = SoftStatics(body)
    way = np.outer(np.arange(1, LOAD_STEPS + 1) / LOAD_STEPS, command)
    problem = Problem(np.arange(float(LOAD_STEPS)), way, Loads(gravity, force=side), drives=(kind,) * 4)
    began = time.perf_counter()
    path = solver.solve(problem)
    spent = (time.perf_counter() - began) / LOAD_STEPS
    assert path.status.all(), (E, kind, command)
    axis = np.column_stack([np.zeros((19, 2)), np.linspace(0.01, 0.1, 19)])
    line = axis + body.lattice.weights(axis) @ path.q[-1].reshape(-1, 3)
    return 1e3 * line, path.others["strain"][-1], 1e3 * spent


def case(rng: np.random.Generator, k: int) -> tuple[float, Drive, np.ndarray, np.ndarray, np.ndarray]:
    """Return one of: a tension, two shortenings, co-contraction, a side load; with and without gravity."""
    E, gravity = 125e3 * rng.uniform(0.85, 1.15), np.array([0.0, 0.0, 9.81 * (k % 2)])
    nothing, i = np.zeros(3), rng.integers(4)
    if k % 4 == 0:
        return E, Drive.TENSION, 2.0 * rng.uniform(0.4, 1.0) * np.eye(4)[i], nothing, gravity
    if k % 4 == 3:
        angle = rng.uniform(0, 2 * np.pi)
        return E, Drive.TENSION, np.zeros(4), 0.1 * rng.uniform(0.4, 1.0) * np.array([np.cos(angle), np.sin(angle), 0.0]), gravity
    if k % 4 == 1:
        pull = np.full(4, -6e-3)
        pull[[i, (i + 1) % 4]] = 9e-3 * rng.uniform(0.3, 1.0, 2) * [1.0, 0.6]
    else:
        pull = 1.8e-3 * rng.uniform(0.6, 1.0) + np.array([1.0, 0.0, -1.0, 0.0])[(np.arange(4) + i) % 4] * 5e-3 * rng.uniform()
    return E, Drive.DISPLACEMENT, pull, nothing, gravity


def main(cases: int = 12, seed: int = 0) -> None:
    """Print errors case by case, and their means."""
    rng, rows = np.random.default_rng(seed), []
    for k in range(cases):
        E, kind, command, side, gravity = case(rng, k)
        line, strain, ms = twin(E, kind, command, side, gravity)
        began = time.perf_counter()
        true = _simulated(E, kind, command, side, gravity)
        took = 1e3 * (time.perf_counter() - began)
        off = np.linalg.norm(line - true.centreline, axis=1)
        way = float(np.linalg.norm(true.tip - [0.0, 0.0, 100.0]))
        wrong = strain - true.strain
        rows.append(
            (off[-1], off.mean(), 100 * np.abs(wrong).max() / STRAIN_AT_2_N, 100 * off[-1] / way, ms, side.any(), (wrong**2).mean())
        )
        shown = np.round(1e3 * command if kind is Drive.DISPLACEMENT else command, 2)
        print(
            f"{k:3d} E {E / 1e3:.0f} kPa {kind} {shown} side {np.round(side, 3)} g {gravity[2]:.1f}: tip way {way:.1f} mm, off "
            f"{off[-1]:.2f}, centreline {off.mean():.2f} mm, strain {rows[-1][2]:.2f} %; {ms:.1f} ms a solve ({took:.0f} ms there)",
            flush=True,
        )
    table = np.array(rows, float)
    free, loaded = table[table[:, 5] == 0], table[table[:, 5] == 1]
    print(f"tendons: tip {free[:, 0].mean():.2f} / {free[:, 0].max():.2f} mm (mean / max), centreline {free[:, 1].mean():.2f} mm")
    print(f"strain {free[:, 2].mean():.2f} / {free[:, 2].max():.2f} % of {STRAIN_AT_2_N}; RMS {np.sqrt(free[:, 6].mean()):.1e}")
    if len(loaded):
        print(f"side loads: tip {loaded[:, 3].mean():.1f} / {loaded[:, 3].max():.1f} % of its way")
    print(f"{np.median(table[:, 4]):.1f} ms a warm solve (median)")


def _simulated(E: float, kind: Drive, command: np.ndarray, side: np.ndarray, gravity: np.ndarray) -> Equilibrium:
    """Return the same by the simulator."""
    pulls = tuple(map(float, command if kind is Drive.TENSION else 1e3 * command))
    down = (0.0, 0.0, float(gravity[2]))
    finger, across = Finger.of(E / 1e6, 0.49, core=2), tuple(map(float, side))
    if kind is Drive.TENSION:
        return equilibrium(finger, tension=pulls, side=across, gravity=down)
    return equilibrium(finger, shortening=pulls, side=across, gravity=down)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
