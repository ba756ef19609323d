"""Random steps over all environments, with drawn twins: no number that is not finite, no crash, and memory that does not grow.

    python -m tools.env_steps [--steps 1000000] [--seconds 3600]

Ends at that many steps or seconds, whichever comes first, and says how many were made. Environments take turns of equal time but
for ContinuumReach, which takes four: it is the fastest. Growth of memory is a line through the resident sizes after each round but
the first.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import twin.env

TURN = 10.0  # s
DRAWN: dict[str, dict[str, Any]] = {
    "ContinuumReach-v0": {"ranges": {"tendon_friction.mu": (0.0, 0.3)}, "payload": (0.0, 0.02), "tip_noise": 2.5e-4},
    "ContinuumTrack-v0": {"randomise": True, "observe": "full"},
    "FingerShape-v0": {"randomise": True, "ranges": {"tendon_friction.mu": (0.0, 0.2)}, "resistance_noise": 1e-3},
    "HandReorient-v0": {"mass": (0.01, 0.06), "friction": (0.4, 1.2), "observe": "full"},
}


class Walk:
    """One environment under random actions."""

    def __init__(self, name: str) -> None:
        self.env = gymnasium.make(f"twin/{name}", **DRAWN[name])
        self.env.action_space.seed(0)
        self.env.reset(seed=0)
        self.steps = self.episodes = self.lost = 0

    def turn(self, seconds: float, most: int) -> None:
        """Raises FloatingPointError for an observation or a reward that is not finite."""
        until = time.monotonic() + seconds
        while time.monotonic() < until and most > 0:
            seen, reward, terminated, truncated, info = self.env.step(self.env.action_space.sample())
            self.steps, most = self.steps + 1, most - 1
            if not (np.isfinite(seen).all() and np.isfinite(reward)):
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
    walks = {name: Walk(name) for name in twin.env.KINDS}
    began, sizes = time.monotonic(), []
    while (made := sum(w.steps for w in walks.values())) < said.steps and time.monotonic() - began < said.seconds:
        for name, walk in walks.items():
            walk.turn(TURN * (4.0 if name == "ContinuumReach-v0" else 1.0), said.steps - made)
        sizes.append((sum(w.steps for w in walks.values()), resident()))
        print(f"{sizes[-1][0]:9d} steps, {time.monotonic() - began:6.0f} s, {sizes[-1][1]:.1f} MB", flush=True)
    for name, walk in walks.items():
        print(f"{name:20s} {walk.steps:9d} steps, {walk.episodes} episodes, {walk.lost} ended by a lost motion")
    if len(sizes) > 2:
        steps, size = np.array(sizes[1:]).T
        print(f"memory: {1e6 * np.polyfit(steps, size, 1)[0]:.1f} MB a million steps, {size[0]:.1f} to {size[-1]:.1f} MB")


if __name__ == "__main__":
    main()
