"""The continuum tasks as dm_env, through `dm_control.rl.control`: the same plants, options, actions and rewards.

    from twin.env.dm import load
    environment = load("ContinuumReach", twin="report/", seed=1, tip_noise=2.5e-4)
    environment.reset()
    step = environment.step(environment.action_spec().generate_value())

Observations are the parts of the gymnasium environment's, by name. An episode is discounted by 0 where the motion is lost and by 1
where its time is up.
"""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
from dm_control.rl import control
from dm_env import specs

from twin.env import KINDS
from twin.env.continuum import ContinuumReach, ContinuumTrack
from twin.errors import UnknownNameError
from twin.twin import Twin

TASKS = {"ContinuumReach": ContinuumReach, "ContinuumTrack": ContinuumTrack}


def load(
    task: str = "ContinuumReach", twin: str | Path | Twin = "continuum", seed: int | None = None, **options: Any
) -> control.Environment:  # fmt: skip
    """A task on a twin, with the options of the gymnasium environment.

    Raises UnknownNameError for a task or an option that there is not.
    """
    if task not in TASKS:
        raise UnknownNameError("task", task, list(TASKS))
    physics = Physics(TASKS[task](twin, **options), seed)
    steps = KINDS[f"{task}-v0"][1]
    return control.Environment(physics, Task(), time_limit=(steps - 0.5) * physics.timestep())


class Physics(control.Physics):
    """A plant with its episode's twin and goal; a step of it is the environment's interval."""

    def __init__(self, env: ContinuumReach, seed: int | None) -> None:
        self.env, self._seed = env, seed
        self._control, self._taken, self.seen = np.zeros(env.action_space.shape or (0,)), 0, np.zeros(0, np.float32)
        self.reward, self.lost = 0.0, False

    def reset(self) -> None:
        """A new episode; the seed counts for the first."""
        self.seen, _ = self.env.reset(seed=self._seed)
        self._seed, self._taken, self.reward, self.lost = None, 0, 0.0, False

    def after_reset(self) -> None:
        """All is done in `reset`."""

    def step(self, n_sub_steps: int = 1) -> None:
        for _ in range(n_sub_steps):
            self.seen, self.reward, self.lost, _, _ = self.env.step(self._control)
            self._taken += 1

    def set_control(self, control: np.ndarray) -> None:
        self._control = control

    def time(self) -> float:
        return self._taken * self.timestep()

    def timestep(self) -> float:
        return self.env.interval


class Task(control.Task):
    """Reaching or tracking, as the physics' environment has it."""

    def initialize_episode(self, physics: Physics) -> None:
        """The physics has drawn the episode."""

    def before_step(self, action: np.ndarray, physics: Physics) -> None:
        physics.set_control(action)

    def action_spec(self, physics: Physics) -> specs.BoundedArray:
        return specs.BoundedArray(physics.env.action_space.shape, np.float32, -1.0, 1.0, "rate")

    def get_observation(self, physics: Physics) -> OrderedDict[str, np.ndarray]:
        sizes = physics.env.parts
        cuts = np.split(physics.seen, np.cumsum(list(sizes.values()))[:-1])
        return OrderedDict(zip(sizes, cuts, strict=True))

    def observation_spec(self, physics: Physics) -> OrderedDict[str, specs.Array]:
        return OrderedDict((name, specs.Array((size,), np.float32, name)) for name, size in physics.env.parts.items())

    def get_reward(self, physics: Physics) -> float:
        return physics.reward

    def get_termination(self, physics: Physics) -> float | None:
        return 0.0 if physics.lost else None
