"""A gymnasium environment on a twin: bring the tip to a goal, with the effects that a diagnosis found.

python -m tools.benchmarks.tasks.reach_policy trains a policy in it (extra `policy`).
"""

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


if __name__ == "__main__":
    main()
