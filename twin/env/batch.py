"""Step many environments side by side in one process, by threads: MuJoCo's steps and the compiled loops run without the GIL.

Each environment has its own twin, random numbers and motion, so that its results depend on its seed alone, not on the number of
threads.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array
from joblib import cpu_count

from twin.foundation.errors import DataError

StepResult = tuple[Any, float, bool, bool, dict[str, Any]]


class ThreadedVectorEnv(VectorEnv):
    """`num_envs` environments of one kind, as `gymnasium.make_vec` makes them.

    Actions (num_envs, ...), observations (num_envs, ...), rewards, terminations and truncations (num_envs,), in the tables of the
    single environment. An environment whose episode has ended is reset at the next step, whatever its action (gymnasium's
    `AutoresetMode.NEXT_STEP`). A seed s gives environment i the seed s + i.
    """

    def __init__(self, make: Callable[[], gymnasium.Env], num_envs: int, max_episode_steps: int) -> None:
        """Raises DataError for fewer than one environment, and as `make` does."""
        if num_envs < 1:
            raise DataError(f"{num_envs} environments asked for; at least one is needed")
        self._threads = ThreadPoolExecutor(cpu_count(only_physical_cores=False), thread_name_prefix="twin-env")
        self.envs = list(self._threads.map(lambda _: make(), range(num_envs)))
        self.num_envs, self._max_steps = num_envs, max_episode_steps
        first = self.envs[0]
        self.single_action_space, self.single_observation_space = first.action_space, first.observation_space
        self.action_space = batch_space(first.action_space, num_envs)
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.metadata = {**first.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = first.render_mode
        self._steps_taken, self._ended = np.zeros(num_envs, int), np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset all environments. Raises DataError for seeds that are not one each."""
        seeds = (
            [None if seed is None else seed + i for i in range(self.num_envs)] if seed is None or isinstance(seed, int) else seed
        )
        if len(seeds) != self.num_envs:
            raise DataError(f"{len(seeds)} seeds came for {self.num_envs} environments; give one each, or one number")
        results = self.map(self.reset_one, range(self.num_envs), seeds, [options] * self.num_envs)
        self._ended[:] = False
        return self.gather_observations([seen for seen, _ in results]), self._gather_info([info for _, info in results])

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step all environments. Raises DataError for actions of another shape or that are not finite."""
        if len(actions) != self.num_envs:
            raise DataError(f"{len(actions)} actions came for {self.num_envs} environments; one each is needed")
        results = self.map(self._step_or_reset, range(self.num_envs), actions)
        observations, reward, terminated, truncated, infos = zip(*results, strict=True)
        self._ended = np.array(terminated) | np.array(truncated)
        seen = self.gather_observations(observations)
        return seen, np.array(reward, float), np.array(terminated), np.array(truncated), self._gather_info(infos)

    def render(self) -> tuple[Any, ...] | None:
        """Return the frames of all environments, or None without a render mode."""
        return None if self.render_mode is None else tuple(env.render() for env in self.envs)

    def close_extras(self, **kwargs: Any) -> None:
        """Close all environments and the threads."""
        for env in self.envs:
            env.close()
        self._threads.shutdown()

    def map(self, work: Callable[..., Any], *arguments: Iterable[Any]) -> list[Any]:
        """Return what `work` returns for each of some arguments, as the built-in `map`, in the threads."""
        return list(self._threads.map(work, *arguments))

    def reset_one(self, i: int, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset environment i."""
        self._steps_taken[i] = 0
        return self.envs[i].reset(seed=seed, options=options)

    def step_one(self, i: int, action: np.ndarray) -> StepResult:
        """Step environment i, truncated after the steps of an episode."""
        observation, reward, terminated, truncated, info = self.envs[i].step(action)
        self._steps_taken[i] += 1
        return observation, float(reward), terminated, truncated or bool(self._steps_taken[i] >= self._max_steps), info

    def _step_or_reset(self, i: int, action: np.ndarray) -> StepResult:
        """Step environment i, or reset it where its episode has ended."""
        if self._ended[i]:
            observation, info = self.reset_one(i)
            return observation, 0.0, False, False, info
        return self.step_one(i, action)

    def gather_observations(self, observations: Sequence[Any]) -> Any:
        """Gather the observations of all environments, an array or a Dict of them."""
        return concatenate(
            self.single_observation_space, observations, create_empty_array(self.single_observation_space, self.num_envs)
        )

    def _gather_info(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """Gather the infos of all environments."""
        gathered: dict[str, Any] = {}
        for i, info in enumerate(infos):
            gathered = self._add_info(gathered, info, i)
        return gathered


def make_batch(num_envs: int, entry_point: str, max_episode_steps: int, **options: Any) -> ThreadedVectorEnv:
    """Make `num_envs` environments of the class at `entry_point` ("module:class") under equal options."""
    kind = load_env_creator(entry_point)
    return ThreadedVectorEnv(lambda: kind(**options), num_envs, max_episode_steps)  # type: ignore[return-value, arg-type]
