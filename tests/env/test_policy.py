"""Policies on the bench robot: that robot between commands, the environment around it, the table that resumes, the example."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tools.benchmarks.tasks.policy.bench_reach import BenchReach, robot_of
from tools.benchmarks.tasks.policy.cells import Cell, plan, run
from tools.benchmarks.tasks.policy.days import EFFECT_DAYS
from tools.benchmarks.tasks.policy.reach import SENSORS_SEEN, TASK, acting, distances, episodes_of, task, train
from tools.benchmarks.tasks.policy_table import reached, table
from tools.simulators.rod.bench import run as run_day
from tools.simulators.rod.design import Day, Trial
from tools.simulators.rod.effects import all_effects
from tools.simulators.rod.live import LiveRobot
from tools.simulators.rod.nuisance import built
from twin.env.continuum import ContinuumReach
from twin.foundation.errors import DataError, UnknownNameError

SIDEWAYS = (9.81, 0.0, 0.0)
TWIN = """
format = "twin/1"
robot = "continuum"
[[effect]]
id = "tip_payload"
parameters = { mass = { value = 12.0, unit = "g" } }
"""


def a_robot(*effects: str) -> LiveRobot:
    """A built one on its side, with effects twice as strong as drawn."""
    drawn = [all_effects()[name].draw(np.random.default_rng(7)) for name in effects]
    return LiveRobot(built(np.random.default_rng(3)), [type(e)(**{**vars(e), "strength": 2.0}) for e in drawn], SIDEWAYS)


@pytest.mark.parametrize("effects", [("tendon_friction",), ("backbone_creep", "tip_payload"), ("base_tilt", "load_cell_gain")])
def test_a_live_robot_does_what_the_bench_logs(effects: tuple[str, ...]) -> None:
    robot, time = a_robot(*effects), 0.2 * np.arange(16)
    command = np.vstack([np.zeros(3), np.clip(np.random.default_rng(0).uniform(-0.6, 0.6, (15, 3)).cumsum(axis=0), 0.0, 2.0)])
    day = Day((Trial("a", 0.0, time, time, command),), SIDEWAYS, np.array([[0.0, 9.0], [23.0, 23.0]]))
    log = run_day(robot.rod, robot.effects, day)[0]
    seen = [(robot.markers(), robot.load_cells(), robot.displacement())]
    for tension in command[1:]:
        robot.pull(tension, 0.2)
        seen.append((robot.markers(), robot.load_cells(), robot.displacement()))
    markers, cells, travel = (np.array(column) for column in zip(*seen, strict=True))
    # The day stops where a tension has changed by 0.25 N, the live robot at equal parts of a command; creep between is linear in
    # time for both: 2e-7 m here. Without the two seconds before the first row it is 5e-6 m off at once.
    np.testing.assert_allclose(markers, log.markers, rtol=0, atol=1e-6)
    np.testing.assert_allclose(cells, log.tension, rtol=0, atol=1e-9)
    np.testing.assert_allclose(travel, log.displacement, rtol=0, atol=1e-6)
    assert np.ptp(markers[:, -1, 0]) > 0.01


def test_a_live_robot_refuses_what_it_cannot_do() -> None:
    with pytest.raises(ValueError, match="actuator_lag acts in deliver"):
        a_robot("actuator_lag")


def test_at_rest_is_where_the_motion_ends(tmp_path: Path) -> None:
    moved, rested = (ContinuumReach("continuum", interval=0.2, dynamic=dynamic) for dynamic in (True, False))
    for env in (moved, rested):
        env.reset(seed=1)
        for action in [[1.0, 0.5, -1.0]] * 3 + [[0.0, 0.0, 0.0]] * 5:
            seen = env.step(np.array(action))
        env.close()
    # A second of hold: the first mode, of 10 ms Rayleigh damping, is below a micrometre after 0.6 s (seen: 0.01 um).
    np.testing.assert_allclose(moved.plant.readings().tip, rested.plant.readings().tip, rtol=0, atol=1e-6)
    assert seen[4]["tip"][0] > 0.01
    with pytest.raises(DataError, match="joint speeds"):
        ContinuumReach("continuum", dynamic=False, observe="full")


def test_an_environment_shows_the_sensors_asked_for() -> None:
    every, some = (ContinuumReach("continuum", dynamic=False, **o) for o in ({}, {"sensors": ("load_cells", "tip")}))
    assert list(some.parts) == ["load_cells", "commands", "tip", "goal"]
    full, less = (env.reset(seed=4)[0] for env in (every, some))
    np.testing.assert_array_equal(less, np.delete(full, slice(3, 6)))  # without the encoders
    assert some.observation_space.shape == less.shape
    with pytest.raises(UnknownNameError, match=r"camera.*encoders, load_cells, tip"):
        ContinuumReach("continuum", sensors=("camera",))


def test_goals_on_the_bench_are_the_same_for_every_policy_and_within_its_reach(tmp_path: Path) -> None:
    (tmp_path / "twin.toml").write_text(
        TWIN.replace("[[effect]]", '[parameters]\n"backbone.youngs_modulus" = { value = 70, unit = "GPa" }\n[[effect]]')
    )
    robot = a_robot("tip_payload")
    one, other = (BenchReach(robot, twin, sensors=SENSORS_SEEN[True], **TASK) for twin in ("continuum", tmp_path / "twin.toml"))
    for env in (one, other):
        env.reset(seed=5)
    np.testing.assert_array_equal(one.goal, other.goal)
    assert one.pull.tension > 1.05 * other.pull.tension  # 77.59 over 70 GPa
    tension = np.array([1.0, 0.0, 0.4])
    robot.pull(tension, 0.2)
    np.testing.assert_allclose(robot.rest_tip(tension), robot.disks[-1], rtol=0, atol=1e-7)


def a_bench(out: Path, effect: str) -> None:
    """What a cell needs of a day of `effect`, 12 g or as drawn: whose robot it was, and a twin."""
    (out / "days" / effect).mkdir(parents=True)
    truth = {"mismatch": "built", "seed": 5, "effects": [{"id": effect, "parameters": {"strength": 12.0}}]}
    (out / "days" / effect / "truth.json").write_text(json.dumps(truth))
    (out / "days" / f"{effect}-calibrated.toml").write_text(TWIN)


def test_the_table_does_no_cell_twice(tmp_path: Path) -> None:
    a_bench(tmp_path, "tip_payload")
    assert robot_of(tmp_path / "days" / "tip_payload").situation.payload == pytest.approx(0.012)
    cell = Cell("calibrated", "tip_payload", blind=True, seed=None)
    run(cell, tmp_path, episodes=3)
    written = (tmp_path / cell.file).read_bytes()
    (tmp_path / cell.file).write_text('{"bench": {"tip_payload": [0.001, 0.006]}}')
    run(cell, tmp_path, episodes=3)
    kept = {cell: json.loads((tmp_path / cell.file).read_text())}
    assert "| tip payload |  |  |  |  |  | 50 |  |" in table(kept, blind=True)  # one of two goals; not done again
    (tmp_path / cell.file).unlink()
    run(cell, tmp_path, episodes=3)
    assert (tmp_path / cell.file).read_bytes() == written
    # It knows the payload; what is left are a built robot's tolerances, 2 or 3 mm of the 30 to 70 that the tip goes.
    assert reached(json.loads(written)["bench"]["tip_payload"]) == 100.0
    assert not list(tmp_path.glob("*.part"))
    assert len(plan(2)) == len({c.file for c in plan(2)}) == 2 * (1 + 2 * len(EFFECT_DAYS)) + 2 * 2 * (1 + 3 * len(EFFECT_DAYS))


def test_a_policy_learns_and_is_tried_on_the_bench(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="pip install '.[policy]' to try the example")
    a_bench(tmp_path, "tip_payload")
    seen: list[int] = []
    env = task("continuum", blind=False)
    act = acting(train(env, seed=0, steps=1000, look=lambda step, act: seen.append(step)))
    assert seen == [1000]
    before = acting(train(task("continuum", blind=False), seed=0, steps=20))
    tried = episodes_of(BenchReach(robot_of(tmp_path / "days" / "tip_payload"), "continuum", sensors=SENSORS_SEEN[False], **TASK))
    # 600 updates: still 1 to 3 mm off in the end; one that has learned nothing stands centimetres away.
    assert np.median(distances(tried, act, 5)) < 0.5 * np.median(distances(tried, before, 5))
