"""Goal-conditioned environments, in the style of `GoalEnv` (gymnasium-robotics), for learning from goals reached by chance.

An observation is a Dict: `observation` is that of the plain environment without its goal, `achieved_goal` and `desired_goal` are
equally long. `compute_reward` gives the reward of any goals for any places, so that hindsight replay (Stable-Baselines3's
`HerReplayBuffer`) can ask it what a step would have earned. Options, actions, rewards and info are the plain environment's.
"""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces

from twin.env.continuum import ContinuumReach
from twin.env.episodes.base import TwinEnv
from twin.env.episodes.observation import PLACE_RANGE
from twin.env.finger import FingerShape
from twin.env.hand import HandReorient
from twin.prediction.twin import Twin


class GoalConditioned(TwinEnv):
    """Base of the goal-conditioned environments, mixed in before a plain one.

    Goals achieved are true places, however the options let sensors read: on a real robot something must measure them.
    """

    goal_part: ClassVar[str]  # the part of the plain observation that tells the goal

    def __init__(self, twin: str | Path | Twin | None = None, render_mode: str | None = None, **options: Any) -> None:
        """Raises as the plain environment does."""
        given = {} if twin is None else {"twin": twin}
        super().__init__(render_mode=render_mode, **given, **options)
        self._sensed = [name for name in self.layout.parts if name != self.goal_part]
        goal = spaces.Box(-PLACE_RANGE, PLACE_RANGE, self._achieved().shape, np.float32)
        parts = {"observation": self.layout.box(self._sensed), "achieved_goal": goal, "desired_goal": goal}
        self.observation_space = spaces.Dict(parts)

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Step as the plain environment. The reward is that of the goals in single precision, as `compute_reward` gives it."""
        seen, paid, terminated, truncated, info = super().step(action)
        lost = "lost" in info
        reward = float(paid if lost else self.compute_reward(seen["achieved_goal"], seen["desired_goal"], info))
        return seen, reward, terminated, truncated, info

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any) -> np.ndarray:
        """Return the reward (...) of goals achieved (..., d) where those (..., d) were desired; `info` is not looked at."""
        return self._goal_reward(np.asarray(achieved_goal, float), np.asarray(desired_goal, float))

    def _observation(self) -> dict[str, np.ndarray]:
        goals = {"achieved_goal": self._achieved(), "desired_goal": self._desired()}
        clipped = {name: np.clip(goal, -PLACE_RANGE, PLACE_RANGE).astype(np.float32) for name, goal in goals.items()}
        return {"observation": self.layout.join(self._observation_parts(), self._sensed), **clipped}


class ContinuumReachGoal(GoalConditioned, ContinuumReach):
    """Bring the tip of a backbone to a goal, as `ContinuumReach`; goals are places (3,) of the tip, L."""

    goal_part = "goal"


class FingerShapeGoal(GoalConditioned, FingerShape):
    """Bring a finger's markers to a wanted shape, as `FingerShape`; goals are their places (3m,), L, the tip last."""

    goal_part = "wanted"


class HandReorientGoal(GoalConditioned, HandReorient):
    """Turn a block, as `HandReorient`; goals are sine and cosine of its angle and its place from its start, (5,) 1 and 0.05 m."""

    goal_part = "wanted"
