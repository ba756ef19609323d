"""The continuum tasks as dm_env, through `dm_control.rl.control`: the same plants, options, actions and rewards.

    from twin.env.dm import load
    environment = load("ContinuumReach", twin="report/", seed=1, tip_noise=2.5e-4)
    environment.reset()
    step = environment.step(environment.action_spec().generate_value())

Observations are the parts of the gymnasium environment's, by name. An episode is discounted by 0 where the motion is lost and by 1
where its time is up.
"""

from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
from dm_control.rl import control
from dm_env import specs

from twin.env import ENVIRONMENTS
from twin.env.continuum import ContinuumReach, ContinuumTrack
from twin.foundation.errors import UnknownNameError
from twin.prediction.twin import Twin

DM_TASKS = {"ContinuumReach": ContinuumReach, "ContinuumTrack": ContinuumTrack}


def load(
    task: str = "ContinuumReach", twin: str | Path | Twin = "continuum", seed: int | None = None, **options: Any
) -> control.Environment:  # fmt: skip
    """Load a task on a twin, with the options of the gymnasium environment.

    Raises UnknownNameError for an unknown task or option.
    """
    if task not in DM_TASKS:
        raise UnknownNameError("task", task, list(DM_TASKS))
    physics = Physics(DM_TASKS[task](twin, **options), seed)
    steps = ENVIRONMENTS[f"{task}-v0"].steps
    return control.Environment(physics, Task(), time_limit=(steps - 0.5) * physics.timestep())


class Physics(control.Physics):
    """A plant with its episode's twin and goal; a step of it is the environment's interval."""

    def __init__(self, env: ContinuumReach, seed: int | None) -> None:
        self.env, self._seed = env, seed
        self._control, self._taken, self.seen = np.zeros(env.action_space.shape or (0,)), 0, np.zeros(0, np.float32)
        self.reward, self.lost = 0.0, False

    def reset(self) -> None:
        """Start a new episode; the seed applies to the first."""
        self.seen, _ = self.env.reset(seed=self._seed)
        self._seed, self._taken, self.reward, self.lost = None, 0, 0.0, False

    def after_reset(self) -> None:
        """Do nothing: `reset` does it all."""

    def step(self, n_sub_steps: int = 1) -> None:
        """Step the environment under the last control."""
        for _ in range(n_sub_steps):
            self.seen, self.reward, self.lost, _, _ = self.env.step(self._control)
            self._taken += 1

    def set_control(self, control: np.ndarray) -> None:
        """Set the action of the next steps."""
        self._control = control

    def time(self) -> float:
        """Return the time (s) since the reset."""
        return self._taken * self.timestep()

    def timestep(self) -> float:
        """Return the environment's interval, s."""
        return self.env.interval


class Task(control.Task):
    """Reaching or tracking, as the physics' environment has it."""

    def initialize_episode(self, physics: Physics) -> None:
        """Do nothing: the physics has drawn the episode."""

    def before_step(self, action: np.ndarray, physics: Physics) -> None:
        """Pass the action to the physics."""
        physics.set_control(action)

    def action_spec(self, physics: Physics) -> specs.BoundedArray:
        """Return the bounds of the action."""
        return specs.BoundedArray(physics.env.action_space.shape, np.float32, -1.0, 1.0, "rate")

    def get_observation(self, physics: Physics) -> OrderedDict[str, np.ndarray]:
        """Return the parts of the observation by name."""
        sizes = physics.env.parts
        cuts = np.split(physics.seen, np.cumsum(list(sizes.values()))[:-1])
        return OrderedDict(zip(sizes, cuts, strict=True))

    def observation_spec(self, physics: Physics) -> OrderedDict[str, specs.Array]:
        """Return the sizes of the observation's parts."""
        return OrderedDict((name, specs.Array((size,), np.float32, name)) for name, size in physics.env.parts.items())

    def get_reward(self, physics: Physics) -> float:
        """Return the reward of the last step."""
        return physics.reward

    def get_termination(self, physics: Physics) -> float | None:
        """Return a discount of 0 where the motion is lost, else None."""
        return 0.0 if physics.lost else None
