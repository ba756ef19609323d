"""gymnasium environments on a twin with its effects, registered where this package is imported.

`gymnasium.make("twin.env:twin/ContinuumReach-v0")` imports it; gymnasium 1.x loads no plugins.

continuum.py             twin/ContinuumReach-v0, twin/ContinuumTrack-v0
finger.py                twin/FingerShape-v0
hand.py                  twin/HandReorient-v0
mjcf.py                  twin/MJCFTrack-v0
hand_task.py             the tasks of `twin.tasks`: twin/HandHold-v0, -Turn-, -Pick-, -Unscrew-, -Insert-, -Pour-
goals.py                 the same goal-conditioned: twin/ContinuumReachGoal-v0, twin/FingerShapeGoal-v0, twin/HandReorientGoal-v0
episodes/                what all of them share: options, drawn twins, observations, saved states, frames
batch.py                 many environments in threads, for `gymnasium.make_vec`
sb3.py                   such a batch as Stable-Baselines3's VecEnv
dm.py                    the continuum tasks as dm_env
plants/                  robots stepped in time under commands, with their effects
"""

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

from gymnasium.envs.registration import register


class Registered(NamedTuple):
    """The class ("module:name") of a registered environment, the steps of an episode, and options that its name stands for."""

    kind: str
    steps: int
    options: Mapping[str, Any] = MappingProxyType({})


HAND_TASKS = {"hold": 75, "turn": 75, "pick": 75, "unscrew": 93, "insert": 65, "pour": 60}  # steps an episode
ENVIRONMENTS = {
    "ContinuumReach-v0": Registered("twin.env.continuum:ContinuumReach", 100),
    "ContinuumTrack-v0": Registered("twin.env.continuum:ContinuumTrack", 200),
    "FingerShape-v0": Registered("twin.env.finger:FingerShape", 100),
    "HandReorient-v0": Registered("twin.env.hand:HandReorient", 60),
    "MJCFTrack-v0": Registered("twin.env.mjcf:MJCFTrack", 200),
    "ContinuumReachGoal-v0": Registered("twin.env.goals:ContinuumReachGoal", 100),
    "FingerShapeGoal-v0": Registered("twin.env.goals:FingerShapeGoal", 100),
    "HandReorientGoal-v0": Registered("twin.env.goals:HandReorientGoal", 60),
    **{
        f"Hand{task.capitalize()}-v0": Registered("twin.env.hand_task:HandTask", steps, {"task": task})
        for task, steps in HAND_TASKS.items()
    },
}


def register_envs() -> None:
    """Register the names, without importing MuJoCo."""
    for name, (kind, steps, options) in ENVIRONMENTS.items():
        register(f"twin/{name}", kind, max_episode_steps=steps, kwargs=dict(options), vector_entry_point=partial(_make_batch, kind))


def _make_batch(entry_point: str, **options: Any) -> Any:
    from twin.env.batch import make_batch

    return make_batch(entry_point=entry_point, **options)


register_envs()
