"""The soft finger and the hand in motion: where they come to rest against statics, what half a step changes, and their speed.

    python -m tools.benchmarks.solvers.finger_dynamics [--repeats 3] [--picture hand.png]

Finger: tendon friction 0.3 and sensors read at 100 Hz, motions of a second: eased to 9 mm; antagonists to 8 mm and back in a
second; exchanged at their fastest through slack. Hand: closing on a ball, then holding it. Speeds are seconds of motion over
those of this process (one thread), the best of the repeats: other work on the machine only slows it down.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import tyro
from PIL import Image

from twin.body import Drive, Loads, Problem, Route
from twin.body import Solution as Answer
from twin.mechanics.silicone import HandDynamics, HandStatics, SoftDynamics, SoftStatics
from twin.mechanics.silicone.motion import dynamics
from twin.mechanics.silicone.motion.scene import Scene, Thing
from twin.robots import load

FULL = 0.0741  # strain at 2 N
HANGING_GRAVITY = np.array([0.0, 0.0, 9.81])
BALL = Thing("ball", "sphere", (0.025,), 0.03, (0.0, 0.0, 0.092))
TABLE_UNDER_BALL = Thing("table", "box", (0.1, 0.1, 0.005), 1.0, (0.0, 0.0, 0.122), fixed=True)


def eased(t: np.ndarray) -> np.ndarray:
    s = np.minimum(1.0, t / 0.4)
    return np.column_stack([9e-3 * s**2 * (3.0 - 2.0 * s), *np.full((3, len(t)), -6e-3)])


def to_and_fro(t: np.ndarray) -> np.ndarray:
    one = 4e-3 * (1.0 - np.cos(2.0 * np.pi * t))
    return np.column_stack([one, np.full(len(t), -6e-3), -one - 1e-3, np.full(len(t), -6e-3)])


def exchanged(t: np.ndarray) -> np.ndarray:
    one = 6e-3 * np.sin(2.0 * np.pi * t)
    return np.column_stack([one, np.full(len(t), -6e-3), -one, np.full(len(t), -6e-3)])


def problem(commands: Callable[[np.ndarray], np.ndarray], seconds: float = 1.0, hold: float = 0.0) -> Problem:
    t = np.arange(round(100 * (seconds + hold)) + 1) / 100
    return Problem(t, commands(np.minimum(t, seconds)), Loads(HANGING_GRAVITY), Route(mu=0.3), drives=(Drive.DISPLACEMENT,) * 4)


def moved(asked: Problem, step: float | None = None) -> tuple[Answer, float]:
    """Return the motion, with another step if one is given, and the process's time for it (s)."""
    usual = dynamics.motion_step
    try:
        if step is not None:
            dynamics.motion_step = lambda body: step
        robot = load("finger")
        solver = SoftDynamics(robot.silicone(robot.build()))
        began = time.process_time()
        path = solver.solve(asked)
        spent = time.process_time() - began
    finally:
        dynamics.motion_step = usual
    assert path.status.all(), path.end_reason
    return path, spent


def finger(repeats: int) -> None:
    """Print rest, step and speed of the finger's motions."""
    robot = load("finger")
    body = robot.silicone(robot.build())
    step = dynamics.motion_step(body)
    print(f"finger, {1e3 * step:g} ms a step          tip at rest  strain at rest  half a step: worst, mean   speed")
    for motion in (eased, to_and_fro, exchanged):
        asked = problem(motion, hold=0.0)
        resting = problem(motion, seconds=0.85, hold=1.2)
        rest, still = moved(resting)[0], SoftStatics(body).solve(resting)
        tip = 1e3 * np.linalg.norm(rest.markers[-1, -1] - still.markers[-1, -1])
        strain = 100 * np.abs(rest.others["strain"][-1] - still.others["strain"][-1]).max() / FULL
        runs = [moved(asked) for _ in range(repeats)]
        change = 1e3 * np.linalg.norm(runs[0][0].markers - moved(asked, 0.5 * step)[0].markers, axis=2)
        speed = asked.time[-1] / min(spent for _, spent in runs)
        print(f"  {motion.__name__:<24} {tip:8.3f} mm {strain:12.2f} % {change.max():12.3f} {change.mean():7.4f} mm {speed:8.1f} x")


def hand(repeats: int) -> Scene:
    """Print rest and speed of the hand, in free air and holding a ball; return the scene."""
    robot = load("hand")
    body = robot.hand(robot.build())
    one = problem(eased, seconds=0.4, hold=0.6)
    asked = replace(one, command=np.tile(one.command, (1, 3)), drives=one.drives * 3)
    ends = [solver.solve(asked).markers[-1] for solver in (HandDynamics(body), HandStatics(body))]
    apart = 1e3 * np.linalg.norm(ends[0] - ends[1], axis=1).max()
    print(f"hand, every finger eased to 9 mm: at rest within {apart:.3f} mm of statics")
    scene = Scene(body, [BALL, TABLE_UNDER_BALL], HANGING_GRAVITY)
    free, held = [], []
    for _ in range(repeats):
        scene.reset()
        for k in range(50):
            s = min(1.0, (k + 1) / 30)
            began = time.process_time()
            seen = scene.step(np.tile([8e-3 * s**2 * (3.0 - 2.0 * s), 0.0], (3, 1)), 0.02)
            (held if seen.touching else free).append((time.process_time() - began) / 0.02)
    deep = -1e3 * min(0.0, float(scene.data.contact.dist.min()))
    grips = f"holding a ball at {seen.touching} points (median {1 / np.median(held):.2f} x)"
    speeds = f"{1 / np.quantile(free, 0.1):.2f} x without contact, {1 / np.quantile(held, 0.1):.2f} x {grips}"
    pulls = np.round(seen.tension[:, 0], 2).tolist()
    print(f"hand, {1e3 * scene.motion.step:g} ms a step: {speeds}; deepest contact {deep:.2f} mm, tensions {pulls} N")
    return scene


def draw(scene: Scene, picture: Path) -> None:
    """Draw the hand and what it holds, from the side. Needs MUJOCO_GL=egl where there is no screen."""
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = [0.0, 0.0, 0.06], 0.32, 60.0, 15.0
    with mujoco.Renderer(scene.model, 480, 640) as renderer:
        renderer.update_scene(scene.data, camera)
        Image.fromarray(renderer.render()).save(picture)
    print(f"drawn: {picture}")


def main(repeats: int = 3, picture: Path | None = None) -> None:
    """Print rest positions, what half a step changes, and speeds; draw the hand holding a ball."""
    moved(problem(eased, 0.1))  # compiles
    finger(repeats)
    scene = hand(repeats)
    if picture is not None:
        draw(scene, picture)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
