"""Whether a body's damping is left out of statics: not where shapes are as late as it says or later, but where they are not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tools.simulators.rod.rod import Rod, follow
from twin.measurements import Channel, Recording, Trial
from twin.prediction.damping import damped_as_measured
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")
PULLS = tuple(Channel(f"tendon_{i}_tension", "input", "N", 0.01) for i in (1, 2, 3))
TIP = tuple(Channel(f"disk_8_{a}", "output", "mm", 2.5e-4) for a in "xyz")
DAMPED = ROBOT.value("damping.time")  # s


@cache
def tips(late: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time (n,) s, tensions (n, 3) N at up to 3 N/s, and tips (n, 3) m of the independent rod `late` by a first-order lag (s)."""
    time = np.arange(0.0, 4.0, 0.04)
    fine = np.arange(0.0, 4.0, 0.001)
    pull = 1.0 - np.cos(3.0 * fine)
    felt = np.zeros_like(pull)
    for k in range(1, len(fine)):
        felt[k] = felt[k - 1] + (pull[k] - felt[k - 1]) * (1.0 - np.exp(-1e-3 / late)) if late else pull[k]
    steps = np.column_stack([felt[::40], 0.0 * time, 0.0 * time])
    drive = np.column_stack([pull[::40], 0.0 * time, 0.0 * time])
    return time, drive, follow(Rod(), steps).disks[:, -1]


def left_out(late: float, n: int = 2, stiff: float = 1.0) -> bool:
    """Whether damping is left out of the prediction of n trials, by a twin that is `stiff` times as stiff as the robot; if it is
    not as stiff its camera is 0.15 m off, too."""
    time, drive, tip = tips(late)
    tip = tip + np.array([0.15, -0.1, 0.05]) * (stiff != 1.0)
    rng, trials = np.random.default_rng(1), []
    for k in range(n):
        noisy = tip + rng.normal(0.0, 2.5e-4, tip.shape)
        values = {c.name: drive[:, i] for i, c in enumerate(PULLS)} | {c.name: noisy[:, i] for i, c in enumerate(TIP)}
        trials.append(Trial(f"{k}.csv", time, values, start=100.0 * k))
    day = Recording("continuum", "test", "hardware", np.zeros(3), (*PULLS, *TIP), tuple(trials))
    E = stiff * ROBOT.value("backbone.youngs_modulus")
    prepared, twin = prepare(day, ROBOT), Twin(ROBOT, {"backbone.youngs_modulus": E})
    assert all(i.damped for i in prepared.inputs)
    with_it = [t.outputs(twin, prepared) for t in simulate(twin, prepared)]
    chosen, predicted = damped_as_measured(prepared, twin, with_it, range(n))
    out = not any(i.damped for i in chosen.inputs)
    assert out == any("damping" in words for words in chosen.notices)
    np.testing.assert_array_equal(predicted[0], next(t.outputs(twin, chosen) for t in simulate(twin, chosen)))
    return out


@pytest.mark.parametrize(("late", "out"), [(0.0, True), (DAMPED, False), (5.0 * DAMPED, False)], ids=["at once", "damped", "later"])
def test_damping_is_left_out_where_shapes_follow_at_once(late: float, out: bool) -> None:
    """10 ms at 3 N/s are 0.03 N, some 0.5 mm at the tip, against 0.25 mm of noise in 200 rows."""
    assert left_out(late) == out


@pytest.mark.parametrize(("late", "out"), [(0.0, True), (DAMPED, False)], ids=["at once", "damped"])
@pytest.mark.parametrize("stiff", [0.9, 1.1])
def test_neither_stiffness_nor_a_camera_off_decides(late: float, out: bool, stiff: float) -> None:
    """A camera 0.15 m off makes errors a hundred times those of the damping, all of one sign."""
    assert left_out(late, 2, stiff) == out
