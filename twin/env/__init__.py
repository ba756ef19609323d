"""gymnasium environments on a twin, effects included; found by `gymnasium.make` through its plugin entry point.

plant.py       a twin stepped in time: command in, what the robot's sensors say out
domain.py      twins drawn from what a diagnosis does not know
continuum.py   twin/ContinuumReach-v0, twin/ContinuumTrack-v0
picture.py     frames by MuJoCo's renderer
"""

from __future__ import annotations

import gymnasium

LENGTHS = {"ContinuumReach-v0": ("ContinuumReach", 100), "ContinuumTrack-v0": ("ContinuumTrack", 200)}  # class, steps an episode


def register_envs() -> None:
    """What `gymnasium` calls on its first import: names only, so that it costs no MuJoCo."""
    for name, (kind, steps) in LENGTHS.items():
        gymnasium.register(f"twin/{name}", f"twin.env.continuum:{kind}", max_episode_steps=steps)
