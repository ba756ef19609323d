"""Derivatives: a neighbour solved to first order is the one solved in full, under every law of a rod and every drive.

All fits go by these. Springs go on from sample to sample from where they came to rest, so that what one sample is off by, those
that follow multiply: the motions rest for long.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.effects.test_conformance import by_length, is_of_antagonists, is_of_models, is_of_sensors
from twin.diagnosis import Settings
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.calibration.objective import PARAMETER_DIFFERENCE, Evaluation, Objective
from twin.effects import catalogue
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")
OF_RODS = [e for e, law in catalogue().items() if not (is_of_sensors(law) or is_of_antagonists(law) or is_of_models(law))]
UNIT = {"tension": ("tendon_{}_tension", "N", 0.01), "current": ("sma_{}_current", "A", 3e-3)}


def pulled_and_held(drive: str) -> Recording:
    """Two trials: up, a little less, and so for long; the room warms by 5 K."""
    n = 60
    time = np.linspace(0.0, 150.0 if drive == "current" else 30.0, n)
    course = np.interp(np.arange(n), [0, 4, 30, 34, n - 1], [0.0, 1.0, 1.0, 0.94, 0.94])
    most, name = (0.9, UNIT["current"]) if drive == "current" else (2.0, UNIT["tension"])
    pulls = [Channel(name[0].format(i), "input", name[1], name[2]) for i in (1, 2, 3)]
    disks = [Channel(f"disk_{k}_{a}", "output", "mm", 2.5e-4) for k in (4, 8) for a in "xyz"]
    room = Channel("ambient_temperature", "context", "K")

    def trial(k: int, shares: tuple[float, ...]) -> Trial:
        values = {c.name: np.zeros(n) for c in disks} | {c.name: most * s * course for c, s in zip(pulls, shares, strict=True)}
        values |= {room.name: 296.15 + 5.0 * time / time[-1]}
        return Trial(f"{k}.csv", time, values, {"tip_payload": 0.02 * k}, start=500.0 * k)

    trials = (trial(0, (1.0, 0.9, 0.95)), trial(1, (0.9, 1.0, 0.8)))
    made = Recording("continuum", "rests", "simulation: none", np.array([9.81, 0.0, 0.0]), (*pulls, *disks, room), trials)
    return by_length(made) if drive == "length" else made


@cache
def base(drive: str) -> tuple[Model, Objective]:
    bench = prepare(pulled_and_held(drive), ROBOT)
    model, objective, _ = objective_of(bench, Twin.of(ROBOT), [0, 1], Settings(jobs=1))
    return model, objective


@pytest.mark.parametrize("drive", ["tension", "length", "current"])
@pytest.mark.parametrize("effect", OF_RODS)
def test_a_neighbour_to_first_order_is_the_one_in_full(effect: str, drive: str) -> None:
    model, objective = base(drive)
    predicted = [t.true for t in objective.evaluate(model).traces.values()]
    begin = next(iter(catalogue()[effect].fit_starts(predicted, 3)), None)
    if begin is None:
        pytest.skip("nothing of this name acts here")
    there = model.with_effect(effect, dict(begin.values), begin.free, 3)
    at = objective.evaluate(there)
    # What does not change stays. 0.05 sigmas over all rows: full solves are good for 1e-4 mm, 4e-4 sigma a coordinate, which over
    # 720 of them are 0.01; a fiftieth of a step of what is known of the robot moves 1 to 3.
    assert np.linalg.norm(moved(objective, at, there, once=True)) < 0.05
    labels = [f.label for f in there.free]
    for i in (0, labels.index("disks.pitch_3"), len(labels) - 1):
        x = there.vector()
        x[i] += PARAMETER_DIFFERENCE
        full, once = (moved(objective, at, there.at(x), once=o) for o in (False, True))
        # Second order in a fiftieth of a step: 2 %; and rows in which a tendon falls slack or a wall is met.
        assert np.linalg.norm(once - full) < 0.05 + 0.05 * np.linalg.norm(full), labels[i]


def moved(objective: Objective, at: Evaluation, model: Model, once: bool) -> np.ndarray:
    return objective.columns(at, [(model, 1.0)], once=once)[:, 0]
