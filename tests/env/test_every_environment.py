"""What holds for all registered environments alike, and for their goals."""

from __future__ import annotations

import copy
import pickle
import warnings
from functools import cache
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env

from twin.env import ENVIRONMENTS
from twin.env.continuum import ContinuumReach, ContinuumTrack
from twin.env.finger import FingerShape
from twin.env.hand import HandReorient
from twin.foundation.errors import DataError

ALL = sorted(ENVIRONMENTS)
GOALS = [name for name in ALL if "Goal" in name]
DRIVEN: list[tuple[str, dict[str, Any]]] = [
    ("ContinuumReach-v0", {"drive": "displacement"}),
    ("ContinuumTrack-v0", {"drive": "current"}),
    ("ContinuumReachGoal-v0", {"drive": "displacement", "observe": "full"}),
]
KINDS = [*((name, dict[str, Any]()) for name in ALL), *DRIVEN]


EXACT = {"commands", "servos", "angle", "wanted", "turn", "elapsed"}  # bounded by what they are; the others by instruments


@cache
def made(name: str) -> Any:
    return gymnasium.make(f"twin/{name}", observe="full").unwrapped


def stepped(env: Any, seed: int, steps: int) -> list[Any]:
    """Observations and rewards under drawn actions at the ends of their range, as numbers."""
    rng, rows = np.random.default_rng(seed), []
    for _ in range(steps):
        seen, reward, *_ = env.step(np.sign(rng.uniform(-1, 1, env.action_space.shape)).astype(np.float32))
        rows.append([spaces.flatten(env.observation_space, seen).tolist(), reward])
    return rows


def check_with_stable_baselines(env: gymnasium.Env[Any, Any]) -> None:
    """Nothing where it is not installed; it says each time that `compute_reward` makes a goal-conditioned environment."""
    try:
        from stable_baselines3.common.env_checker import check_env as check
    except ModuleNotFoundError:
        return
    check(env, skip_render_check=True)


@pytest.mark.parametrize(("name", "options"), KINDS)
def test_it_is_as_the_field_knows_environments(name: str, options: dict[str, Any]) -> None:
    """Both checkers find nothing, info has `is_success`, bounds are finite and hold, copies and saved states go on alike."""
    env = gymnasium.make(f"twin/{name}", **options).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*is not within the observation space")  # never, but for its own formatting
        check_env(env, skip_render_check=True)
        check_with_stable_baselines(env)
    for space in spaces.flatten_space(env.observation_space), env.action_space:
        assert isinstance(space, spaces.Box)
        assert np.isfinite([space.low, space.high]).all()
    env.reset(seed=5)
    stepped(env, 1, 2)
    state = env.get_state()  # type: ignore[attr-defined]
    others = [copy.deepcopy(env), pickle.loads(pickle.dumps(env)), gymnasium.make(f"twin/{name}", **options).unwrapped]
    others[2].reset(seed=6)
    others[2].set_state(state)  # type: ignore[attr-defined]
    told = stepped(env, 2, 3)
    for other in others:
        assert stepped(other, 2, 3) == told
    seen, *_, info = env.step(np.zeros(env.action_space.shape or ()))
    assert isinstance(info["is_success"], bool)
    assert env.observation_space.contains(seen)
    env.close()


@pytest.mark.parametrize("name", ALL)
def test_readings_stay_clear_of_their_bounds(name: str) -> None:
    """Under actions at their ends: bounds that readings meet hide what they read. Commands and unit vectors may meet theirs."""
    env = made(name)
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.ones(env.action_space.shape))
        parts = env._observation_parts()
        for part, bound in env.layout.parts.items():
            reached = np.abs(parts[part]).max() / max(-bound.low, bound.high)
            assert reached <= (1.0 + 1e-6 if part in EXACT else 0.6), part


def test_bounds_cut_what_exceeds_them() -> None:
    """A load cell whose noise is a hundred times its range reads the range's ends."""
    env = ContinuumReach(tension_noise=1e3)
    seen, _ = env.reset(seed=0)
    assert np.abs(seen[:3]).tolist() == [4.0 * env.options.most] * 3
    assert env.observation_space.contains(seen)


@pytest.mark.parametrize("name", GOALS)
def test_goals_are_rewarded_as_steps_are(name: str) -> None:
    """A row at a time and all at once; the plain environment is paid the same, and sees the same beside the goal."""
    env, plain = made(name), made(name.replace("Goal", ""))
    seen, _ = env.reset(seed=4)
    start, _ = plain.reset(seed=4)
    assert len(start) == len(seen["observation"]) + env.layout.parts[env.goal_part].size
    rows, bend = [], np.where(np.arange(env.action_space.shape[0]) == 0, 1.0, -1.0)
    for _ in range(4):
        seen, reward, *_, info = env.step(bend)
        _, paid, *_ = plain.step(bend)
        assert reward == env.compute_reward(seen["achieved_goal"], seen["desired_goal"], info)
        assert reward == pytest.approx(paid, rel=1e-5)  # goals are single precision
        rows.append((seen["achieved_goal"], seen["desired_goal"], reward))
    achieved, desired, rewards = (np.array(column) for column in zip(*rows, strict=True))
    np.testing.assert_array_equal(env.compute_reward(achieved, desired, [{}] * 4), rewards)
    np.testing.assert_array_equal(env.compute_reward(achieved, achieved, [{}] * 4), np.zeros(4))
    assert np.ptp(rewards) > 0.0


def test_goals_of_a_batch_are_gathered() -> None:
    envs = gymnasium.make_vec("twin/ContinuumReachGoal-v0", 2, dynamic=False)
    seen, _ = envs.reset(seed=1)
    alone = [gymnasium.make("twin/ContinuumReachGoal-v0", dynamic=False).reset(seed=1 + i)[0] for i in range(2)]
    for part, rows in seen.items():
        np.testing.assert_array_equal(rows, [one[part] for one in alone])
    seen, *_ = envs.step(np.ones((2, 3)))
    assert envs.observation_space.contains(seen)
    envs.close()


def test_hindsight_replay_learns_from_goals() -> None:
    """A smoke test: 60 steps and updates, with goals relabelled by the environment's own reward."""
    baselines = pytest.importorskip("stable_baselines3", reason="pip install '.[policy]' for hindsight replay")
    env = gymnasium.make("twin/ContinuumReachGoal-v0", interval=0.2, dynamic=False, max_episode_steps=10)
    model = baselines.SAC(
        "MultiInputPolicy", env, replay_buffer_class=baselines.HerReplayBuffer, learning_starts=30, batch_size=16, seed=0,
        device="cpu", buffer_size=200, policy_kwargs={"net_arch": [16]},
    )  # fmt: skip
    before = model.get_parameters()["policy"]["actor.mu.weight"].clone()
    model.learn(60)
    sample = model.replay_buffer.sample(64)
    goals = sample.observations["desired_goal"]
    achieved = sample.next_observations["achieved_goal"].numpy()
    assert len(np.unique(goals.numpy().round(5), axis=0)) > 6  # more than the six episodes drew: relabelled
    np.testing.assert_allclose(
        sample.rewards.numpy()[:, 0], env.unwrapped.compute_reward(achieved, goals.numpy(), [{}] * 64), rtol=1e-5
    )
    assert not before.equal(model.get_parameters()["policy"]["actor.mu.weight"])


def test_own_goals_are_taken() -> None:
    reach, track, finger, hand = ContinuumReach(), ContinuumTrack(), FingerShape(), HandReorient()
    place = reach.reset(seed=1)[1]["goal"]
    assert reach.reset(seed=2, options={"goal": place.tolist()})[1]["goal"] == pytest.approx(place, abs=0.0)
    path = track._rest_tips(np.array([0.5, 0.6]), np.array([0.0, 0.1]))
    assert track.reset(seed=2, options={"goal": path})[1]["goal"] == pytest.approx(path[0], abs=0.0)
    assert track.step(np.zeros(3))[-1]["goal"] == pytest.approx(path[1], abs=0.0)
    finger.reset(seed=1)
    wanted = finger.wanted
    assert finger.reset(seed=2, options={"goal": wanted})[0][8:] == pytest.approx(wanted.ravel() / finger.length, rel=1e-6)
    assert hand.reset(seed=2, options={"goal": -0.3})[1]["wanted"] == -0.3
    assert hand.reset(seed=2)[1]["wanted"] != -0.3


@pytest.mark.parametrize(
    ("env", "goal", "words"),
    [
        (ContinuumReach, (0.0, 0.0, 0.2), r"out of reach: the nearest place .* 80.0 mm away and 3 mm .*`most`"),
        (ContinuumReach, (0.0, 0.1), r"shape \(2,\) came; a place \(x, y, z\) of the tip, m is needed"),
        (ContinuumReach, "up", "'up' came"),
        (ContinuumReach, (0.0, 0.0, np.nan), "not finite"),
        (ContinuumTrack, (0.0, 0.0, 0.12), r"shape \(3,\) came; a path"),
        (FingerShape, np.zeros((3, 3)), r"places \(11, 3\) of the markers"),
        (FingerShape, np.zeros((11, 3)), r"out of reach: the nearest shape.*mm away in the mean and 2 mm"),
        (HandReorient, 0.5, "at most 0.4 either way"),
    ],
)
def test_own_goals_out_of_reach_or_shape_are_refused(env: Any, goal: Any, words: str) -> None:
    with pytest.raises(DataError, match=words):
        env().reset(seed=0, options={"goal": goal})
    with pytest.raises(DataError, match="'aim' came; reset takes 'goal' only"):
        env().reset(seed=0, options={"aim": goal})
