"""Turning a thing between the three fingers of a soft hand."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gymnasium import spaces

from twin.env.episodes.base import TwinEnv, refuse_before_reset
from twin.env.episodes.observation import (
    PLACE_RANGE,
    RESISTANCE_RANGE,
    SPEED_RANGE,
    TENSION_RANGE,
    ObservationLayout,
    PartBounds,
)
from twin.env.episodes.rendering import GOAL_COLOUR, PRESENT_COLOUR, FrameRenderer, Mark
from twin.env.episodes.validation import ActionBounds, parse_goal
from twin.env.plants.soft_plant import HandPlant
from twin.foundation.errors import DataError, SolveError
from twin.mechanics.silicone.motion.scene import SceneState, Thing
from twin.prediction.twin import Twin

BLOCK_NAME = "block"
BLOCK_TABLE = Thing("table", "box", (0.1, 0.1, 0.005), 1.0, (0.0, 0.0, 0.122), fixed=True)
BLOCK_HEIGHT = 0.05  # m
BLOCK_TABLE_TOP = 0.117  # m, of the table: the block lies on it


@dataclass(frozen=True)
class HandOptions:
    """Options of `gymnasium.make` beside the twin and `render_mode`."""

    interval: float = 0.05  # s between two actions, rounded to whole steps of the hand
    rate: float = 0.04  # m/s of a servo at an action of 1
    most: float = 0.012  # m, the most that a servo pulls a tendon in
    observe: Literal["sensors", "full"] = "sensors"
    size: float = 0.022  # m, half the block's width across
    mass: tuple[float, float] = (0.03, 0.03)  # kg, drawn uniformly for each episode
    friction: tuple[float, float] = (1.0, 1.0)  # of skin, table and block, drawn uniformly for each episode
    wanted: float = 0.4  # rad, the largest angle to turn the block by, either way
    resistance_noise: float = 0.0  # of R0, one standard deviation
    angle_noise: float = 0.0  # rad, of the camera
    randomise: bool = False  # draw each episode's twin from its uncertainty
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # SI, drawn uniformly for each episode
    success: float = 0.05  # rad, of the block from the wanted angle


class HandReorient(TwinEnv):
    """Turn a block about the vertical to a wanted angle, with three silicone fingers that hang over it.

    `twin`: a twin.toml, a report's folder or a robot's name, of the family `hand`. The block, 2 `size` wide and 50 mm high, lies
    on a table between the fingertips; each of the f fingers has p servos, each of which pulls a tendon in by as much as it pays its
    antagonist out, and s cords. Effects on the body and along the tendons act; effects on sensors, drives and creep are refused.

    Action, Box(-1, 1, (f p,)):

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..fp-1 | speed of servo i of finger k at k p + i; i = 0 bends towards the palm's axis, i = 1 across | -1 | 1 | `rate` |

    Observation, Box, (f s + f p + 4,), float32, with `observe="sensors"`; readings saturate at their bounds:

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..fs-1 | resistance of each cord, finger by finger, over that at no strain, minus one | -10 | 10 | 0.1 |
    | fs..fs+fp-1 | place of each servo | -1 | 1 | `most` |
    | fs+fp..fs+fp+1 | sine and cosine of the block's angle about the vertical, by camera | -1 | 1 | 1 |
    | fs+fp+2..fs+fp+3 | sine and cosine of the wanted angle | -1 | 1 | 1 |

    With `observe="full"` there follow the block's place from its start (3, 0.05 m, within 2), its turn (4, quaternion), its
    velocity and angular velocity (6, m/s and rad/s, within 100), and the tendons' tensions (N, within 100).

    `reset(options={"goal": angle})`, rad, chooses the wanted angle, at most the option `wanted` either way.

    Reward: -|angle - wanted| (rad, the short way round), less the block's distance from its start (0.05 m). `info`: angle, wanted,
    error (rad), is_success (within `success`), touching (points of the hand in contact). An episode is truncated after 60 steps,
    3 s, at some 0.4 times real time; and, with a reward of -10 and the cause in `info["lost"]`, where a state is not finite or
    the block out of the fingers' reach.
    """

    options_type = HandOptions

    def __init__(self, twin: str | Path | Twin = "hand", render_mode: str | None = None, **options: Any) -> None:
        """Raises UnknownNameError for an unknown option, DataError for a robot that is no hand."""
        super().__init__(twin, render_mode, options)
        self._drawn = (self.described, self.options.mass[0], self.options.friction[0])
        self.plant = self._build_plant()
        state = self.plant.state
        self.n, n_sensor = state.servos.size, state.resistance.size
        self._actions = ActionBounds(self.n)
        shown = self.options.observe == "full"
        self.layout = ObservationLayout({
            "resistance": PartBounds.within(n_sensor, RESISTANCE_RANGE), "servos": PartBounds.within(self.n, 1.0),
            "angle": PartBounds.within(2, 1.0), "wanted": PartBounds.within(2, 1.0),
            "place": PartBounds.within(3 * shown, PLACE_RANGE), "turn": PartBounds.within(4 * shown, 1.0),
            "velocity": PartBounds.within(6 * shown, SPEED_RANGE),
            "tension": PartBounds.within(state.tension.size * shown, TENSION_RANGE),
        })  # fmt: skip
        self.action_space = spaces.Box(-1.0, 1.0, (self.n,), np.float32)
        self.observation_space = self.layout.box(self.layout.parts)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Step one interval on. Raises DataError for an action that is not one finite number a servo."""
        o = self.options
        self.servos = np.clip(self.servos + self._actions.clip(action) * o.rate * self.plant.interval, -o.most, o.most)
        try:
            self.plant.step(self.servos.reshape(self.plant.state.servos.shape))
        except SolveError as fault:
            return self._observation(), -10.0, False, True, {**self._info(), "lost": str(fault)}
        info = self._info()
        if np.linalg.norm(self._block_offset()) > 1.0:
            return self._observation(), -10.0, False, True, {**info, "lost": "the block is out of the fingers' reach"}
        return self._observation(), float(self._goal_reward(self._achieved(), self._desired())), False, False, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return (480, 640, 3) bytes with `render_mode="rgb_array"`: a red arrow along the block, a green one where it should.

        Raises TwinError where this machine cannot draw.
        """
        if self.render_mode is None:
            return None
        scene, place = self.plant.scene, self.plant.state.place[0]
        self._renderer = self._renderer or FrameRenderer(scene.spec, BLOCK_TABLE.place[2], self.described.robot.gravity[2] > 0.0)
        above, reach = place - [0.0, 0.0, 0.03], 1.6 * self.options.size
        marks = [
            Mark(above, 1e-3, colour, above + reach * np.array([np.cos(angle), np.sin(angle), 0.0]))
            for angle, colour in ((block_yaw(self.plant.state), PRESENT_COLOUR), (self.wanted, GOAL_COLOUR))
        ]
        return self._renderer.draw(scene.data.qpos, marks)

    def _build_plant(self) -> HandPlant:
        twin, mass, friction = self._drawn
        size, half = self.options.size, 0.5 * BLOCK_HEIGHT
        block = Thing(BLOCK_NAME, "box", (size, size, half), mass, (0.0, 0.0, BLOCK_TABLE_TOP - half), friction=friction)
        return HandPlant(twin, [block, BLOCK_TABLE], self.options.interval)

    def _draw_episode(self) -> None:
        rng, before = self.np_random, self._drawn
        twin = self._draw_twin()
        self._drawn = (twin, float(rng.uniform(*self.options.mass)), float(rng.uniform(*self.options.friction)))
        if (before[0].values, before[0].effects, *before[1:]) != (twin.values, twin.effects, *self._drawn[1:]):
            self.plant = self._build_plant()
        self.plant.reset()
        self.wanted = float(rng.uniform(-self.options.wanted, self.options.wanted))
        self.servos = np.zeros(self.n)

    def _episode_arrays(self) -> dict[str, np.ndarray]:
        refuse_before_reset(self, "servos")
        return {"servos": self.servos, "wanted": np.array(self.wanted)}

    def _restore_episode(self, arrays: Mapping[str, np.ndarray]) -> None:
        self.servos, self.wanted = arrays["servos"].copy(), float(arrays["wanted"])

    def _block_offset(self) -> np.ndarray:
        """Return the block's place (3,) from its start, in 0.05 m."""
        return (self.plant.state.place[0] - [0.0, 0.0, BLOCK_TABLE_TOP - 0.5 * BLOCK_HEIGHT]) / 0.05

    def _check_goal(self, given: Any) -> np.ndarray:
        goal, most = parse_goal(given, (), "an angle, rad"), self.options.wanted
        if abs(goal) > most:
            raise DataError(
                f"the goal {goal:g} rad is out of reach: at most {most:g} either way; make the environment with wanted="
            )
        return goal

    def _place_goal(self, goal: np.ndarray) -> None:
        self.wanted = float(goal)

    def _achieved(self) -> np.ndarray:
        """Return sine and cosine of the block's true angle, and its place from its start, (5,) 1 and 0.05 m."""
        angle = block_yaw(self.plant.state)
        return np.array([np.sin(angle), np.cos(angle), *self._block_offset()])

    def _desired(self) -> np.ndarray:
        """Return what `_achieved` is in the end: the wanted angle, at the start, (5,)."""
        return np.array([np.sin(self.wanted), np.cos(self.wanted), 0.0, 0.0, 0.0])

    def _goal_reward(self, achieved: np.ndarray, desired: np.ndarray) -> np.ndarray:
        """Return the reward (...) of angles and places (..., 5) with wanted ones (..., 5)."""
        angle, wanted = (np.arctan2(x[..., 0], x[..., 1]) for x in (achieved, desired))
        error = np.abs((angle - wanted + np.pi) % (2.0 * np.pi) - np.pi)
        return -error - np.linalg.norm(achieved[..., 2:] - desired[..., 2:], axis=-1)

    def _observation_parts(self) -> dict[str, np.ndarray]:
        o, rng, sight = self.options, self.np_random, self.plant.state
        resistance = (sight.resistance / self.plant.rest - 1.0).ravel()
        resistance = resistance + o.resistance_noise * rng.standard_normal(resistance.size)
        angle = block_yaw(sight) + o.angle_noise * rng.standard_normal()
        return {
            "resistance": resistance / 0.1, "servos": self.servos / o.most, "angle": np.array([np.sin(angle), np.cos(angle)]),
            "wanted": self._desired()[:2], "place": self._block_offset(), "turn": sight.turn[0], "velocity": sight.velocity[0],
            "tension": sight.tension,
        }  # fmt: skip

    def _info(self) -> dict[str, Any]:
        angle = block_yaw(self.plant.state)
        error = abs((angle - self.wanted + np.pi) % (2.0 * np.pi) - np.pi)
        return {
            "angle": angle, "wanted": self.wanted, "error": error, "is_success": error < self.options.success,
            "touching": self.plant.state.touching,
        }  # fmt: skip


def block_yaw(sight: SceneState) -> float:
    """Return the first thing's angle (rad) about the vertical."""
    w, x, y, z = sight.turn[0]
    return float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
