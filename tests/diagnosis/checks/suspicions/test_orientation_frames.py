"""Orientations about other axes, mirrored, or inverse are told before any fit; as they should be they are not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tools.simulators.rod.mechanics.rod import Rod, follow
from twin.diagnosis.checks.suspicions import suspicions
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")
PULLS = tuple(Channel(f"tendon_{i}_tension", "input", "N", 0.01) for i in (1, 2, 3))
QUATERNION = tuple(Channel(f"disk_8_{a}", "output", "1", 2e-3) for a in ("qw", "qx", "qy", "qz"))


@cache
def turned() -> tuple[np.ndarray, list[Rotation]]:
    """Tensions (n, 3) N of two tendons in turn, and the orientation of the last disk, by the independent rod."""
    up = np.linspace(0.0, 1.0, 12)
    T = np.concatenate([np.column_stack([up, 0.0 * up, 0.0 * up]), np.column_stack([0.0 * up, up, 0.0 * up])])
    return T, [Rotation.from_matrix(R) for R in follow(Rod(), T).rotations[:, -1]]


def told(change: np.ndarray, inverse: bool = False) -> list[tuple[str, str, str]]:
    """Suspicions of orientations about the axes `change` (3, 3) of the base frame, or of their inverse."""
    T, true = turned()
    rng, trials = np.random.default_rng(0), []
    for k in range(2):
        noise = Rotation.from_rotvec(rng.normal(0, 2e-3, (len(true), 3)))
        read = Rotation.from_matrix([change @ R.as_matrix() @ change.T for R in true]) * noise
        q = (read.inv() if inverse else read).as_quat(scalar_first=True)
        values = {c.name: T[:, i] for i, c in enumerate(PULLS)} | {c.name: q[:, i] for i, c in enumerate(QUATERNION)}
        trials.append(Trial(f"{k}.csv", 2.0 * np.arange(len(T)), values, start=100.0 * k))
    day = Recording("continuum", "test", "hardware", np.zeros(3), (*PULLS, *QUATERNION), tuple(trials))
    prepared, twin = prepare(day, ROBOT), Twin(ROBOT)
    nominal = [t.outputs(twin, prepared) for t in simulate(twin, prepared)]
    return [(s.kind, s.words, s.change) for s in suspicions(prepared, twin, [], nominal)]


@pytest.mark.parametrize(
    ("change", "inverse", "says"),
    [
        (np.eye(3), True, "x of the file is -x, y of the file is -y"),
        (np.diag([1.0, -1.0, 1.0]), False, "x of the file is -x, y of the file is y"),
        (np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), False, "x of the file is y, y of the file is -x"),
    ],
    ids=["inverse", "mirrored", "turned"],
)
def test_other_axes_are_told_with_the_change(change: np.ndarray, inverse: bool, says: str) -> None:
    """A rod turns about x and y alone; a mirror of y turns its rotation vectors about y."""
    (kind, words, _) = next(t for t in told(change, inverse) if t[0] == "orientation")
    assert kind == "orientation"
    assert says in words
    assert "disk_8" in words


def test_orientations_as_they_should_be_are_not() -> None:
    assert told(np.eye(3)) == []
