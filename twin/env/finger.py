"""Bringing a soft finger to a wanted shape by its servos."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import spaces

from twin.body import Problem
from twin.effects import Drive, Loads
from twin.env.checks import Actions, chosen
from twin.env.domain import Spread, draw, read_spread
from twin.env.picture import HERE, Mark, Picture
from twin.env.soft_plant import Felt, FingerPlant
from twin.errors import DataError, SolveError
from twin.soft.statics import turned
from twin.storage import read_twin
from twin.twin import Twin

REDRAWS = 20  # of a twin or a shape that has no equilibrium
LEAST_BEND, MOST_BEND = 0.2, 0.9  # of wanted shapes, in `most`


@dataclass(frozen=True)
class Options:
    """What `gymnasium.make` takes beside the twin and `render_mode`."""

    interval: float = 0.04  # s between two actions, rounded to whole steps of the finger
    rate: float = 0.03  # m/s of a servo at an action of 1
    most: float = 0.012  # m, the most that a servo pulls a tendon in
    observe: Literal["sensors", "full"] = "sensors"
    resistance_noise: float = 0.0  # of R0, one standard deviation
    displacement_noise: float = 0.0  # m, of a servo's encoder
    randomise: bool = False  # draw each episode's twin from its own uncertainty
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # SI, drawn evenly an episode
    success: float = 2e-3  # m


class FingerShape(gymnasium.Env[np.ndarray, np.ndarray]):
    """Bring the markers of a soft finger to where they are in a wanted shape, and hold them there.

    `twin`: a twin.toml, a report's folder or a robot's name, of the family `soft`. A servo drives a pair of antagonist tendons, i
    and i + p of the 2p: it pulls the first in by as much as it pays the second out. Wanted shapes are equilibria, without friction,
    of the finger as described, servos on a disk of 0.2 to 0.9 of `most`. The finger moves by MuJoCo's steps under all effects
    (`twin.env.soft_plant` says why not by statics). L is the finger's length, m the number of its markers, the tip among them.

    Action, Box(-1, 1, (p,)):

    | index | meaning | unit | bounds |
    |---|---|---|---|
    | 0..p-1 | speed of servo i | `rate` | -1, 1 |

    Observation, Box(-inf, inf, (s + 2p + 3m,)), float32, with `observe="sensors"`:

    | index | meaning | unit |
    |---|---|---|
    | 0..s-1 | resistance of cord i, over that at no strain, minus one | 0.1 |
    | s..s+p-1 | encoder of servo i (of its first tendon) | `most` |
    | s+p..s+2p-1 | commanded place of servo i | `most` |
    | s+2p..s+2p+3m-1 | wanted x, y, z of marker 1, then of 2, ..., the tip last | L |

    With `observe="full"` there follow x, y, z of the markers (L), as no sensor has them, and the tendons' tensions (N).

    Reward: -(mean distance of the markers from where they are wanted) / (0.05 L). `info`: distance (m, that mean), success (within
    `success`). An episode is truncated after 100 steps, or, with a reward of -10 and the cause in `info["lost"]`, where the motion
    is lost.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012

    def __init__(self, twin: str | Path | Twin = "finger", render_mode: str | None = None, **options: Any) -> None:
        """Raises UnknownNameError for an option there is not, DataError for a robot that is no finger with pairs of tendons."""
        self.options, self.render_mode = chosen(Options, options, render_mode, self.metadata["render_modes"]), render_mode
        self.described = twin if isinstance(twin, Twin) else read_twin(twin)
        unsaid = isinstance(twin, Twin) or not self.options.randomise
        self._spread = Spread() if unsaid else read_spread(twin, self.described)  # type: ignore[arg-type]
        self.plant = FingerPlant(self.described, self.options.interval)
        body = self.plant.body
        if body.n_tendon % 2:
            raise DataError(f"robot {self.described.robot.name!r} has {body.n_tendon} tendons; servos need pairs of them")
        self.n, self.length = body.n_tendon // 2, body.cone.length
        self._actions, self._picture = Actions(self.n), None
        n_marker, s = len(self.plant.markers), len(body.cord_paths)
        size = s + 2 * self.n + 3 * n_marker + (3 * n_marker + body.n_tendon if self.options.observe == "full" else 0)
        self.action_space = spaces.Box(-1.0, 1.0, (self.n,), np.float32)
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Hanging at rest, a twin and a wanted shape drawn. Raises SolveError where draw after draw has no equilibrium."""
        super().reset(seed=seed)
        for attempt in range(REDRAWS):
            try:
                twin = draw(self.described, self._spread, self.options.ranges, self.np_random)
                self.plant = FingerPlant(twin, self.options.interval)
                self.wanted = self._shape(self._drawn())
                break
            except SolveError as fault:
                if attempt == REDRAWS - 1:
                    raise SolveError(f"{REDRAWS} drawn twins in a row stand nowhere, the last: {fault}; draw less widely") from None
        self.servos = np.zeros(self.n)
        return self._observed(self.plant.felt()), self._info()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Raises DataError for an action that is not one finite number a servo."""
        o = self.options
        self.servos = np.clip(self.servos + self._actions.checked(action) * o.rate * self.plant.interval, -o.most, o.most)
        try:
            felt = self.plant.step(tendons(self.servos))
        except SolveError as fault:
            return self._observed(self.plant.felt()), -10.0, False, True, {**self._info(), "lost": str(fault)}
        info = self._info()
        return self._observed(felt), -info["distance"] / (0.05 * self.length), False, False, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """(480, 640, 3) bytes with `render_mode="rgb_array"`: markers red, where they are wanted green. Raises TwinError where this
        machine cannot draw."""
        if self.render_mode is None:
            return None
        self._picture = self._picture or Picture(self.plant.spec, self.length, self.described.robot.gravity[2] > 0.0)
        turn = turned(self.plant.body.turn)  # the model stands in the finger's own frame
        marks = [Mark(at @ turn, 0.012 * self.length) for at in self.wanted]
        marks += [Mark(at @ turn, 0.012 * self.length, HERE) for at in self.plant.markers]
        return self._picture.draw(self.plant.moving.data.qpos, marks)

    def close(self) -> None:
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    def _drawn(self) -> np.ndarray:
        """(p,) m of servos, evenly from the ball between the least and the most bend."""
        towards = self.np_random.standard_normal(self.n)
        size = self.np_random.uniform(LEAST_BEND**self.n, MOST_BEND**self.n) ** (1.0 / self.n)
        return self.options.most * size * towards / np.linalg.norm(towards)

    def _shape(self, servos: np.ndarray) -> np.ndarray:
        """(m, 3) m: the markers of the finger as described at rest, without friction."""
        robot = self.described.robot
        command = np.linspace(0.0, 1.0, 7)[:, None] * tendons(servos)
        drives = (Drive.DISPLACEMENT,) * command.shape[1]
        solver = robot.solver(robot.build(self.described.values))
        path = solver.solve(Problem(np.arange(7.0), command, Loads(robot.gravity), drives=drives))
        if not path.status.all():
            raise SolveError("the described finger has no equilibrium at a wanted shape")
        return path.markers[-1]

    def _observed(self, felt: Felt) -> np.ndarray:
        o, rng = self.options, self.np_random
        resistance = felt.resistance - 1.0 + o.resistance_noise * rng.standard_normal(len(felt.resistance))
        encoder = felt.displacement[: self.n] + o.displacement_noise * rng.standard_normal(self.n)
        parts = [resistance / 0.1, encoder / o.most, self.servos / o.most, self.wanted.ravel() / self.length]
        if o.observe == "full":
            parts += [felt.markers.ravel() / self.length, felt.tension]
        return np.concatenate(parts).astype(np.float32)

    def _info(self) -> dict[str, Any]:
        distance = float(np.linalg.norm(self.plant.markers - self.wanted, axis=1).mean())
        return {"distance": distance, "success": distance < self.options.success}


def tendons(servos: np.ndarray) -> np.ndarray:
    """(..., 2p) m, what servos (..., p) m do to their tendons."""
    return np.concatenate([servos, -servos], axis=-1)
