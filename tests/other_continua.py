"""Continuum robots with other holes, disks and sections than the nominal one, written as files and loaded; and their rods."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import tomli_w

from tools.simulators.rod.mechanics.rod import Rod
from twin.body import Loads, Problem
from twin.mechanics.rod import Equilibrium
from twin.robots import Robot, load
from twin.robots.robot import models_folder

G = 9.81
LENGTH = 0.12
EI = 77.59e9 * np.pi / 4 * 0.4e-3**4
GJ = EI / 1.33
NOWHERE, HANGING, SIDEWAYS = (np.array(g, float) for g in ([0, 0, 0], [0, 0, G], [G, 0, 0]))
EXACT = 1e-11  # rad in every hinge
NOMINAL = tomllib.loads((models_folder() / "continuum/robot.toml").read_text("utf-8"))
# Two joint sets a piece are second order: 0.02 % of the length was measured here where tensions differ, of tips that move by more
# than half of it; a factor of two.
CLOSE = 4e-4 * LENGTH


def robot(folder: Path, structure: dict | None = None, drop: tuple[str, ...] = (), **numbers: tuple[object, str]) -> Robot:
    """The nominal robot with another [structure], and with other numbers (value, unit) by name, `__` for the dot."""
    entries = {n: e for n, e in NOMINAL["parameters"].items() if n not in drop and not n.startswith("springs.")}
    entries |= {n.replace("__", "."): {"value": v, "unit": u, "source": "test"} for n, (v, u) in numbers.items()}
    file = {**NOMINAL, "structure": {**NOMINAL["structure"], **(structure or {})}, "parameters": entries}
    (folder / "robot.toml").write_text(tomli_w.dumps(file), "utf-8")
    return load(str(folder))


def disks(solver: Equilibrium, tension: object, gravity: np.ndarray = NOWHERE, payload: float = 0.0, **more) -> np.ndarray:
    """Disk centres (n_disk, 3) m at rest."""
    problem = Problem(np.zeros(1), np.array([tension], float), Loads(gravity, payload, **more), tolerance=EXACT)
    path = solver.solve(problem)
    assert path.status.all()
    assert not path.unstable_start
    return path.markers[0, :-1]


def off(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b, axis=-1).max())


TURN = np.outer([1.0, -0.5, 0.0], 15.0 * np.arange(1, 9))  # deg: a helix, one the other way, a straight tendon
OUTWARD = np.outer([-0.4, 0.0, 0.2], np.arange(1, 9))  # mm: converging, even, spreading
HELICAL = {"holes__turn": (TURN.tolist(), "deg"), "holes__outward": (OUTWARD.tolist(), "mm")}


def helical_rod() -> Rod:
    turn, outward = (np.pad(x, ((0, 0), (1, 0))).T for x in (TURN, OUTWARD))
    return Rod(hole_radius=8e-3 + 1e-3 * outward, hole_angle=np.radians(np.array([0.0, 120.0, 240.0]) + turn))


SEGMENTS = {"tendons": 6, "tendons_end": [4, 4, 4, 8, 8, 8]}
SIX = {"tendons__angle": ([0.0, 120.0, 240.0, 60.0, 180.0, 300.0], "deg")}
