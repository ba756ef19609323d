"""Steps a second of one environment and of a batch of them, and how much of a step is MuJoCo's own.

    python -m tools.benchmarks.tasks.env_speed [--envs 64] [--steps 20] [--name ContinuumReach-v0]

Beside the clock's time stands the processor's, which other work on the machine changes less. What MuJoCo's bare steps take of it
bounds what any batch on these cores can do.
"""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import mujoco
import numpy as np
import tyro
from joblib import cpu_count

import twin.env  # noqa: F401  # registers the environments


def timed(env: Any, steps: int) -> tuple[float, float]:
    """Seconds by the clock and of processors for that many calls of `step` under random actions, after one."""
    env.reset(seed=0)
    env.action_space.seed(0)
    env.step(env.action_space.sample())
    clock, processor = time.perf_counter(), time.process_time()
    for _ in range(steps):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if np.ndim(terminated) == 0 and (terminated or truncated):
            env.reset()
    return (time.perf_counter() - clock) / steps, (time.process_time() - processor) / steps


def bare(env: gymnasium.Env) -> float:
    """Processor seconds of MuJoCo's own steps in a step of the environment."""
    plant = env.unwrapped.plant  # type: ignore[attr-defined]
    model, data = plant.motion.model, plant.motion.data
    n = round(plant.interval / model.opt.timestep)
    began = time.process_time()
    mujoco.mj_step(model, data, 40 * n)
    return (time.process_time() - began) / 40


def main(envs: int = 64, steps: int = 20, name: str = "ContinuumReach-v0") -> None:
    """Print steps a second of one environment and of a batch."""
    name, number, cores = f"twin/{name}", envs, cpu_count()
    env, batch = gymnasium.make(name), gymnasium.make_vec(name, number)
    one, busy = timed(env, 10 * steps)
    own = bare(env)
    many, together = (t / number for t in timed(batch, steps))
    print(f"one environment      {1.0 / one:7.1f} steps/s, {1e3 * busy:.2f} ms of processor a step")
    print(f"MuJoCo's own steps   {100.0 * own / busy:7.1f} % of that")
    print(f"{number:3d} in a batch       {1.0 / many:7.1f} steps/s, {1e3 * together:.2f} ms; {one / many:.2f} times as many")
    free = f"this batch {cores * busy / together:.2f}, bare MuJoCo {cores * busy / own:.2f} times as many"
    print(f"{cores} cores with nothing else to do, by processor time: {free}")
    batch.close()


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
