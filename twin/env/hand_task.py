"""The hand's tasks, in which any policy can be scored."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from gymnasium import spaces

from twin.env.episodes.base import TwinEnv, refuse_before_reset
from twin.env.episodes.observation import (
    ENCODER_RANGE,
    PLACE_RANGE,
    RESISTANCE_RANGE,
    SPEED_RANGE,
    TENSION_RANGE,
    ObservationLayout,
    PartBounds,
)
from twin.env.episodes.rendering import FrameRenderer
from twin.env.episodes.validation import ActionBounds
from twin.env.plants.task_plant import TaskPlant
from twin.prediction.twin import Twin
from twin.tasks import TABLE_NAME, Outcome, make_task


@dataclass(frozen=True)
class HandTaskOptions:
    """Options of `gymnasium.make` beside the twin and `render_mode`."""

    interval: float = 0.04  # s between two actions, rounded to whole steps of 0.02 s
    rate: float = 0.05  # m/s of a tendon at an action of 1
    most: float = 0.012  # m, the most that a tendon is shortened
    slack: float = 0.015  # m, the most that it is paid out: then it holds nothing
    observe: Literal["sensors", "full"] = "sensors"
    resistance_noise: float = 0.0  # of R0, one standard deviation
    displacement_noise: float = 0.0  # m, of an encoder
    randomise: bool = False  # draw each episode's twin from its uncertainty
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # SI, drawn uniformly for each episode


class HandTask(TwinEnv):
    """Do one of the tasks of `twin.tasks` with the tendons of a three-fingered silicone hand.

    `task`: hold, turn, pick, unscrew, insert or pour; the registered names say it. `twin`: a twin.toml, a report's folder or a
    robot's name, of the family `hand`. Things are drawn for each episode as `twin imitate` draws them, and success is judged as
    there. f fingers have t tendons, each with its own motor, and s cords each. Effects on the body and along the tendons act;
    effects on sensors, drives and creep are refused.

    Action, Box(-1, 1, (f t,)):

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..ft-1 | speed at which tendon i of finger k, at k t + i, is shortened | -1 | 1 | `rate` |

    Observation, Box, (f s + f t + 1,), float32, with `observe="sensors"`; readings saturate at their bounds:

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..fs-1 | resistance of each cord, finger by finger, over that at no strain, minus one | -10 | 10 | 0.1 |
    | fs..fs+ft-1 | encoder of each tendon, shortened | -2 | 2 | `most` |
    | fs+ft | elapsed share of the task's time | 0 | 1 | 1 |

    With `observe="full"` there follow the object's place from its start (3, 0.1 m, within 2), its turn (4, quaternion), its
    velocity and angular velocity (6, m/s and rad/s, within 100), and the tendons' tensions (N, within 100).

    Reward: 1 at the end where the task succeeded, else 0. `info`: is_success and outcome (at the end, before it False and
    empty), touching (points of the hand in contact). An episode ends when the task's time is up, 2.4 to 3.7 s; it ends early, with
    the cause in `info["lost"]`, where the motion is lost.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 25}
    options_type = HandTaskOptions

    def __init__(
        self, twin: str | Path | Twin = "hand", render_mode: str | None = None, task: str = "hold", **options: Any
    ) -> None:
        """Raises UnknownNameError for an unknown task or option, DataError for a robot that is no hand."""
        super().__init__(twin, render_mode, options)
        self.task = make_task(task)
        self._drawn = (self.described, 0)
        self.plant = self._build_plant()
        state, shown = self.plant.state, self.options.observe == "full"
        self.n = state.shortening.size
        self._actions = ActionBounds(self.n)
        self.layout = ObservationLayout({
            "resistance": PartBounds.within(state.resistance.size, RESISTANCE_RANGE),
            "encoders": PartBounds.within(self.n, ENCODER_RANGE), "elapsed": PartBounds(1, 0.0, 1.0),
            "place": PartBounds.within(3 * shown, PLACE_RANGE), "turn": PartBounds.within(4 * shown, 1.0),
            "velocity": PartBounds.within(6 * shown, SPEED_RANGE), "tension": PartBounds.within(self.n * shown, TENSION_RANGE),
        })  # fmt: skip
        self.action_space = spaces.Box(-1.0, 1.0, (self.n,), np.float32)
        self.observation_space = self.layout.box(self.layout.parts)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Step one interval on. Raises DataError for an action that is not one finite number a tendon."""
        o = self.options
        change = self._actions.clip(action) * o.rate * self.plant.interval
        self.shortening = np.clip(self.shortening + change, -o.slack, o.most)
        self.plant.step(self.shortening.reshape(self.plant.state.shortening.shape))
        info = self._info()
        return self._observation(), float(info["is_success"]), self.plant.trial.is_over, False, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return (480, 640, 3) bytes with `render_mode="rgb_array"`. Raises TwinError where this machine cannot draw."""
        if self.render_mode is None:
            return None
        trial = self.plant.trial
        table = next(thing for thing in trial.things if thing.name == TABLE_NAME)
        self._renderer = self._renderer or FrameRenderer(trial.scene.spec, table.place[2], self.described.robot.gravity[2] > 0.0)
        self._renderer.move(TABLE_NAME, table.place[2] + trial.table_drop)
        return self._renderer.draw(trial.scene.data.qpos, [])

    def _build_plant(self) -> TaskPlant:
        twin, seed = self._drawn
        self.close()  # other things are drawn otherwise
        return TaskPlant(twin, self.task, int(seed), self.options.interval)

    def _draw_episode(self) -> None:
        self._drawn = (self._draw_twin(), int(self.np_random.integers(2**31)))
        self.plant = self._build_plant()
        self.shortening = np.zeros(self.n)

    def _episode_arrays(self) -> dict[str, np.ndarray]:
        refuse_before_reset(self, "shortening")
        return {"shortening": self.shortening}

    def _restore_episode(self, arrays: Mapping[str, np.ndarray]) -> None:
        self.shortening = arrays["shortening"].copy()

    def _observation_parts(self) -> dict[str, np.ndarray]:
        o, rng, state, start = self.options, self.np_random, self.plant.state, self.plant.trial.start
        resistance = (state.resistance / self.plant.rest - 1.0).ravel()
        resistance = resistance + o.resistance_noise * rng.standard_normal(resistance.size)
        encoder = state.shortening.ravel() + o.displacement_noise * rng.standard_normal(self.n)
        return {
            "resistance": resistance / 0.1, "encoders": encoder / o.most,
            "elapsed": np.array([(state.time - start.time) / self.task.duration]),
            "place": (state.place[0] - start.place[0]) / 0.1, "turn": state.turn[0], "velocity": state.velocity[0],
            "tension": state.tension,
        }  # fmt: skip

    def _info(self) -> dict[str, Any]:
        trial = self.plant.trial
        outcome = str(trial.outcome()) if trial.is_over else ""
        told = {"is_success": outcome == Outcome.SUCCESS, "outcome": outcome, "touching": self.plant.state.touching}
        return told | ({"lost": trial.lost} if trial.lost else {})
