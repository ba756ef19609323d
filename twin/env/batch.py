"""Many environments stepped side by side in one process, by threads: MuJoCo's steps and the laws between them run without the GIL.

Each environment has its own twin, its own random numbers and its own motion, so that what it does depends on its seed alone, not on
the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from joblib import cpu_count

from twin.errors import DataError

Stepped = tuple[np.ndarray, float, bool, bool, dict[str, Any]]


class Batch(VectorEnv):
    """`num_envs` environments of one kind, as `gymnasium.make_vec` makes them.

    Actions (num_envs, ...), observations (num_envs, ...), rewards, terminations and truncations (num_envs,), in the tables of the
    single environment. An environment whose episode has ended is reset at the next step, whatever its action (gymnasium's
    `AutoresetMode.NEXT_STEP`). A seed s gives environment i the seed s + i.
    """

    def __init__(self, make: Callable[[], gymnasium.Env], num_envs: int, max_episode_steps: int) -> None:
        """Raises DataError where no environment is asked for, and as `make` does."""
        if num_envs < 1:
            raise DataError(f"{num_envs} environments asked for; at least one is needed")
        self._threads = ThreadPoolExecutor(cpu_count(only_physical_cores=False), thread_name_prefix="twin-env")
        self.envs = list(self._threads.map(lambda _: make(), range(num_envs)))
        self.num_envs, self._most = num_envs, max_episode_steps
        first = self.envs[0]
        self.single_action_space, self.single_observation_space = first.action_space, first.observation_space
        self.action_space = batch_space(first.action_space, num_envs)
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.metadata = {**first.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}
        self.render_mode = first.render_mode
        self._taken, self._ended = np.zeros(num_envs, int), np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """All of them. Raises DataError for seeds that are not one each."""
        seeds = (
            [None if seed is None else seed + i for i in range(self.num_envs)] if seed is None or isinstance(seed, int) else seed
        )
        if len(seeds) != self.num_envs:
            raise DataError(f"{len(seeds)} seeds came for {self.num_envs} environments; give one each, or one number")
        made = list(self._threads.map(lambda one: one[0].reset(seed=one[1], options=options), zip(self.envs, seeds, strict=True)))
        self._taken[:], self._ended[:] = 0, False
        return np.stack([seen for seen, _ in made]), self._gathered([info for _, info in made])

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Raises DataError for actions of another shape or that are not finite, as the environment does."""
        if len(actions) != self.num_envs:
            raise DataError(f"{len(actions)} actions came for {self.num_envs} environments; one each is needed")
        done = list(self._threads.map(self._one, range(self.num_envs), actions))
        seen, reward, terminated, truncated, infos = zip(*done, strict=True)
        self._ended = np.array(terminated) | np.array(truncated)
        return np.stack(seen), np.array(reward, float), np.array(terminated), np.array(truncated), self._gathered(infos)

    def render(self) -> tuple[Any, ...] | None:
        return None if self.render_mode is None else tuple(env.render() for env in self.envs)

    def close_extras(self, **kwargs: Any) -> None:
        for env in self.envs:
            env.close()
        self._threads.shutdown()

    def _one(self, i: int, action: np.ndarray) -> Stepped:
        if self._ended[i]:
            self._taken[i] = 0
            seen, info = self.envs[i].reset()
            return seen, 0.0, False, False, info
        seen, reward, terminated, truncated, info = self.envs[i].step(action)
        self._taken[i] += 1
        return seen, float(reward), terminated, truncated or bool(self._taken[i] >= self._most), info

    def _gathered(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        gathered: dict[str, Any] = {}
        for i, info in enumerate(infos):
            gathered = self._add_info(gathered, info, i)
        return gathered


def batch(num_envs: int, entry_point: str, max_episode_steps: int, **options: Any) -> Batch:
    """`num_envs` environments of the class at `entry_point` ("module:class") under equal options."""
    kind = load_env_creator(entry_point)
    return Batch(lambda: kind(**options), num_envs, max_episode_steps)  # type: ignore[return-value, arg-type]
