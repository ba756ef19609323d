"""Inverse kinematics on a twin in a policy's place: the same observations, the same actions, nothing learned.

The twin is pulled as the robot is, so that its friction is known; tensions for the goal are found from where it stands. With a
camera the goal is shifted by what the twin's tip is off the seen one, smoothed:

    b <- b + (x_twin - x_seen - b) / 2,    tensions = inverse(goal + b)
"""

from __future__ import annotations

import numpy as np

from twin.env.continuum import ContinuumReach
from twin.prediction.kinematics import LoadedRobot, inverse


class InverseKinematics:
    """A controller on the twin whose scales `env` has. It reads observations alone."""

    def __init__(self, env: ContinuumReach) -> None:
        self._env, self._robot = env, LoadedRobot(env.described)
        ends = np.cumsum(list(env.parts.values()))
        self._part = {name: slice(end - size, end) for (name, size), end in zip(env.parts.items(), ends, strict=True)}
        self.begin()

    def begin(self) -> None:
        """A new episode."""
        self._robot.rest()
        self._shift = np.zeros(3)

    def act(self, observation: np.ndarray) -> np.ndarray:
        """(n_tendon,) in [-1, 1], from one observation (parts of the environment)."""
        env, robot, o = self._env, self._robot, self._env.options
        seen = {name: observation[part].astype(float) for name, part in self._part.items()}
        goal, command = seen["goal"] * env.length, seen["commands"] * env.pull.tension
        if "tip" in seen:
            self._shift += 0.5 * (robot.shape().tip - seen["tip"] * env.length - self._shift)
        wanted = inverse(robot, goal + self._shift, limit=o.most * env.pull.tension).tension
        most = env.pull.tension * o.rate * env.interval
        step = np.clip((wanted - command) / most, -1.0, 1.0)
        robot.pull(command + step * most)
        return step
