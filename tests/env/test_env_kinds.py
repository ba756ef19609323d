"""What holds for every registered environment, and what finger, hand, batch and dm_env interface do of their own."""

from __future__ import annotations

import inspect
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from twin.effects import effect_class
from twin.env import ENVIRONMENTS, HAND_TASKS
from twin.env.continuum import ContinuumReach
from twin.env.finger import FingerShape, tendon_displacements
from twin.env.hand import HandReorient
from twin.env.hand_task import HandTask
from twin.env.plants.soft_plant import FingerPlant
from twin.foundation.errors import DataError, SolveError, UnknownNameError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.twin import Twin
from twin.tasks import tasks

ALL = sorted(ENVIRONMENTS)
TASKS = [f"Hand{task.capitalize()}-v0" for task in HAND_TASKS]
FULL: dict[str, Any] = {"observe": "full"}
README = (Path(__file__).parents[2] / "twin" / "env" / "README.md").read_text("utf-8")


@cache
def made(name: str) -> Any:
    return gymnasium.make(f"twin/{name}", **FULL).unwrapped


def episode(env: Any, seed: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Observations and rewards under the same actions."""
    rows, rewards, rng = [spaces.flatten(env.observation_space, env.reset(seed=seed)[0])], [], np.random.default_rng(0)
    for _ in range(steps):
        seen, reward, *_ = env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
        rows.append(spaces.flatten(env.observation_space, seen))
        rewards.append(reward)
    return np.array(rows), np.array(rewards)


@pytest.mark.parametrize("name", ALL)
def test_a_seed_gives_the_same_episode_bit_for_bit(name: str) -> None:
    env = made(name)
    (first, paid), (again, repaid), (other, _) = (episode(env, seed, 5) for seed in (3, 3, 4))
    assert first.tobytes() == again.tobytes()
    assert paid.tobytes() == repaid.tobytes()
    assert not np.array_equal(first, other)
    assert np.isfinite(first).all()
    assert first.dtype == np.float32


@pytest.mark.parametrize("name", ALL)
def test_bad_actions_are_refused_or_clipped_once(name: str, recwarn: pytest.WarningsRecorder) -> None:
    env = gymnasium.make(f"twin/{name}").unwrapped
    env.reset(seed=0)
    n = env.action_space.shape[0]
    bad = np.zeros(n)
    bad[1] = np.nan
    with pytest.raises(DataError, match="action 1 is nan"):
        env.step(bad)
    with pytest.raises(DataError, match=rf"shape \({n + 1},\)"):
        env.step(np.zeros(n + 1))
    for _ in range(2):
        env.step(np.full(n, 7.0))
    assert sum("clipped" in str(w.message) for w in recwarn) == 1


@pytest.mark.parametrize("name", ALL)
def test_bad_options_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"interval.*observe.*did you mean 'randomise'"):
        gymnasium.make(f"twin/{name}", randomize=True)
    with pytest.raises(UnknownNameError, match="full, sensors"):
        gymnasium.make(f"twin/{name}", observe="all")
    with pytest.raises(DataError, match="above zero"):
        gymnasium.make(f"twin/{name}", interval=0.0)
    with pytest.raises(DataError, match="give a twin of"):
        gymnasium.make(f"twin/{name}", twin="two_link")
    newer = tmp_path / "twin.toml"
    newer.write_text('format = "twin/2"\nrobot = "continuum"\n')
    with pytest.raises(DataError, match="'twin/2'; this program reads 'twin/1'"):
        gymnasium.make(f"twin/{name}", twin=newer)


@pytest.mark.parametrize("name", [name for name in ALL if "Goal" not in name and "MJCF" not in name and name not in TASKS[1:]])
def test_its_tables_name_every_index_of_what_it_says(name: str) -> None:
    """The docstring says how long an observation is, with n = 3 tendons, k = 3 actions, p = 2 servos a finger, s = 4 cords, t = 4
    tendons a finger, m = 11 markers and f = 3 fingers as large as it is. All tables but the tasks' are in twin/env/README.md;
    what MJCFTrack observes depends on its model."""
    env, full = gymnasium.make(f"twin/{name}").unwrapped, made(name)
    text = inspect.getdoc(ContinuumReach if name == "ContinuumTrack-v0" else type(env)) or ""
    said, size, actions = {
        "FingerShape-v0": ("(s + 2p + 3m,)", 4 + 2 * 2 + 3 * 11, 2),
        "HandReorient-v0": ("(f s + f p + 4,)", 3 * 4 + 3 * 2 + 4, 6),
        "HandHold-v0": ("(f s + f t + 1,)", 3 * 4 + 3 * 4 + 1, 12),
    }.get(name, ("(2n + k + 6,)", 2 * 3 + 3 + 6, 3))
    assert f"Observation, Box, {said}" in text
    assert env.observation_space.shape == (size,) == env.reset(seed=0)[0].shape
    assert env.action_space.shape == (actions,)
    assert full.observation_space.shape == full.reset(seed=0)[0].shape
    assert full.observation_space.shape > env.observation_space.shape
    rows = [line for line in text.splitlines() if re.match(r"\| [0-9a-z]", line)]
    assert len(rows) >= 4
    assert name in TASKS or [row for row in rows if row not in README] == []


def test_the_finger_moves_as_the_twin_predicts() -> None:
    """Friction, creep and a drifting sensor in force: the plant, step by step, against the prediction of the same commands."""
    n = 4
    laws = (
        ("tendon_friction", {"mu": 0.1}),
        ("backbone_creep", {"amplitude": 0.1, "time": 5.0}),
        ("sensor_drift", {"rate_2": 1e-3}),
    )
    twin = replace(Twin.of("finger"), effects=tuple(effect_class(name)(values, n) for name, values in laws))
    plant, t = FingerPlant(twin, 0.04), np.arange(26) * 0.04
    command = tendon_displacements(np.column_stack([0.008 * np.sin(t) ** 2, -0.003 * t]))
    felt = [plant.readings(), *(plant.step(c) for c in command[1:])]
    driven = [Channel(f"tendon_{i}_displacement", "input", "m") for i in range(1, n + 1)]
    shown = [Channel(f"tip_{a}", "output", "m") for a in "xyz"] + [
        Channel(f"sensor_{i}_resistance", "output", "ohm") for i in range(1, 5)
    ]
    values = {c.name: command[:, k] if k < n else np.zeros(26) for k, c in enumerate([*driven, *shown])}
    whole = Recording("finger", "", "", None, (*driven, *shown), (Trial("a", t, values),))
    told = twin.predict(whole, dynamic=True).trials[0].values
    # The same steps of the same motion: to rounding.
    np.testing.assert_allclose(np.array([f.markers[-1] for f in felt]).T, [told[f"tip_{a}"] for a in "xyz"], rtol=0, atol=1e-9)
    resistance = np.array([f.resistance for f in felt]).T * plant.body.cords.rest[:, None]
    np.testing.assert_allclose(resistance, [told[f"sensor_{i}_resistance"] for i in range(1, 5)], rtol=1e-9)
    assert np.ptp(told["tip_x"]) > 5e-3


def test_what_no_effect_looks_back_at_is_forgotten() -> None:
    """A sensor that drifts by nothing has its past kept, and says the same."""
    idle = replace(Twin.of("finger"), effects=(effect_class("sensor_drift")({}, 4),))
    plants, told = [FingerPlant(twin, 0.04) for twin in (Twin.of("finger"), idle)], np.array([3e-3, 0.0, -3e-3, 0.0])
    for _ in range(6):
        one, other = (plant.step(told) for plant in plants)
        np.testing.assert_array_equal(one.resistance, other.resistance)
        np.testing.assert_array_equal(one.displacement, other.displacement)
    assert [len(plant._effect_io.time) for plant in plants] == [2, 7]
    assert [len(plant._effect_io._truths) for plant in plants] == [2, 7]


def test_a_wanted_shape_is_reached_by_its_own_servos() -> None:
    env = FingerShape("finger")
    env.reset(seed=1)
    servos = np.array([0.006, -0.004])
    env.wanted = env._rest_markers(servos)
    for _ in range(40):
        *_, info = env.step(np.clip((servos - env.servos) / (env.options.rate * env.plant.interval), -1.0, 1.0))
    assert info["is_success"]
    # m: statics has the finger's own Poisson ratio 0.49, motion 0.47 at most, and both end at rest without friction
    assert info["distance"] < 2e-4


def test_fingers_turn_the_block() -> None:
    """All three close, then go across alike: the block turns one way, and the other way if they go the other."""
    angles = []
    for across in (1.0, -1.0):
        env = made("HandReorient-v0")
        env.reset(seed=0)
        for k in range(12):
            action = np.zeros((3, 2))
            action[:, 0], action[:, 1] = k < 5, across * (k >= 5)
            *_, info = env.step(action.ravel())
        angles.append(info["angle"])
    assert angles[0] < -0.05
    assert angles[1] > 0.05


def test_a_lost_motion_ends_the_episode_with_its_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FingerShape-v0", "HandReorient-v0"):
        env = made(name)
        env.reset(seed=0)

        def lost(*_: Any) -> None:
            raise SolveError("finger 1 is lost at t = 0.1 s")

        with monkeypatch.context() as patched:
            patched.setattr(env.plant, "step", lost)
            seen, reward, terminated, truncated, info = env.step(np.zeros(env.n))
        assert (reward, terminated, truncated) == (-10.0, False, True)
        assert info["lost"].startswith("finger 1 is lost")
        assert np.isfinite(seen).all()
        assert np.isfinite(env.reset(seed=0)[0]).all()


def test_the_hands_tasks_are_environments_by_their_names() -> None:
    assert {name: round(task.duration / 0.04 + 0.25) for name, task in tasks().items()} == HAND_TASKS
    for name, registered in zip(TASKS, HAND_TASKS, strict=True):
        assert made(name).task.name() == registered
    with pytest.raises(UnknownNameError, match=r"task.*juggle.*hold"):
        HandTask(task="juggle")
    with pytest.raises(DataError, match="none to choose"):
        made(TASKS[0]).reset(options={"goal": 0.1})


@pytest.mark.parametrize(
    ("task", "outcome"), [("insert", "success"), ("pick", "success"), ("pour", "success"), ("turn", "not reached")]
)
def test_a_policy_is_scored_as_the_task_judges(task: str, outcome: str) -> None:
    """Closing the fingers, by hand: two tendons in, their antagonists out, for 0.8 s, then held. It pushes, pours and grips, and
    turns nothing. Only the end pays."""
    env = gymnasium.make(f"twin/Hand{task.capitalize()}-v0")
    env.reset(seed=1)
    close, paid, ended, info = np.tile([1.0, 0.0, -1.0, 0.0], 3).astype(np.float32), [], False, {}
    while not ended:
        _, reward, ended, _, info = env.step(close if len(paid) < 20 else 0.0 * close)
        paid.append(reward)
        assert ended or (info["outcome"], info["is_success"]) == ("", False)
    assert len(paid) == HAND_TASKS[task]
    assert info["outcome"] == outcome
    assert info["is_success"] == (outcome == "success")
    assert paid == [0.0] * (len(paid) - 1) + [float(outcome == "success")]


def test_a_lost_task_ends_with_its_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    env = made("HandPick-v0")
    env.reset(seed=0)

    def lost(*_: Any) -> None:
        raise SolveError("thing 'object' is lost at t = 0.1 s")

    with monkeypatch.context() as patched:
        patched.setattr(env.plant.trial.scene, "step_tendons", lost)
        seen, reward, terminated, truncated, info = env.step(np.zeros(env.n))
    assert (reward, terminated, truncated) == (0.0, True, False)
    assert (info["lost"], info["outcome"]) == ("thing 'object' is lost at t = 0.1 s", "simulation ended")
    assert np.isfinite(seen).all()


def test_laws_that_do_not_act_in_the_hand_are_refused() -> None:
    hand = Twin.of("hand")
    for kind in HandReorient, HandTask:
        with pytest.raises(DataError, match="sensor_drift"):
            kind(replace(hand, effects=(effect_class("sensor_drift")({}, hand.robot.n_tendon),)))


def test_a_batch_is_its_environments_side_by_side() -> None:
    """Bit for bit, through ends of episodes: each is reset at the step after its last."""
    envs = gymnasium.make_vec("twin/ContinuumReach-v0", 3, max_episode_steps=4, tip_noise=1e-4)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    singles = [ContinuumReach(tip_noise=1e-4) for _ in range(3)]
    seen, _ = envs.reset(seed=7)
    alone = np.stack([env.reset(seed=7 + i)[0] for i, env in enumerate(singles)])
    assert seen.tobytes() == alone.tobytes()
    rng = np.random.default_rng(0)
    for k in range(7):
        actions = rng.uniform(-1, 1, (3, 3)).astype(np.float32)
        seen, reward, terminated, truncated, info = envs.step(actions)
        rows = [env.reset()[0] if k == 4 else env.step(a)[0] for env, a in zip(singles, actions, strict=True)]
        assert seen.tobytes() == np.stack(rows).tobytes()
        assert truncated.tolist() == [k == 3] * 3
        assert not terminated.any()
        assert (reward == 0.0).all() == (k == 4)
        assert info["distance"].shape == (3,)
    assert envs.observation_space.contains(seen)
    with pytest.raises(DataError, match="2 actions came for 3"):
        envs.step(np.zeros((2, 3)))
    with pytest.raises(DataError, match="action 2 is nan"):
        envs.step(np.full((3, 3), [0.0, 0.0, np.nan]))
    envs.close()


@pytest.mark.parametrize("task", ["ContinuumReach", "ContinuumTrack"])
def test_the_dm_env_interface_is_the_same_task(task: str) -> None:
    pytest.importorskip("dm_control", reason="dm-control is not installed: the extra `env` has it")
    from twin.env.dm import load

    environment, env = load(task, seed=5), gymnasium.make(f"twin/{task}-v0").unwrapped
    spec, step, seen = environment.observation_spec(), environment.reset(), env.reset(seed=5)[0]
    assert np.concatenate(list(step.observation.values())).tobytes() == seen.tobytes()
    actions = np.random.default_rng(0).uniform(-1, 1, (ENVIRONMENTS[f"{task}-v0"].steps, 3))
    for k, action in enumerate(actions):
        environment.action_spec().validate(action.astype(np.float32))
        step, (seen, reward, *_) = environment.step(action), env.step(action)
        assert step.reward == reward
        assert step.last() == (k == len(actions) - 1)
    for name, value in step.observation.items():
        spec[name].validate(value)
    assert np.concatenate(list(step.observation.values())).tobytes() == seen.tobytes()
    assert step.discount == 1.0
    with pytest.raises(UnknownNameError, match="ContinuumTrack"):
        load("ContinuumRech")
