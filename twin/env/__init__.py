"""gymnasium environments on a twin, effects included; registered where this package is imported.

`gymnasium.make("twin.env:twin/ContinuumReach-v0")` imports it by itself; gymnasium 1.x asks no plugins.

plant.py       a twin stepped in time: command in, what the robot's sensors say out
domain.py      twins drawn from what a diagnosis does not know
continuum.py   twin/ContinuumReach-v0, twin/ContinuumTrack-v0
picture.py     frames by MuJoCo's renderer
"""

from __future__ import annotations

from gymnasium.envs.registration import register

LENGTHS = {"ContinuumReach-v0": ("ContinuumReach", 100), "ContinuumTrack-v0": ("ContinuumTrack", 200)}  # class, steps an episode


def register_envs() -> None:
    """Names only, so that it costs no MuJoCo."""
    for name, (kind, steps) in LENGTHS.items():
        register(f"twin/{name}", f"twin.env.continuum:{kind}", max_episode_steps=steps)


register_envs()
