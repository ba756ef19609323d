"""gymnasium environments on a twin, effects included; registered where this package is imported.

`gymnasium.make("twin.env:twin/ContinuumReach-v0")` imports it by itself; gymnasium 1.x asks no plugins.

plant.py       a backbone stepped in time: command in, what the robot's sensors say out
soft_plant.py  a silicone finger or a hand among things, the same
wires.py       what effects make of commands and signals over an episode
domain.py      twins drawn from what a diagnosis does not know
checks.py      options and actions that are refused or clipped
continuum.py   twin/ContinuumReach-v0, twin/ContinuumTrack-v0
finger.py      twin/FingerShape-v0
hand.py        twin/HandReorient-v0
batch.py       many of them side by side, for `gymnasium.make_vec`
dm.py          the continuum tasks as dm_env
picture.py     frames by MuJoCo's renderer
"""

from __future__ import annotations

from functools import partial
from typing import Any

from gymnasium.envs.registration import register

KINDS = {  # class, steps an episode
    "ContinuumReach-v0": ("twin.env.continuum:ContinuumReach", 100),
    "ContinuumTrack-v0": ("twin.env.continuum:ContinuumTrack", 200),
    "FingerShape-v0": ("twin.env.finger:FingerShape", 100),
    "HandReorient-v0": ("twin.env.hand:HandReorient", 60),
}


def register_envs() -> None:
    """Names only, so that it costs no MuJoCo."""
    for name, (kind, steps) in KINDS.items():
        register(f"twin/{name}", kind, max_episode_steps=steps, vector_entry_point=partial(_batch, kind))


def _batch(entry_point: str, **options: Any) -> Any:
    from twin.env.batch import batch

    return batch(entry_point=entry_point, **options)


register_envs()
