"""Many environments as Stable-Baselines3 (extra `policy`) trains on them: its VecEnv on a batch in threads.

from twin.env.sb3 import BatchVecEnv
envs = BatchVecEnv(gymnasium.make_vec("twin.env:twin/ContinuumReach-v0", 8, twin="report/"))
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv

from twin.env.batch import ThreadedVectorEnv
from twin.foundation.errors import DataError, TwinError

try:
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn
except ModuleNotFoundError as fault:
    raise TwinError(
        f"twin.env.sb3 needs {fault.name}: pip install '.[policy]', or step gymnasium.make_vec's batch itself"
    ) from None


class BatchVecEnv(VecEnv):
    """Stable-Baselines3's VecEnv on a batch of `gymnasium.make_vec`, with the same numbers.

    An environment whose episode ends is reset in the same step, as Stable-Baselines3 expects: its observation is the next episode's
    first, that of the end is in `info["terminal_observation"]`, and `info["TimeLimit.truncated"]` says that only its time was up.
    """

    def __init__(self, batch: VectorEnv) -> None:
        """Raises DataError for another vectorised environment than `ThreadedVectorEnv`."""
        if not isinstance(batch, ThreadedVectorEnv):
            raise DataError(f'a {type(batch).__name__} came; give gymnasium.make_vec("twin.env:twin/...", n) without wrappers')
        self.batch, self._actions = batch, np.zeros((0,))
        super().__init__(batch.num_envs, batch.single_observation_space, batch.single_action_space)

    def reset(self) -> VecEnvObs:
        """Start an episode in each environment, with the seeds and options that `seed` and `set_options` gave."""
        results = self.batch.map(self.batch.reset_one, range(self.num_envs), self._seeds, [o or None for o in self._options])
        self.reset_infos = [info for _, info in results]
        self._reset_seeds()
        self._reset_options()
        return self.batch.gather_observations([seen for seen, _ in results])

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions (num_envs, ...) of the next `step_wait`. Raises DataError for another number of them."""
        if len(actions) != self.num_envs:
            raise DataError(f"{len(actions)} actions came for {self.num_envs} environments; one each is needed")
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step all environments. Raises DataError for actions of another shape or that are not finite."""
        results = self.batch.map(self._step_one, range(self.num_envs), self._actions)
        observations, rewards, ended, infos = (list(part) for part in zip(*results, strict=True))
        return self.batch.gather_observations(observations), np.array(rewards, np.float32), np.array(ended), infos

    def close(self) -> None:
        """Close all environments and the threads."""
        self.batch.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return the frames of all environments."""
        return self.batch.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each environment."""
        return [env.get_wrapper_attr(attr_name) for env in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of each environment."""
        for env in self._chosen(indices):
            setattr(env, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any) -> list[Any]:
        """Return what a method of each environment returns."""
        return [env.get_wrapper_attr(method_name)(*method_args, **method_kwargs) for env in self._chosen(indices)]

    def env_is_wrapped(self, wrapper_class: type[gymnasium.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """Return False for each environment: a batch has no wrappers."""
        return [False for _ in self._chosen(indices)]

    def _chosen(self, indices: VecEnvIndices) -> list[gymnasium.Env]:
        return [self.batch.envs[i] for i in self._get_indices(indices)]

    def _step_one(self, i: int, action: np.ndarray) -> tuple[Any, float, bool, dict[str, Any]]:
        """Step environment i and, where its episode ends, begin the next."""
        observation, reward, terminated, truncated, info = self.batch.step_one(i, action)
        ended, info = terminated or truncated, {**info, "TimeLimit.truncated": truncated and not terminated}
        if ended:
            info["terminal_observation"] = observation
            observation, self.reset_infos[i] = self.batch.reset_one(i)
        return observation, reward, ended, info
