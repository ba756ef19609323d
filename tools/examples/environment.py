"""A gymnasium environment on a twin: bring the tip to a goal, with the effects that a diagnosis found.

With a folder, as in `python -m tools.examples.environment logs/`, a policy learns in four at once as well (extra `policy`);
`tensorboard --logdir logs/` shows it learning. python -m tools.benchmarks.tasks.reach_policy trains one to the end.
"""

import sys
from pathlib import Path

import gymnasium
import numpy as np


def main(steps: int = 40) -> float:
    # %% The part before the colon registers the environments; `twin` takes a twin.toml, a report's folder or a robot's name.
    env = gymnasium.make("twin.env:twin/ContinuumReach-v0", twin="continuum")
    observation, info = env.reset(seed=1)
    print(f"{len(observation)} numbers observed; the goal is {1e3 * info['distance']:.0f} mm away")

    # %% A search without a model: keep the last change while it helps, else draw another.
    rng, action, best = np.random.default_rng(0), 0.0 * env.action_space.sample(), info["distance"]
    for _ in range(steps):
        _, _, terminated, truncated, info = env.step(action)
        if info["distance"] >= best:
            action = rng.uniform(-1.0, 1.0, action.shape).astype(np.float32)
        best = min(best, info["distance"])
        if terminated or truncated:
            break
    print(f"after {steps} steps {1e3 * best:.0f} mm")
    env.close()
    return best


def learn(log: Path, steps: int = 20_000) -> None:
    # %% The libraries are imported here, since the search above needs neither.
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    from twin.env.sb3 import BatchVecEnv

    batch = gymnasium.make_vec("twin.env:twin/ContinuumReach-v0", 4, twin="continuum", dynamic=False)
    envs = VecMonitor(BatchVecEnv(batch), info_keywords=("is_success",))  # what an episode earned goes to the log
    PPO("MlpPolicy", envs, n_steps=100, batch_size=100, tensorboard_log=str(log), seed=1, device="cpu").learn(steps)
    envs.close()


if __name__ == "__main__":
    main()
    if len(sys.argv) > 1:
        learn(Path(sys.argv[1]))
