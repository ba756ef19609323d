"""Turning a thing between the three fingers of a soft hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import spaces

from twin.env.checks import Actions, chosen
from twin.env.domain import Spread, draw, read_spread
from twin.env.picture import GOAL, HERE, Mark, Picture
from twin.env.soft_plant import HandPlant
from twin.errors import SolveError
from twin.soft.scene import Sight, Thing
from twin.storage import read_twin
from twin.twin import Twin

REDRAWS = 20  # of a twin that has no equilibrium
THING = "block"
TABLE = Thing("table", "box", (0.1, 0.1, 0.005), 1.0, (0.0, 0.0, 0.122), fixed=True)
TOP = 0.117  # m, of the table: the block lies on it


@dataclass(frozen=True)
class Options:
    """What `gymnasium.make` takes beside the twin and `render_mode`."""

    interval: float = 0.05  # s between two actions, rounded to whole steps of the hand
    rate: float = 0.04  # m/s of a servo at an action of 1
    most: float = 0.012  # m, the most that a servo pulls a tendon in
    observe: Literal["sensors", "full"] = "sensors"
    size: float = 0.022  # m, half the block's width across
    mass: tuple[float, float] = (0.03, 0.03)  # kg, drawn evenly an episode
    friction: tuple[float, float] = (1.0, 1.0)  # of skin, table and block, drawn evenly an episode
    wanted: float = 0.4  # rad, the most that the block is to be turned by, either way
    resistance_noise: float = 0.0  # of R0, one standard deviation
    angle_noise: float = 0.0  # rad, of the camera
    randomise: bool = False  # draw each episode's twin from its own uncertainty
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # SI, drawn evenly an episode
    success: float = 0.05  # rad


class HandReorient(gymnasium.Env[np.ndarray, np.ndarray]):
    """Turn a block about the vertical to a wanted angle, with three silicone fingers that hang over it.

    `twin`: a twin.toml, a report's folder or a robot's name, of the family `hand`. The block, 2 `size` wide and 50 mm high, lies
    on a table between the fingertips; each of the f fingers has p servos, each of which pulls a tendon in by as much as it pays its
    antagonist out. Effects on the body and along the tendons act; effects on sensors, drives and creep are refused here.

    Action, Box(-1, 1, (f p,)):

    | index | meaning | unit | bounds |
    |---|---|---|---|
    | k p + i | speed of servo i of finger k; with p = 2, i = 0 bends it towards the palm's axis, i = 1 across | `rate` | -1, 1 |

    Observation, Box(-inf, inf, (f s + f p + 4,)), float32, with `observe="sensors"`:

    | index | meaning | unit |
    |---|---|---|
    | 0..fs-1 | resistance of each cord, finger by finger, over that at no strain, minus one | 0.1 |
    | fs..fs+fp-1 | place of each servo | `most` |
    | fs+fp, +1 | sine and cosine of the block's angle about the vertical, by camera | 1 |
    | fs+fp+2, +3 | sine and cosine of the wanted angle | 1 |

    With `observe="full"` there follow the block's place from where it began (3, 0.05 m), its turn (4, quaternion), its
    velocity and angular velocity (6, m/s and rad/s), and the tendons' tensions (N).

    Reward: -|angle - wanted| (rad, the short way round), less the block's way from where it began (0.05 m). `info`: angle, wanted,
    error (rad), success (within `success`), touching (points of the hand in contact). An episode is truncated after 60 steps, three
    seconds at some 0.4 times real time; and, with a reward of -10 and the cause in `info["lost"]`, where a state is not finite or
    the block out of the fingers' reach.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(self, twin: str | Path | Twin = "hand", render_mode: str | None = None, **options: Any) -> None:
        """Raises UnknownNameError for an option there is not, DataError for a robot that is no hand."""
        self.options, self.render_mode = chosen(Options, options, render_mode, self.metadata["render_modes"]), render_mode
        self.described = twin if isinstance(twin, Twin) else read_twin(twin)
        unsaid = isinstance(twin, Twin) or not self.options.randomise
        self._spread = Spread() if unsaid else read_spread(twin, self.described)  # type: ignore[arg-type]
        self._drawn, self.plant = self._seen_of(self.described, self.options.mass[0], self.options.friction[0])
        sight = self.plant.scene.see()
        self.n, n_sensor = sight.servos.size, sight.resistance.size
        self._actions, self._picture = Actions(self.n), None
        size = n_sensor + self.n + 4 + (13 + sight.tension.size if self.options.observe == "full" else 0)
        self.action_space = spaces.Box(-1.0, 1.0, (self.n,), np.float32)
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """At rest, servos at zero; a twin, a block and a wanted angle drawn. Raises SolveError where draw after draw has no
        equilibrium."""
        super().reset(seed=seed)
        o, rng = self.options, self.np_random
        for attempt in range(REDRAWS):
            twin = draw(self.described, self._spread, o.ranges, rng)
            mass, friction = float(rng.uniform(*o.mass)), float(rng.uniform(*o.friction))
            try:
                if self._drawn != (twin.values, twin.effects, mass, friction):
                    self._drawn, self.plant = self._seen_of(twin, mass, friction)
                self._sight = self.plant.scene.reset()
                break
            except SolveError as fault:
                if attempt == REDRAWS - 1:
                    raise SolveError(f"{REDRAWS} drawn twins in a row stand nowhere, the last: {fault}; draw less widely") from None
        self.wanted = float(rng.uniform(-o.wanted, o.wanted))
        self.servos = np.zeros(self.n)
        return self._observed(), self._info()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Raises DataError for an action that is not one finite number a servo."""
        o = self.options
        self.servos = np.clip(self.servos + self._actions.checked(action) * o.rate * self.plant.interval, -o.most, o.most)
        try:
            self._sight = self.plant.step(self.servos.reshape(self._sight.servos.shape))
        except SolveError as fault:
            return self._observed(), -10.0, False, True, {**self._info(), "lost": str(fault)}
        info, aside = self._info(), self._aside()
        if np.linalg.norm(aside) > 1.0:
            return self._observed(), -10.0, False, True, {**info, "lost": "the block is out of the fingers' reach"}
        return self._observed(), -info["error"] - float(np.linalg.norm(aside)), False, False, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """(480, 640, 3) bytes with `render_mode="rgb_array"`: a red arrow where the block points to, a green one where it should.
        Raises TwinError where this machine cannot draw."""
        if self.render_mode is None:
            return None
        scene, place = self.plant.scene, self._sight.place[0]
        self._picture = self._picture or Picture(scene.spec, TABLE.place[2], self.described.robot.gravity[2] > 0.0)
        above, reach = place - [0.0, 0.0, 0.03], 1.6 * self.options.size
        marks = [
            Mark(above, 1e-3, colour, above + reach * np.array([np.cos(angle), np.sin(angle), 0.0]))
            for angle, colour in ((yaw(self._sight), HERE), (self.wanted, GOAL))
        ]
        return self._picture.draw(scene.data.qpos, marks)

    def close(self) -> None:
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    def _seen_of(self, twin: Twin, mass: float, friction: float) -> tuple[tuple[Any, ...], HandPlant]:
        """A hand over its block, and what it was made of."""
        half = 0.025
        block = Thing(THING, "box", (self.options.size, self.options.size, half), mass, (0.0, 0.0, TOP - half), friction=friction)
        return (twin.values, twin.effects, mass, friction), HandPlant(twin, [block, TABLE], self.options.interval)

    def _aside(self) -> np.ndarray:
        """(3,) the block's place from where it began, in 0.05 m."""
        return (self._sight.place[0] - [0.0, 0.0, TOP - 0.025]) / 0.05

    def _observed(self) -> np.ndarray:
        o, rng, sight = self.options, self.np_random, self._sight
        resistance = (sight.resistance / self.plant.rest - 1.0).ravel()
        resistance = resistance + o.resistance_noise * rng.standard_normal(resistance.size)
        angle = yaw(sight) + o.angle_noise * rng.standard_normal()
        turned = [np.sin(angle), np.cos(angle), np.sin(self.wanted), np.cos(self.wanted)]
        parts = [resistance / 0.1, self.servos / o.most, turned]
        if o.observe == "full":
            parts += [self._aside(), sight.turn[0], sight.velocity[0], sight.tension.ravel()]
        return np.concatenate(parts).astype(np.float32)

    def _info(self) -> dict[str, Any]:
        angle = yaw(self._sight)
        error = abs((angle - self.wanted + np.pi) % (2.0 * np.pi) - np.pi)
        return {
            "angle": angle, "wanted": self.wanted, "error": error, "success": error < self.options.success,
            "touching": self._sight.touching,
        }  # fmt: skip


def yaw(sight: Sight) -> float:
    """The first thing's angle (rad) about the vertical."""
    w, x, y, z = sight.turn[0]
    return float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
