"""What effects cost a rollout: its steps a second over those of bare `mujoco.rollout` on the same model.

    python -m tools.benchmarks.solvers.rollout_speed [--seconds 10] [--repeats 5]

Both make the same number of steps of the same compiled model on one thread, turn about. Both move: the time that MuJoCo's implicit
springs take depends on it. The bare ones start where the twin's first command left it and pull each tendon by up to 1 N at 1 Hz.
Process time, medians of the repeats and of their ratios, since other work on the machine slows both.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import mujoco
import mujoco.rollout
import numpy as np
import tyro

from twin.body import Drive
from twin.effects import effect_class
from twin.env.plants.rod_plant import RodPlant
from twin.measurements import Channel, Recording, Trial
from twin.mechanics.rod.dynamics import ChainMotion
from twin.prediction.kinematics import warmest_current
from twin.prediction.rollout import draw_controls, rollout
from twin.prediction.rollout.controls import Drawing
from twin.prediction.twin import Twin

FRICTION_LAW = ("tendon_friction", {"mu": 0.21})
CREEP = ("backbone_creep", {"amplitude": 0.1, "time": 5.0})
COMMAND_RATE = 50.0  # Hz
FULL_PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS


def twins() -> list[tuple[str, Twin, Drive]]:
    plain = Twin.of("continuum")
    rubs, creeps = (
        replace(plain, effects=tuple(effect_class(n)(v) for n, v in laws)) for laws in ((FRICTION_LAW,), (FRICTION_LAW, CREEP))
    )
    return [
        ("tensions, no effect", plain, Drive.TENSION), ("tensions, friction", rubs, Drive.TENSION),
        ("tensions, friction and creep", creeps, Drive.TENSION), ("displacements, friction", rubs, Drive.DISPLACEMENT),
        ("SMA springs, friction", rubs, Drive.CURRENT),
    ]  # fmt: skip


def controls(twin: Twin, drive: Drive, seconds: float) -> Recording:
    if drive is not Drive.CURRENT:
        return draw_controls(twin, 1, 0, Drawing(seconds, COMMAND_RATE, drive))
    most, time = warmest_current(twin)[0], np.arange(round(seconds * COMMAND_RATE) + 1) / COMMAND_RATE
    channels = [Channel(f"sma_{i}_current", "input", "A") for i in (1, 2, 3)]
    channels += [Channel(f"tip_{a}", "output", "mm") for a in "xyz"]
    values = {c.name: np.full(len(time), np.nan if c.role == "output" else most * c.name.startswith("sma_1")) for c in channels}
    return Recording("continuum", "one spring warm", "", None, tuple(channels), (Trial("warm", time, values),))


def started(twin: Twin, drive: Drive, told: Recording) -> ChainMotion:
    """What the rollout steps, after its first second."""
    plant, trial = RodPlant(twin, 1.0 / COMMAND_RATE, drive=drive), told.trials[0]
    names = [c.name for c in told.inputs()]
    for k in range(1, round(COMMAND_RATE) + 1):
        plant.step(np.array([trial.values[n][k] for n in names]))
    assert isinstance(plant.motion, ChainMotion)
    return plant.motion


def pulled(model: mujoco.MjModel, steps: int) -> np.ndarray:
    """(1, steps, nu) N: every tendon's segments alike, tendons a third of a turn apart."""
    t = model.opt.timestep * np.arange(steps)
    tendon = np.array([int(model.actuator(k).name.split("_")[1]) for k in range(model.nu)])
    return 0.5 * (1.0 + np.sin(2.0 * np.pi * (t[:, None] - tendon / 3.0)))[None]


def timed(work: Callable[[], object]) -> float:
    """Return the process time (s) of some work."""
    began = time.process_time()
    work()
    return time.process_time() - began


def compared(twin: Twin, drive: Drive, seconds: float, repeats: int) -> np.ndarray:
    """(repeats, 2) steps a second of the rollout and of bare MuJoCo."""
    told = controls(twin, drive, seconds)
    moving = started(twin, drive, told)
    model, steps = moving.model, round(seconds / moving.model.opt.timestep)
    data, state = mujoco.MjData(model), np.zeros((1, mujoco.mj_stateSize(model, FULL_PHYSICS)))
    mujoco.mj_getState(model, moving.data, state[0], FULL_PHYSICS)
    pulls = pulled(model, steps)

    def ours() -> None:
        rollout(twin, told)

    def bare() -> None:
        mujoco.rollout.rollout(model, data, state, pulls)

    ours()  # compiles
    return steps / np.array([(timed(ours), timed(bare)) for _ in range(repeats)])


def main(seconds: float = 10.0, repeats: int = 5) -> None:
    """Print steps a second of the twin and of bare MuJoCo, by drive and effects."""
    for name, twin, drive in twins():
        ours, bare = compared(twin, drive, seconds, repeats).T
        share = 100.0 * ours / bare
        print(
            f"{name:30s} {np.median(ours):8.0f} of {np.median(bare):8.0f} steps a second: {np.median(share):.0f} % "
            f"({share.min():.0f} to {share.max():.0f})",
            flush=True,
        )


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
