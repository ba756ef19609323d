"""Bringing a soft finger to a wanted shape by its servos."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from gymnasium import spaces
from scipy.optimize import least_squares

from twin.body import Drive, Loads, Problem
from twin.env.episodes.base import TwinEnv, refuse_before_reset
from twin.env.episodes.observation import (
    ENCODER_RANGE,
    PLACE_RANGE,
    RESISTANCE_RANGE,
    TENSION_RANGE,
    ObservationLayout,
    PartBounds,
)
from twin.env.episodes.rendering import PRESENT_COLOUR, FrameRenderer, Mark
from twin.env.episodes.validation import ActionBounds, parse_goal
from twin.env.plants.soft_plant import FingerPlant
from twin.foundation.errors import DataError, SolveError
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.twin import Twin

LEAST_WANTED_BEND, MOST_WANTED_BEND = 0.2, 0.9  # of wanted shapes, in `most`


@dataclass(frozen=True)
class FingerOptions:
    """Options of `gymnasium.make` beside the twin and `render_mode`."""

    interval: float = 0.04  # s between two actions, rounded to whole steps of the finger
    rate: float = 0.03  # m/s of a servo at an action of 1
    most: float = 0.012  # m, the most that a servo pulls a tendon in
    observe: Literal["sensors", "full"] = "sensors"
    resistance_noise: float = 0.0  # of R0, one standard deviation
    displacement_noise: float = 0.0  # m, of a servo's encoder
    randomise: bool = False  # draw each episode's twin from its uncertainty
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # SI, drawn uniformly for each episode
    success: float = 2e-3  # m, mean distance of the markers


class FingerShape(TwinEnv):
    """Bring the markers of a soft finger to their places in a wanted shape, and hold them there.

    `twin`: a twin.toml, a report's folder or a robot's name, of the family `soft`. A servo drives a pair of antagonist tendons, i
    and i + p of the 2p: it pulls the first in by as much as it pays the second out. Wanted shapes are equilibria, without friction,
    of the finger as described, servos on a disk of 0.2 to 0.9 of `most`. The finger moves by MuJoCo's steps under all effects
    (`twin.env.plants.soft_plant` says why not by statics). L is the finger's length, m the number of its markers with the tip.

    Action, Box(-1, 1, (p,)):

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..p-1 | speed of servo i | -1 | 1 | `rate` |

    Observation, Box, (s + 2p + 3m,), float32, with `observe="sensors"`; readings saturate at their bounds:

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..s-1 | resistance of cord i, over that at no strain, minus one | -10 | 10 | 0.1 |
    | s..s+p-1 | encoder of servo i (of its first tendon) | -2 | 2 | `most` |
    | s+p..s+2p-1 | command of servo i | -1 | 1 | `most` |
    | s+2p..s+2p+3m-1 | wanted x, y, z of marker 1, then of 2, ..., the tip last | -2 | 2 | L |

    With `observe="full"` there follow x, y, z of the markers (L, within 2), which no sensor measures, and the tendons' tensions (N,
    within 100).

    `reset(options={"goal": places})`, (m, 3) m, chooses the wanted shape; its markers must lie, in the mean, within `success` of an
    equilibrium under servos of at most `most`.

    Reward: -(mean distance of the markers from their wanted places) / (0.05 L). `info`: distance (m, that mean), is_success (within
    `success`). An episode is truncated after 100 steps, or, with a reward of -10 and the cause in `info["lost"]`, where the motion
    is lost.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 25}
    options_type = FingerOptions

    def __init__(self, twin: str | Path | Twin = "finger", render_mode: str | None = None, **options: Any) -> None:
        """Raises UnknownNameError for an unknown option, DataError for a robot that is no finger with pairs of tendons."""
        super().__init__(twin, render_mode, options)
        self.plant = self._build_plant()
        body = self.plant.body
        if body.n_tendon % 2:
            raise DataError(f"robot {self.described.robot.name!r} has {body.n_tendon} tendons; servos need pairs of them")
        self.n, self.length = body.n_tendon // 2, body.cone.length
        self._actions = ActionBounds(self.n)
        n_marker, s = len(self.plant.markers), len(body.cord_paths)
        shown = self.options.observe == "full"
        self.layout = ObservationLayout({
            "resistance": PartBounds.within(s, RESISTANCE_RANGE), "encoders": PartBounds.within(self.n, ENCODER_RANGE),
            "commands": PartBounds.within(self.n, 1.0), "wanted": PartBounds.within(3 * n_marker, PLACE_RANGE),
            "markers": PartBounds.within(3 * n_marker * shown, PLACE_RANGE),
            "tension": PartBounds.within(body.n_tendon * shown, TENSION_RANGE),
        })  # fmt: skip
        self.action_space = spaces.Box(-1.0, 1.0, (self.n,), np.float32)
        self.observation_space = self.layout.box(self.layout.parts)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Step one interval on. Raises DataError for an action that is not one finite number a servo."""
        o = self.options
        self.servos = np.clip(self.servos + self._actions.clip(action) * o.rate * self.plant.interval, -o.most, o.most)
        try:
            self.plant.step(tendon_displacements(self.servos))
        except SolveError as fault:
            return self._observation(), -10.0, False, True, {**self._info(), "lost": str(fault)}
        reward = float(self._goal_reward(self._achieved(), self._desired()))
        return self._observation(), reward, False, False, self._info()

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return (480, 640, 3) bytes with `render_mode="rgb_array"`: markers red, their wanted places green.

        Raises TwinError where this machine cannot draw.
        """
        if self.render_mode is None:
            return None
        self._renderer = self._renderer or FrameRenderer(self.plant.spec, self.length, self.described.robot.gravity[2] > 0.0)
        turn = rotation_about_z(self.plant.body.turn)  # the model stands in the finger's own frame
        marks = [Mark(at @ turn, 0.012 * self.length) for at in self.wanted]
        marks += [Mark(at @ turn, 0.012 * self.length, PRESENT_COLOUR) for at in self.plant.markers]
        return self._renderer.draw(self.plant.motion.data.qpos, marks)

    def _build_plant(self) -> FingerPlant:
        return FingerPlant(self._drawn[0], self.options.interval)

    def _draw_episode(self) -> None:
        self._drawn = (self._draw_twin(),)
        self.plant = self._build_plant()
        self.wanted = self._rest_markers(self._draw_servos())
        self.servos = np.zeros(self.n)

    def _episode_arrays(self) -> dict[str, np.ndarray]:
        refuse_before_reset(self, "servos")
        return {"servos": self.servos, "wanted": self.wanted}

    def _restore_episode(self, arrays: Mapping[str, np.ndarray]) -> None:
        self.servos, self.wanted = arrays["servos"].copy(), arrays["wanted"].copy()

    def _draw_servos(self) -> np.ndarray:
        """Draw servos (p,) m, uniformly from the ball between the least and the most bend."""
        towards = self.np_random.standard_normal(self.n)
        size = self.np_random.uniform(LEAST_WANTED_BEND**self.n, MOST_WANTED_BEND**self.n) ** (1.0 / self.n)
        return self.options.most * size * towards / np.linalg.norm(towards)

    def _rest_markers(self, servos: np.ndarray) -> np.ndarray:
        """Return the markers (m, 3) m of the finger as described at rest, without friction."""
        robot = self.described.robot
        command = np.linspace(0.0, 1.0, 7)[:, None] * tendon_displacements(servos)
        drives = (Drive.DISPLACEMENT,) * command.shape[1]
        solver = robot.solver(robot.build(self.described.values))
        path = solver.solve(Problem(np.arange(7.0), command, Loads(robot.gravity), drives=drives))
        if not path.status.all():
            raise SolveError("the described finger has no equilibrium at a wanted shape")
        return path.markers[-1]

    def _check_goal(self, given: Any) -> np.ndarray:
        words = f"places ({len(self.plant.markers)}, 3) of the markers, the tip last, m"
        goal, allowed = parse_goal(given, self.plant.markers.shape, words), self.options.success
        servos = self._nearest_servos(goal)
        off = float(np.linalg.norm(self._rest_markers(servos) - goal, axis=1).mean())
        if off > allowed:
            raise DataError(
                f"the goal is out of reach: the nearest shape, of servos at {', '.join(f'{1e3 * x:.2f}' for x in servos)} mm, is "
                f"{1e3 * off:.1f} mm away in the mean and {1e3 * allowed:g} mm (`success`) are allowed; give such a shape, or a "
                "larger `most`"
            )
        return goal

    def _place_goal(self, goal: np.ndarray) -> None:
        self.wanted = goal

    def _nearest_servos(self, wanted: np.ndarray) -> np.ndarray:
        """Return the servos (p,) m, within `most`, whose shape at rest comes nearest to wanted markers (m, 3) m."""
        most = self.options.most
        found = least_squares(
            lambda share: (self._rest_markers(most * share) - wanted).ravel() / most, np.zeros(self.n), diff_step=1e-2,
            bounds=(-1.0, 1.0), xtol=1e-3, ftol=1e-4,
        )  # fmt: skip
        return most * found.x

    def _achieved(self) -> np.ndarray:
        """Return the true markers (3m,) L."""
        return self.plant.markers.ravel() / self.length

    def _desired(self) -> np.ndarray:
        """Return the wanted markers (3m,) L."""
        return self.wanted.ravel() / self.length

    def _goal_reward(self, achieved: np.ndarray, desired: np.ndarray) -> np.ndarray:
        """Return the reward (...) of markers (..., 3m) L with wanted ones (..., 3m) L."""
        apart = (achieved - desired).reshape(*np.shape(achieved)[:-1], -1, 3)
        return -np.linalg.norm(apart, axis=-1).mean(axis=-1) / 0.05

    def _observation_parts(self) -> dict[str, np.ndarray]:
        o, rng, readings = self.options, self.np_random, self.plant.readings()
        resistance = readings.resistance - 1.0 + o.resistance_noise * rng.standard_normal(len(readings.resistance))
        encoder = readings.displacement[: self.n] + o.displacement_noise * rng.standard_normal(self.n)
        return {
            "resistance": resistance / 0.1, "encoders": encoder / o.most, "commands": self.servos / o.most,
            "wanted": self._desired(), "markers": self._achieved(), "tension": readings.tension,
        }  # fmt: skip

    def _info(self) -> dict[str, Any]:
        distance = float(np.linalg.norm(self.plant.markers - self.wanted, axis=1).mean())
        return {"distance": distance, "is_success": distance < self.options.success}


def tendon_displacements(servos: np.ndarray) -> np.ndarray:
    """Return the displacements (..., 2p) m of the tendons that servos (..., p) m drive."""
    return np.concatenate([servos, -servos], axis=-1)
