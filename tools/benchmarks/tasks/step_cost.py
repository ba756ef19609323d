"""What effects cost a step of `twin/ContinuumReach-v0`: its time over that without and over bare MuJoCo's on the same model.

    python -m tools.benchmarks.tasks.step_cost [--steps 40] [--repeats 5]

All twins take the same random actions, turn about; bare MuJoCo then makes as many steps of the same compiled model from the state
that the twin was left in. Process time, medians of the repeats and of their ratios, since other work on the machine slows all.
"""

from dataclasses import replace

import mujoco
import numpy as np
import tyro

from tools.benchmarks.solvers.rollout_speed import timed
from twin.effects import effect_class
from twin.env.continuum import ContinuumReach
from twin.env.plants.rod_plant import RodPlant
from twin.mechanics.rod.dynamics import ChainMotion
from twin.prediction.twin import Twin

MU, CREEP = 0.214, {"amplitude": 0.1, "time": 5.0}
# m: the default of the effect, and what the bundled day's diagnosis finds
PRESLIDING = {"tendon_friction's own presliding": 4e-4, "the bundled day's presliding": 8.7e-5}


def twins() -> dict[str, Twin]:
    """Return the twins by their effects."""
    plain = Twin.of("continuum")
    found = {"no effect": plain, "creep": plain.with_effect(effect_class("backbone_creep")(CREEP))}
    for name, presliding in PRESLIDING.items():
        rubs = effect_class("tendon_friction")({"mu": MU, "presliding": presliding})
        found[f"friction and creep, {name}"] = replace(found["creep"], effects=(rubs, *found["creep"].effects))
    return found


def motion(env: ContinuumReach) -> ChainMotion:
    """Return what the environment steps by MuJoCo."""
    assert isinstance(env.plant, RodPlant)
    assert isinstance(env.plant.motion, ChainMotion)
    return env.plant.motion


def episode(env: ContinuumReach, actions: np.ndarray) -> tuple[float, float, int]:
    """Return seconds a step of the environment, seconds bare MuJoCo takes for it, and its MuJoCo steps."""
    env.reset(seed=1)
    ours = timed(lambda: [env.step(a) for a in actions])
    model, data = motion(env).model, motion(env).data
    count = round(len(actions) * env.interval / model.opt.timestep)
    bare = timed(lambda: mujoco.mj_step(model, data, count))
    return ours / len(actions), bare / len(actions), count // len(actions)


def main(steps: int = 40, repeats: int = 5) -> None:
    """Print the cost of a step by effects."""
    envs = {name: ContinuumReach(twin=twin) for name, twin in twins().items()}
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (steps, 3))
    for env in envs.values():
        episode(env, actions[:2])  # compiles
    rounds = [{name: episode(env, actions) for name, env in envs.items()} for _ in range(repeats)]
    for name in envs:
        ours, bare = np.array([r[name][:2] for r in rounds]).T
        ratio = np.median([r[name][0] / r["no effect"][0] for r in rounds])
        print(
            f"{name:60s} {1e3 * np.median(ours):6.2f} ms a step, {ratio:.2f} times that without, "
            f"{np.median(ours / bare):.2f} times bare MuJoCo's {rounds[0][name][2]} steps"
        )


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
