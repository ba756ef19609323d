"""Stable-Baselines3's VecEnv on a batch: the numbers of single environments, ends of episodes, attributes and goals."""

from __future__ import annotations

import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

from twin.env.batch import ThreadedVectorEnv, make_batch
from twin.env.continuum import ContinuumReach
from twin.foundation.errors import DataError, TwinError

pytest.importorskip("stable_baselines3", reason="pip install '.[policy]' for its VecEnv")

from stable_baselines3 import PPO, SAC, HerReplayBuffer
from stable_baselines3.common.vec_env import VecMonitor

from twin.env.sb3 import BatchVecEnv

STATIC: dict[str, Any] = {"twin": "continuum", "dynamic": False, "tip_noise": 1e-4}


def batch(n: int, steps: int, kind: str = "ContinuumReach") -> ThreadedVectorEnv:
    module = "goals" if kind.endswith("Goal") else "continuum"
    return make_batch(n, f"twin.env.{module}:{kind}", steps, **STATIC)


def test_numbers_are_those_of_single_environments_over_ends_of_episodes() -> None:
    envs, alone = BatchVecEnv(batch(3, 4)), [ContinuumReach(**STATIC) for _ in range(3)]
    envs.seed(7)
    first = [env.reset(seed=7 + i)[0] for i, env in enumerate(alone)]
    np.testing.assert_array_equal(envs.reset(), first)
    for k, actions in enumerate(np.random.default_rng(0).uniform(-1.0, 1.0, (9, 3, 3)), 1):
        seen, rewards, ended, infos = envs.step(actions)
        for i, env in enumerate(alone):
            one, reward, _, _, _ = env.step(actions[i])
            assert (rewards[i], ended[i]) == (np.float32(reward), k % 4 == 0)
            assert infos[i]["TimeLimit.truncated"] == (k % 4 == 0)
            if k % 4 == 0:
                np.testing.assert_array_equal(infos[i]["terminal_observation"], one)
                one, _ = env.reset()
            np.testing.assert_array_equal(seen[i], one)  # type: ignore[index]
    envs.close()


def test_a_lost_motion_is_no_truncation(monkeypatch: pytest.MonkeyPatch) -> None:
    envs = BatchVecEnv(batch(1, 1))
    envs.reset()
    monkeypatch.setattr(envs.batch.envs[0], "step", lambda action: (np.zeros(12, np.float32), -10.0, True, False, {}))
    _, _, ended, (info,) = envs.step(np.zeros((1, 3)))
    assert ended[0]
    assert not info["TimeLimit.truncated"]


def test_attributes_methods_and_options_reach_the_environments() -> None:
    envs = BatchVecEnv(batch(2, 4))
    goal = [0.02, 0.0, 0.19]
    near = ContinuumReach(**STATIC)._nearest_tip(np.array(goal))
    envs.set_options({"goal": near})
    envs.reset()
    np.testing.assert_allclose(envs.get_attr("goal"), [near, near])
    envs.set_attr("told", 3, indices=1)
    assert envs.get_attr("told", indices=[1]) == [3]
    with pytest.raises(AttributeError):
        envs.get_attr("told", indices=0)
    assert len(envs.env_method("get_state")) == 2
    assert envs.env_is_wrapped(gymnasium.Wrapper) == [False, False]
    with pytest.raises(DataError, match="3 actions came for 2"):
        envs.step(np.zeros((3, 3)))


def test_policies_learn_from_it_with_goals_too() -> None:
    for model in (
        PPO("MlpPolicy", VecMonitor(BatchVecEnv(batch(2, 10))), n_steps=20, batch_size=20, n_epochs=1, device="cpu"),
        SAC(
            "MultiInputPolicy", BatchVecEnv(batch(2, 10, "ContinuumReachGoal")), replay_buffer_class=HerReplayBuffer,
            learning_starts=60, device="cpu",
        ),
    ):  # fmt: skip
        assert model.learn(80).num_timesteps >= 80


def test_what_it_cannot_take_is_refused_with_the_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    other = gymnasium.vector.SyncVectorEnv([lambda: ContinuumReach(**STATIC)])
    with pytest.raises(DataError, match=r"SyncVectorEnv came; give gymnasium\.make_vec"):
        BatchVecEnv(other)
    monkeypatch.delitem(sys.modules, "twin.env.sb3")
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    with pytest.raises(TwinError, match=r"needs stable_baselines3.*pip install"):
        import twin.env.sb3  # noqa: F401
