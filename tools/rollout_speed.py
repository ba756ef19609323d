"""What effects cost a rollout: its steps a second over those of bare `mujoco.rollout` on the same model.

    python -m tools.rollout_speed [--seconds 10] [--repeats 5]

Both make the same number of steps of the same compiled model on one thread, turn about. Both move: the time that MuJoCo's implicit
springs take depends on it. The bare ones start where the twin's first command left it and pull each tendon by up to 1 N at 1 Hz.
Process time, medians of the repeats and of their ratios, since other work on the machine slows both.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import mujoco
import mujoco.rollout
import numpy as np

from twin.dynamics import Moving
from twin.effects import Drive, named
from twin.env.plant import Plant
from twin.kinematics import warmest_current
from twin.measurements import Channel, Recording, Trial
from twin.rollout import drawn, rollout
from twin.rollout.controls import Drawing
from twin.twin import Twin

FRICTION = ("tendon_friction", {"mu": 0.21})
CREEP = ("backbone_creep", {"amplitude": 0.1, "time": 5.0})
RATE = 50.0  # Hz
FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS


def twins() -> list[tuple[str, Twin, Drive]]:
    plain = Twin.of("continuum")
    rubs, creeps = (replace(plain, effects=tuple(named(n)(v) for n, v in laws)) for laws in ((FRICTION,), (FRICTION, CREEP)))
    return [
        ("tensions, no effect", plain, Drive.TENSION), ("tensions, friction", rubs, Drive.TENSION),
        ("tensions, friction and creep", creeps, Drive.TENSION), ("displacements, friction", rubs, Drive.DISPLACEMENT),
        ("SMA springs, friction", rubs, Drive.CURRENT),
    ]  # fmt: skip


def controls(twin: Twin, drive: Drive, seconds: float) -> Recording:
    if drive is not Drive.CURRENT:
        return drawn(twin, 1, 0, Drawing(seconds, RATE, drive))
    most, time = warmest_current(twin)[0], np.arange(round(seconds * RATE) + 1) / RATE
    channels = [Channel(f"sma_{i}_current", "input", "A") for i in (1, 2, 3)]
    channels += [Channel(f"tip_{a}", "output", "mm") for a in "xyz"]
    values = {c.name: np.full(len(time), np.nan if c.role == "output" else most * c.name.startswith("sma_1")) for c in channels}
    return Recording("continuum", "one spring warm", "", None, tuple(channels), (Trial("warm", time, values),))


def started(twin: Twin, drive: Drive, told: Recording) -> Moving:
    """What the rollout steps, after its first second."""
    plant, trial = Plant(twin, 1.0 / RATE, drive=drive), told.trials[0]
    names = [c.name for c in told.inputs()]
    for k in range(1, round(RATE) + 1):
        plant.step(np.array([trial.values[n][k] for n in names]))
    assert isinstance(plant.moving, Moving)
    return plant.moving


def pulled(model: mujoco.MjModel, steps: int) -> np.ndarray:
    """(1, steps, nu) N: every tendon's segments alike, tendons a third of a turn apart."""
    t = model.opt.timestep * np.arange(steps)
    tendon = np.array([int(model.actuator(k).name.split("_")[1]) for k in range(model.nu)])
    return 0.5 * (1.0 + np.sin(2.0 * np.pi * (t[:, None] - tendon / 3.0)))[None]


def timed(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def compared(twin: Twin, drive: Drive, seconds: float, repeats: int) -> np.ndarray:
    """(repeats, 2) steps a second of the rollout and of bare MuJoCo."""
    told = controls(twin, drive, seconds)
    moving = started(twin, drive, told)
    model, steps = moving.model, round(seconds / moving.model.opt.timestep)
    data, state = mujoco.MjData(model), np.zeros((1, mujoco.mj_stateSize(model, FULL)))
    mujoco.mj_getState(model, moving.data, state[0], FULL)
    pulls = pulled(model, steps)

    def ours() -> None:
        rollout(twin, told)

    def bare() -> None:
        mujoco.rollout.rollout(model, data, state, pulls)

    ours()  # compiles
    return steps / np.array([(timed(ours), timed(bare)) for _ in range(repeats)])


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--seconds", type=float, default=10.0)
    asked.add_argument("--repeats", type=int, default=5)
    said = asked.parse_args()
    for name, twin, drive in twins():
        ours, bare = compared(twin, drive, said.seconds, said.repeats).T
        share = 100.0 * ours / bare
        print(
            f"{name:30s} {np.median(ours):8.0f} of {np.median(bare):8.0f} steps a second: {np.median(share):.0f} % "
            f"({share.min():.0f} to {share.max():.0f})",
            flush=True,
        )


if __name__ == "__main__":
    main()
