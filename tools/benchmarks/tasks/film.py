"""One trial of each task, done by a policy, as a film and as a strip of pictures.

    MUJOCO_GL=egl python -m tools.benchmarks.tasks.film DATA... --out films/ [--way shape] [--seed 2000] [--trial 0]

DATA are folders that `twin demonstrate` made; a policy that they do not hold yet is trained. Each gives TASK.gif, in real time, and
TASK.png; tasks.png has all strips. The trial is the one of that seed and number that `twin imitate` would count. Needs a way for
MuJoCo to draw: MUJOCO_GL=egl where there is no screen.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import tyro
from PIL import Image, ImageDraw, ImageFont

from twin.robots import load
from twin.tasks import CONTROL_STEP, TaskTrial, make_task
from twin.tasks.imitation.demonstrate import read_order
from twin.tasks.imitation.imitate import PolicyRunner, make_policy
from twin.tasks.imitation.policy_training import PolicyTrainingSpec

WIDE, HIGH, STRIP = 400, 300, 6  # pixels of a film; pictures of a strip
EACH = 4  # steps a picture: 12.5 of them a second, GIF counts hundredths
COLOURS = 64
LOOKED_AT, DISTANCE, AZIMUTH, ELEVATION = (0.0, 0.0, 0.085), 0.27, 120.0, 25.0
LIGHT = 0.45  # of the headlight, from everywhere: the palm itself shades what it holds


class Camera:
    """Pictures of one scene, the palm above."""

    def __init__(self, model: mujoco.MjModel) -> None:
        model.vis.headlight.ambient[:] = LIGHT
        self.view, self.renderer = mujoco.MjvCamera(), mujoco.Renderer(model, HIGH, WIDE)
        self.view.lookat[:] = LOOKED_AT
        self.view.distance, self.view.azimuth, self.view.elevation = DISTANCE, AZIMUTH, ELEVATION

    def take(self, data: mujoco.MjData) -> np.ndarray:
        """(HIGH, WIDE, 3), on white. MuJoCo's picture has z, where tips and gravity point, upwards."""
        self.renderer.update_scene(data, self.view)
        picture = self.renderer.render().copy()
        self.renderer.enable_depth_rendering()
        picture[self.renderer.render() > 10.0 * DISTANCE] = 255
        self.renderer.disable_depth_rendering()
        return picture[::-1, ::-1]


def filmed(actor: PolicyRunner, rng: np.random.Generator) -> tuple[list[np.ndarray], str]:
    """A trial's pictures, and what became of it."""
    pictures, camera, trial = [], None, None
    for k, trial in enumerate(actor.trial_steps(rng)):
        camera = camera or Camera(trial.scene.model)
        if k % EACH == 0:
            pictures.append(camera.take(trial.scene.data))
    assert isinstance(trial, TaskTrial)
    assert camera is not None
    camera.renderer.close()
    return pictures, trial.outcome().value


def strip(pictures: Sequence[np.ndarray], words: str) -> Image.Image:
    """Some of them in a row, half as large, with the time on each and words on the first."""
    shown = np.linspace(0, len(pictures) - 1, STRIP).round().astype(int)
    row = Image.new("RGB", (STRIP * WIDE // 2, HIGH // 2), "white")
    draw, font = ImageDraw.Draw(row), ImageFont.load_default(12)
    for j, k in enumerate(shown):
        row.paste(Image.fromarray(pictures[k]).resize((WIDE // 2, HIGH // 2)), (j * WIDE // 2, 0))
        said = f"{k * EACH * CONTROL_STEP:.1f} s"
        draw.text((j * WIDE // 2 + 6, 4), f"{words}, {said}" if not j else said, fill=(20, 20, 20), font=font)
    return row


def gif(pictures: Sequence[np.ndarray]) -> bytes:
    out = io.BytesIO()
    first, *others = [Image.fromarray(p).quantize(COLOURS, dither=Image.Dither.NONE) for p in pictures]
    first.save(out, "GIF", save_all=True, append_images=others, duration=round(1e3 * EACH * CONTROL_STEP), loop=0)
    return out.getvalue()


def main(data: tyro.conf.Positional[tuple[Path, ...]], out: Path, way: str = "shape", seed: int = 2000, trial: int = 0) -> None:
    """Film one trial of each task and write the strips."""
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    for folder in data:
        order = read_order(folder)
        name, hand = order["task"], order["seed"]
        actor = PolicyRunner(
            make_task(name), load("hand"), hand, way, make_policy(PolicyTrainingSpec("diffusion", way, 0), folder, print)
        )
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, trial)))
        pictures, outcome = filmed(actor, rng)
        (out / f"{name}.gif").write_bytes(gif(pictures))
        rows.append(strip(pictures, name))
        rows[-1].save(out / f"{name}.png")
        print(f"{name}: {outcome}; {out / name}.gif, .png", flush=True)
    whole = Image.new("RGB", (rows[0].width, sum(row.height for row in rows)))
    for k, row in enumerate(rows):
        whole.paste(row, (0, k * row.height))
    whole.quantize(COLOURS, dither=Image.Dither.NONE).save(out / "tasks.png", optimize=True)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
