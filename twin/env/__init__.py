"""gymnasium environments on a twin with its effects, registered where this package is imported.

`gymnasium.make("twin.env:twin/ContinuumReach-v0")` imports it; gymnasium 1.x loads no plugins.

continuum.py             twin/ContinuumReach-v0, twin/ContinuumTrack-v0
finger.py                twin/FingerShape-v0
hand.py                  twin/HandReorient-v0
mjcf.py                  twin/MJCFTrack-v0
goals.py                 the same goal-conditioned: twin/ContinuumReachGoal-v0, twin/FingerShapeGoal-v0, twin/HandReorientGoal-v0
episodes/                what all of them share: options, drawn twins, observations, saved states, frames
batch.py                 many environments in threads, for `gymnasium.make_vec`
dm.py                    the continuum tasks as dm_env
plants/                  robots stepped in time under commands, with their effects
"""

from functools import partial
from typing import Any

from gymnasium.envs.registration import register

ENVIRONMENTS = {  # class, steps an episode
    "ContinuumReach-v0": ("twin.env.continuum:ContinuumReach", 100),
    "ContinuumTrack-v0": ("twin.env.continuum:ContinuumTrack", 200),
    "FingerShape-v0": ("twin.env.finger:FingerShape", 100),
    "HandReorient-v0": ("twin.env.hand:HandReorient", 60),
    "MJCFTrack-v0": ("twin.env.mjcf:MJCFTrack", 200),
    "ContinuumReachGoal-v0": ("twin.env.goals:ContinuumReachGoal", 100),
    "FingerShapeGoal-v0": ("twin.env.goals:FingerShapeGoal", 100),
    "HandReorientGoal-v0": ("twin.env.goals:HandReorientGoal", 60),
}


def register_envs() -> None:
    """Register the names, without importing MuJoCo."""
    for name, (kind, steps) in ENVIRONMENTS.items():
        register(f"twin/{name}", kind, max_episode_steps=steps, vector_entry_point=partial(_make_batch, kind))


def _make_batch(entry_point: str, **options: Any) -> Any:
    from twin.env.batch import make_batch

    return make_batch(entry_point=entry_point, **options)


register_envs()
