"""Steps a second of one environment and of a batch of them, and how much of a step is MuJoCo's own.

    python -m tools.env_speed [--envs 64] [--steps 100] [--name ContinuumReach-v0]

What MuJoCo's bare step takes bounds what any batch on these cores can do: cores x interval / (steps x bare step) a second.
"""

from __future__ import annotations

import argparse
import time

import gymnasium
import mujoco
import numpy as np
from joblib import cpu_count

import twin.env


def single(env: gymnasium.Env, steps: int) -> float:
    """Steps a second under random actions."""
    env.reset(seed=0)
    env.action_space.seed(0)
    env.step(env.action_space.sample())
    began = time.perf_counter()
    for _ in range(steps):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    return steps / (time.perf_counter() - began)


def batched(name: str, n: int, steps: int) -> float:
    envs = gymnasium.make_vec(name, n)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    envs.step(envs.action_space.sample())
    began = time.perf_counter()
    for _ in range(steps):
        envs.step(envs.action_space.sample())
    rate = n * steps / (time.perf_counter() - began)
    envs.close()
    return rate


def bare(env: gymnasium.Env) -> float:
    """Seconds of MuJoCo's own steps in a step of the environment."""
    plant = env.unwrapped.plant  # type: ignore[attr-defined]
    model, data = plant.moving.model, plant.moving.data
    n = round(plant.interval / model.opt.timestep)
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    began = time.perf_counter()
    mujoco.mj_step(model, data, 40 * n)
    taken = (time.perf_counter() - began) / 40
    mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    return taken


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--envs", type=int, default=64)
    asked.add_argument("--steps", type=int, default=20)
    asked.add_argument("--name", default="ContinuumReach-v0", choices=[n for n in twin.env.KINDS if n.startswith("Continuum")])
    said = asked.parse_args()
    name = f"twin/{said.name}"
    env = gymnasium.make(name)
    one, own = single(env, 10 * said.steps), bare(env)
    many = batched(name, said.envs, said.steps)
    print(f"one environment       {one:8.1f} steps/s")
    print(f"MuJoCo's own steps    {100 * own * one:8.1f} % of that ({1e3 * own:.2f} ms of {1e3 / one:.2f})")
    print(f"{said.envs:3d} in one batch      {many:8.1f} steps/s, {many / one:.2f} times as many")
    cores = cpu_count()
    print(print(f"bare MuJoCo, {cores} cores {cores / own:8.1f} steps/s, {cores / own / one:.2f} times as many"))


if __name__ == "__main__":
    main()
