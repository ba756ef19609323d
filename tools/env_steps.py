"""Random steps over all environments, with drawn twins: no number that is not finite, no crash, and memory that does not grow.

    python -m tools.env_steps [--steps 1000000] [--seconds 3600]

Ends at that many steps or seconds, whichever comes first, and says how many were made. Environments take turns of equal time but
for those at rest, which take more: they are the fastest, and a million steps of the hand would take a day. Growth of memory is a
line through the resident sizes after each round but the first.
"""

from __future__ import annotations

import argparse
import math
import resource
import time
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np

import twin.env

RUBS: dict[str, Any] = {"ranges": {"tendon_friction.mu": (0.0, 0.3)}, "payload": (0.0, 0.02), "tip_noise": 2.5e-4}


class Kind(NamedTuple):
    """An environment, its options and how long its turn is (s)."""

    name: str
    options: dict[str, Any]
    turn: float = 5.0


KINDS = (
    Kind("ContinuumReach-v0", RUBS, 10.0),
    Kind("ContinuumReach-v0", {**RUBS, "dynamic": False, "interval": 0.2}, 40.0),
    Kind("ContinuumReach-v0", {**RUBS, "drive": "displacement"}),
    Kind("ContinuumReach-v0", {**RUBS, "drive": "current", "dynamic": False}, 10.0),
    Kind("ContinuumTrack-v0", {"randomise": True, "observe": "full"}),
    Kind("FingerShape-v0", {"randomise": True, "ranges": {"tendon_friction.mu": (0.0, 0.2)}, "resistance_noise": 1e-3}),
    Kind("HandReorient-v0", {"mass": (0.01, 0.06), "friction": (0.4, 1.2), "observe": "full"}),
)


class Walk:
    """One environment under random actions."""

    def __init__(self, kind: Kind) -> None:
        self.kind, self.env = kind, gymnasium.make(f"twin/{kind.name}", **kind.options)
        self.env.action_space.seed(0)
        self.env.reset(seed=0)
        self.steps = self.episodes = self.lost = 0

    def turn(self, seconds: float, most: int) -> None:
        """Raises FloatingPointError for an observation or a reward that is not finite."""
        until = time.monotonic() + seconds
        while time.monotonic() < until and most > 0:
            seen, reward, terminated, truncated, info = self.env.step(self.env.action_space.sample())
            self.steps, most = self.steps + 1, most - 1
            if not (np.isfinite(seen).all() and math.isfinite(float(reward))):
                raise FloatingPointError(
                    f"{self.env}: step {self.steps} of episode {self.episodes} is not finite: {seen}, {reward}"
                )
            if terminated or truncated:
                self.episodes, self.lost = self.episodes + 1, self.lost + ("lost" in info)
                self.env.reset()


def resident() -> float:
    """MB of this process in memory (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--steps", type=int, default=1_000_000)
    asked.add_argument("--seconds", type=float, default=3600.0)
    said = asked.parse_args()
    assert {kind.name for kind in KINDS} == set(twin.env.KINDS)
    walks = [Walk(kind) for kind in KINDS]
    began, sizes = time.monotonic(), []
    while (made := sum(w.steps for w in walks)) < said.steps and time.monotonic() - began < said.seconds:
        for walk in walks:
            walk.turn(walk.kind.turn, said.steps - made)
        sizes.append((sum(w.steps for w in walks), resident()))
        print(f"{sizes[-1][0]:9d} steps, {time.monotonic() - began:6.0f} s, {sizes[-1][1]:.1f} MB", flush=True)
    for walk in walks:
        how = ", ".join(f"{name}={walk.kind.options[name]}" for name in ("drive", "dynamic") if name in walk.kind.options)
        print(f"{walk.kind.name:20s} {walk.steps:9d} steps, {walk.episodes} episodes, {walk.lost} ended by a lost motion  {how}")
    if len(sizes) > 2:
        steps, size = np.array(sizes[1:]).T
        print(f"memory: {1e6 * np.polyfit(steps, size, 1)[0]:.1f} MB a million steps, {size[0]:.1f} to {size[-1]:.1f} MB")


if __name__ == "__main__":
    main()
