"""The environments: gymnasium's own checker, seeds, refusals, and that effects and randomisation act in them as they should."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from twin.body import Drive
from twin.effects import effect_class
from twin.env.continuum import ContinuumReach, ContinuumTrack
from twin.env.episodes.domain_randomisation import ParameterSpread, draw_twin, read_spread
from twin.env.plants.rod_plant import RodPlant
from twin.foundation.errors import DataError, TwinError, UnknownNameError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import read_twin, write_twin

DIAGNOSED = """
format = "twin/1"
robot = "continuum"
[parameters]
"backbone.youngs_modulus" = { value = 76.1, std = 0.5, unit = "GPa" }
[[effect]]
id = "tendon_friction"
parameters = { mu = { value = 0.21, std = 0.02, unit = "1" } }
"""

TOGETHER = """{"effects": [], "correlation": {
    "parameters": ["disks.mass", "tendon_friction.mu", "backbone.youngs_modulus"],
    "matrix": [[1.0, 0.2, 0.0], [0.2, 1.0, -0.9], [0.0, -0.9, 1.0]]}}"""


OWN = (("backbone.youngs_modulus", "tendon_friction.mu"), np.array([[1.0, 0.6], [0.6, 1.0]]))


@pytest.fixture
def diagnosed(tmp_path: Path) -> Path:
    path = tmp_path / "twin.toml"
    path.write_text(DIAGNOSED)
    return path


def test_gymnasium_finds_them_by_itself() -> None:
    """By the module in the name, in a process where nothing of the twin was imported."""
    code = "import gymnasium; print(gymnasium.make('twin.env:twin/ContinuumReach-v0').spec.max_episode_steps)"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout.strip()) == (0, "100"), done.stderr


def episode(env: ContinuumReach, seed: int, steps: int = 30) -> np.ndarray:
    rows = [env.reset(seed=seed)[0]]
    rng = np.random.default_rng(0)
    rows += [env.step(rng.uniform(-1, 1, env.n).astype(np.float32))[0] for _ in range(steps)]
    return np.array(rows)


@pytest.mark.parametrize("kind", [ContinuumReach, ContinuumTrack])
def test_a_seed_gives_the_same_episode_bit_for_bit(kind: type[ContinuumReach], diagnosed: Path) -> None:
    env = kind(diagnosed, randomise=True, tip_noise=2.5e-4, payload=(0.0, 0.01), observe="full")
    first, other, again = (episode(env, seed) for seed in (3, 4, 3))
    assert first.tobytes() == again.tobytes()
    assert not np.array_equal(first, other)
    assert np.isfinite(first).all()


def predicted(twin: Twin, whole: Recording, dynamic: bool) -> np.ndarray:
    """The trial's only marker (n, 3), its commands straight from row to row, as an environment has them."""
    bench = prepare(whole, twin.robot)
    bench = replace(bench, inputs=tuple(replace(i, smooth=False) for i in bench.inputs))
    return simulate(twin, bench, dynamic=dynamic)[0].outputs(twin, bench)


def test_the_environment_moves_as_the_twin_predicts() -> None:
    """Friction and a lag in force: the plant, step by step, against the prediction of the same commands as a whole trial."""
    effects = tuple(effect_class(n)(v) for n, v in (("tendon_friction", {"mu": 0.25}), ("actuator_lag", {"time": 0.15})))
    twin = replace(Twin.of("continuum"), effects=effects)
    plant, time = RodPlant(twin, 0.05), np.arange(41) * 0.05
    command = np.clip(np.column_stack([time, time - 1.0, 0 * time]), 0.0, 1.5)
    seen = np.array([plant.readings().markers[-1], *(plant.step(c).markers[-1] for c in command[1:])])
    channels = [Channel(f"tendon_{i}_tension", "input", "N") for i in (1, 2, 3)] + [
        Channel(f"tip_{a}", "output", "m") for a in "xyz"
    ]
    values = {c.name: command[:, k] if k < 3 else np.zeros(41) for k, c in enumerate(channels)}
    whole = Recording("continuum", "", "", None, tuple(channels), (Trial("a", time, values),))
    there = predicted(twin, whole, dynamic=True)
    # The same steps but for when the elastic correction is taken anew (every other step, counted from each call): under 1e-6 m.
    assert np.abs(seen - there).max() < 1e-6
    assert np.ptp(seen[:, 0]) > 0.02


@pytest.mark.parametrize("dynamic", [True, False])
@pytest.mark.parametrize(("drive", "interval"), [(Drive.DISPLACEMENT, 0.05), (Drive.CURRENT, 1.0)])
def test_lengths_and_currents_move_it_as_the_twin_predicts(drive: Drive, interval: float, dynamic: bool) -> None:
    """Friction and a lag in force, step by step against the whole trial; a current holds from when it is commanded."""
    effects = tuple(effect_class(n)(v) for n, v in (("tendon_friction", {"mu": 0.25}), ("actuator_lag", {"time": 0.6 * interval})))
    twin = replace(Twin.of("continuum"), effects=effects)
    by_length = drive is Drive.DISPLACEMENT
    plant = RodPlant(twin, interval, dynamic=dynamic, drive=drive)
    told = np.minimum(np.arange(1, 31) / (20 if by_length else 4), 1.0)[:, None]
    told = told * (8e-3 * np.array([1.0, -0.5, -0.5]) if by_length else 1.15 * np.array([1.0, 0.7, 0.0]))
    seen = np.array([plant.readings().markers[-1], *(plant.step(c).markers[-1] for c in told)])
    command = np.vstack([0.0 * told[:1], told] if by_length else [told, told[-1:]])
    names = [f"tendon_{i}_displacement" if by_length else f"sma_{i}_current" for i in (1, 2, 3)]
    channels = [Channel(n, "input", "m" if by_length else "A") for n in names] + [Channel(f"tip_{a}", "output", "m") for a in "xyz"]
    values = {c.name: command[:, k] if k < 3 else np.zeros(31) for k, c in enumerate(channels)}
    whole = Recording("continuum", "", "", None, tuple(channels), (Trial("a", np.arange(31) * interval, values),))
    there = predicted(twin, whole, dynamic)
    # As above where MuJoCo steps; at rest the same solve, sample by sample.
    assert np.abs(seen - there).max() < (1e-6 if dynamic else 1e-9)
    assert np.ptp(seen[:, 0]) > 0.005


def test_springs_reach_the_goals_that_are_drawn_for_them() -> None:
    """The furthest towards tendon 1, under the most current through its spring; one beyond it is out of reach."""
    env = ContinuumReach("continuum", drive="current", dynamic=False)
    env.reset(seed=1)
    env._path = env._rest_tips(np.array([env._goal_reach]), np.zeros(1))
    for _ in range(200):  # 100 s; all others stay cold
        info = env.step(np.array([1.0, 0.0, 0.0]))[-1]
    # Within reach, and not by much: of a goal's pull and a spring's the last has two cold ones beside it, which bend it on.
    assert 1.0 < info["tip"][0] / env.goal[0] < 1.1
    assert env.command == pytest.approx([env.full, 0.0, 0.0])
    beyond = env._rest_tips(np.array([1.3 * env._goal_reach]), np.zeros(1))[0]
    assert np.linalg.norm(info["tip"] - beyond) > 5e-3


def test_a_bend_by_displacements_goes_no_further_than_the_most_and_tightens_nothing() -> None:
    env = ContinuumReach("continuum", drive="displacement", dynamic=False, observe="sensors")
    env.reset(seed=1)
    for _ in range(60):
        seen, *_ = env.step(np.ones(2))
    assert np.linalg.norm(env.command) == pytest.approx(env.options.most * env.pull.displacement)
    slack = seen[:3] < 1e-3  # full pulls; of three tendons those on the far side are let go
    assert slack.any()
    assert seen[:3].max() < 2.0


def test_a_reachable_goal_is_reached_by_its_own_tensions() -> None:
    env = ContinuumReach("continuum")
    env.reset(seed=1)
    goals = env._rest_tips(np.array([0.8]), np.array([0.0]))  # tendon 1 alone (the others let go)
    env._path = goals
    wanted = 0.8 * env.pull.tension
    for _ in range(100):
        rate = np.clip((np.array([wanted, 0, 0]) - env.command) / (env.pull.tension * env.interval), -1, 1)
        _, reward, terminated, truncated, info = env.step(rate)
    assert not terminated
    assert not truncated
    assert info["is_success"]
    assert info["distance"] < 1e-4  # m: five seconds, of which the pull takes one; the first mode is gone after one more
    assert reward == pytest.approx(-info["distance"] / (0.1 * env.length))


def test_bad_options_are_told_with_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match=r"interval.*randomise.*did you mean 'payload'"):
        gymnasium.make("twin/ContinuumReach-v0", paylod=(0.0, 0.1))
    for name in ("two_link", "finger"):
        with pytest.raises(DataError, match="no backbone"):
            gymnasium.make("twin/ContinuumReach-v0", twin=name)
    with pytest.raises(UnknownNameError, match=r"drive.*voltage.*current, displacement, tension"):
        gymnasium.make("twin/ContinuumReach-v0", drive="voltage")
    env = ContinuumReach("continuum", ranges={"tendon_frction.mu": (0.0, 0.3)})
    with pytest.raises(UnknownNameError, match=r"tendon_friction\.mu"):
        env.reset(seed=0)


def toml_table(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text("utf-8"))


def correlated_draws(path: Path, rng: np.random.Generator) -> float:
    """The correlation of Young's modulus and friction among 400 drawn twins."""
    twin = read_twin(path)
    spread = read_spread(path, twin)
    drawn = [draw_twin(twin, spread, {}, rng) for _ in range(400)]
    return float(np.corrcoef([[t.values["backbone.youngs_modulus"], t.effects[0]["mu"]] for t in drawn], rowvar=False)[0, 1])


def test_randomisation_draws_what_the_diagnosis_does_not_know(diagnosed: Path) -> None:
    twin = read_twin(diagnosed)
    spread = read_spread(diagnosed, twin)
    assert spread.std == pytest.approx({"backbone.youngs_modulus": 0.5e9, "tendon_friction.mu": 0.02})
    rng = np.random.default_rng(0)
    drawn = [draw_twin(twin, spread, {}, rng) for _ in range(400)]
    for name, got in (("E", [t.values["backbone.youngs_modulus"] for t in drawn]), ("mu", [t.effects[0]["mu"] for t in drawn])):
        mean, std = {"E": (76.1e9, 0.5e9), "mu": (0.21, 0.02)}[name]
        # 400 normal draws: the mean within 4 std/20, the standard deviation within 4/sqrt(800) = 14 %.
        assert np.mean(got) == pytest.approx(mean, abs=0.2 * std)
        assert np.std(got) == pytest.approx(std, rel=0.15)
    (diagnosed.parent / "report.json").write_text(TOGETHER)
    spread = read_spread(diagnosed, twin)
    drawn = [draw_twin(twin, spread, {}, rng) for _ in range(400)]
    pairs = np.array([[t.values["backbone.youngs_modulus"], t.effects[0]["mu"]] for t in drawn])
    assert pairs.std(axis=0) == pytest.approx([0.5e9, 0.02], rel=0.15)
    assert correlated_draws(diagnosed, rng) == pytest.approx(-0.9, abs=0.04)  # 4 (1 - 0.81) / 20
    write_twin(diagnosed, toml_table(diagnosed), {}, OWN)  # the file's own come first
    assert correlated_draws(diagnosed, rng) == pytest.approx(0.6, abs=0.13)  # 4 (1 - 0.36) / 20
    diagnosed.with_name("report.json").unlink()  # sent to somebody without its report
    assert correlated_draws(diagnosed, rng) == pytest.approx(0.6, abs=0.13)
    doubtful = [bool(draw_twin(twin, ParameterSpread(probability={"tendon_friction": 0.7}), {}, rng).effects) for _ in range(400)]
    assert np.mean(doubtful) == pytest.approx(0.7, abs=0.1)  # 4 sqrt(0.21 / 400)
    joined = draw_twin(twin, ParameterSpread(), {"tip_payload.mass": (0.001, 0.002)}, rng)
    assert 0.001 <= next(e for e in joined.effects if e.id == "tip_payload")["mass"] <= 0.002
    own = read_spread("continuum", Twin.of("continuum"))
    assert own.std["backbone.youngs_modulus"] == pytest.approx(4.66e9)


def test_a_machine_that_cannot_draw_says_so_each_time() -> None:
    """In a process of its own: asked a second time, OpenGL without a screen ended it."""
    code = """
import mujoco
from twin.env.episodes.rendering import FrameRenderer
from twin.foundation.errors import TwinError
for _ in range(2):
    try:
        FrameRenderer(mujoco.MjSpec(), 0.1)
    except TwinError as told:
        print(told)
"""
    bare = {k: v for k, v in os.environ.items() if k != "DISPLAY"} | {"MUJOCO_GL": "glfw"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env=bare)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("without a screen set MUJOCO_GL=egl") == 2


@pytest.mark.parametrize(
    ("name", "steps"), [("ContinuumReach-v0", 20), ("FingerShape-v0", 8), ("HandReorient-v0", 4), ("HandPick-v0", 12)]
)
def test_a_frame_shows_the_robot_moving(name: str, steps: int) -> None:
    env = gymnasium.make(f"twin/{name}", render_mode="rgb_array")
    env.reset(seed=0)
    try:
        before = env.render()
    except TwinError as lacking:
        pytest.skip(str(lacking))
    bend = np.where(np.arange(env.action_space.shape[0]) == 0, 1.0, -1.0).astype(np.float32)  # type: ignore[index]
    for _ in range(steps):
        env.step(bend)
    after = env.render()
    env.close()
    green = before[..., 1].astype(int) - before[..., [0, 2]].max(axis=2)
    assert (green > 20).sum() > 20 or name == "HandPick-v0"  # where it should go is marked; a task has no mark
    assert before.shape == (480, 640, 3)
    assert before.std() > 5.0  # grey levels: an empty picture of the sky has less
    changed = np.abs(after.astype(int) - before).max(axis=2) > 40
    assert 500 < changed.sum() < 0.2 * changed.size  # the robot moved, the background did not
    rows = np.nonzero(changed)[0]
    assert rows.mean() > 240.0  # all of them hang: what moves is in the lower half


def test_a_sinking_table_is_drawn_where_it_is() -> None:
    """The table sinks by 70 mm, seen from above; the next episode has its own things."""
    env = gymnasium.make("twin/HandPick-v0", render_mode="rgb_array")
    env.reset(seed=0)
    try:
        before = env.render()
    except TwinError as lacking:
        pytest.skip(str(lacking))
    while not env.step(np.zeros(12, np.float32))[2]:
        pass
    table = [np.nonzero((frame.max(axis=2) < 110) & (np.ptp(frame, axis=2) < 12))[0] for frame in (before, env.render())]
    assert table[1].mean() > table[0].mean() + 20.0  # pixels, of the mean of what stays in the picture
    env.reset(seed=1)
    assert np.nonzero(np.abs(env.render().astype(int) - before).max(axis=2) > 40)[0].size > 100
    env.close()
