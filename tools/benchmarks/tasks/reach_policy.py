"""A policy that brings the tip of a twin's robot to a goal, trained with Stable-Baselines3 (extra `policy`) in a minute or two.

    python -m tools.benchmarks.tasks.reach_policy report/ policy.zip [--blind] [--randomise] [--seed 0]

It is told what load cells and a tip camera read, with their noise, what it commands, and the goal; `--blind` takes the camera away.
An episode is 20 moves of 0.2 s, the robot at rest after each. Prints the share of fresh goals within 3 mm at an episode's end.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
import tyro

from twin.env.continuum import ContinuumReach
from twin.foundation.errors import TwinError

if TYPE_CHECKING:
    from stable_baselines3 import SAC

MOVES, TRAINING_STEPS = 20, 4000
TASK: dict[str, Any] = {"interval": 0.2, "dynamic": False, "tension_noise": 0.01, "tip_noise": 2.5e-4}
SENSORS_SEEN = {True: ("load_cells",), False: ("load_cells", "tip")}  # by whether it is blind
TEST_SEED = 900_000  # and on: the episodes that a policy is tried on
ON_THE_WAY = 1000  # steps between two trials of a policy in training
Act = Callable[[np.ndarray], np.ndarray]


class Aimed(gymnasium.ObservationWrapper):
    """Goal minus tip, tenfold, in place of the tip: what is to be made zero is then of order one. Goals twofold."""

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        parts = env.unwrapped.parts  # type: ignore[attr-defined]
        ends = np.cumsum(list(parts.values()))
        self._part = {name: slice(end - size, end) for (name, size), end in zip(parts.items(), ends, strict=True)}

    def observation(self, observation: np.ndarray) -> np.ndarray:
        seen, goal = observation.copy(), self._part["goal"]
        if "tip" in self._part:
            seen[self._part["tip"]] = 10.0 * (seen[goal] - seen[self._part["tip"]])
        seen[goal] *= 2.0
        return seen


def episodes_of(env: ContinuumReach) -> gymnasium.Env:
    """The environment as a policy is trained and tried on it."""
    return Aimed(gymnasium.wrappers.TimeLimit(env, MOVES))


def task(source: str | Path, blind: bool, randomise: bool = False) -> gymnasium.Env:
    """Reaching on a twin.toml, a report or a robot's name."""
    return episodes_of(ContinuumReach(source, sensors=SENSORS_SEEN[blind], randomise=randomise, **TASK))


def train(
    env: gymnasium.Env, seed: int, steps: int = TRAINING_STEPS, look: Callable[[int, Act], None] = lambda step, act: None
) -> SAC:
    """A policy for `env`; `look` is shown it every ON_THE_WAY steps. Raises TwinError without Stable-Baselines3."""
    try:
        import torch
        from stable_baselines3 import SAC
        from stable_baselines3.common.callbacks import BaseCallback, EveryNTimesteps
    except ModuleNotFoundError as fault:
        raise TwinError(f"training needs {fault.name}: pip install '.[policy]'") from None
    torch.set_num_threads(1)
    model = SAC(
        "MlpPolicy", env, policy_kwargs={"net_arch": [64, 64]}, learning_rate=lambda left: 3e-3 * max(left, 0.02),
        learning_starts=400, batch_size=128, gamma=0.7, tau=0.01, ent_coef=0.01, train_freq=(1, "episode"), gradient_steps=MOVES,
        seed=seed, device="cpu",
    )  # fmt: skip

    class Look(BaseCallback):
        def _on_step(self) -> bool:
            look(self.num_timesteps, acting(model))
            return True

    model.learn(steps, callback=EveryNTimesteps(ON_THE_WAY, Look()))
    return model


def acting(model: SAC) -> Act:
    """What it does without exploring."""
    return lambda seen: model.predict(seen, deterministic=True)[0]


def distances(env: gymnasium.Env, act: Act, episodes: int) -> list[float]:
    """From the tip to the goal (m) at the end of each of as many fresh episodes; infinite where the motion was lost."""
    found = []
    for k in range(episodes):
        seen, _ = env.reset(seed=TEST_SEED + k)
        ended, info = False, {}
        while not ended:
            seen, _, lost, out, info = env.step(act(seen))
            ended = lost or out
        found.append(np.inf if "lost" in info else float(info["distance"]))
    return found


def main(
    twin: tyro.conf.Positional[str],
    out: tyro.conf.Positional[Path],
    blind: bool = False,
    randomise: bool = False,
    seed: int = 0,
    steps: int = TRAINING_STEPS,
) -> None:
    """Train a policy and keep it.

    Args:
        twin: a twin.toml, a report's folder or a robot's name
        out: the policy, as Stable-Baselines3 keeps it
        blind: without the tip camera
        randomise: draw each episode's twin from the diagnosis's own uncertainty
        seed: of the training
        steps: of the training
    """

    def look(step: int, act: Act) -> None:
        near = np.array(distances(trial, act, 50))
        took = time.perf_counter() - began
        print(f"{took:5.1f} s, step {step}: {100 * np.mean(near < 3e-3):.0f} % within 3 mm, median {1e3 * np.median(near):.2f} mm")

    try:
        began, trial = time.perf_counter(), task(twin, blind)
        train(task(twin, blind, randomise), seed, steps, look).save(out)
    except TwinError as fault:
        sys.exit(str(fault))
    print(out)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
