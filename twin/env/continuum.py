"""Reaching and tracking with the tip of a backbone pulled by tendons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

import gymnasium
import numpy as np
from gymnasium import spaces

from twin.body import Problem
from twin.dynamics import Moving
from twin.effects import Loads
from twin.env.checks import Actions, chosen
from twin.env.domain import Spread, draw, read_spread
from twin.env.picture import Picture
from twin.env.plant import Plant, Sensed
from twin.errors import DataError, SolveError, UnknownNameError
from twin.rollout import full_pull
from twin.storage import read_twin
from twin.twin import Twin

REDRAWS = 20  # of a twin or a goal that has no equilibrium
LEAST_BEND, MOST_BEND = 0.2, 1.2  # of goals, in full pulls
LAP = 80  # steps of a tracked path
SENSORS = ("load_cells", "encoders", "tip")


@dataclass(frozen=True)
class Options:
    """What `gymnasium.make` takes beside the twin and `render_mode`."""

    interval: float = 0.05  # s between two actions
    dynamic: bool = True  # by MuJoCo's steps; else at rest at each interval's end, for a robot moved slowly
    rate: float = 1.0  # full pulls a second that an action of 1 adds
    most: float = 1.5  # full pulls: the largest tension
    observe: Literal["sensors", "full"] = "sensors"
    sensors: tuple[str, ...] = SENSORS  # those that the robot has
    tension_noise: float = 0.0  # N, one standard deviation of a load cell
    displacement_noise: float = 0.0  # m, of an encoder
    tip_noise: float = 0.0  # m, of the camera
    payload: tuple[float, float] = (0.0, 0.0)  # kg at the tip, drawn evenly an episode
    randomise: bool = False  # draw each episode's twin from its own uncertainty
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # SI, drawn evenly an episode
    success: float = 3e-3  # m


class ContinuumReach(gymnasium.Env[np.ndarray, np.ndarray]):
    """Bring the tip of a tendon-driven backbone to a goal and hold it there.

    `twin`: a twin.toml, a report's folder or a robot's name; effects act as in its predictions, with lag, drift and hysteresis of
    an episode's own history. n tendons; one full pull F bends the robot by some one radian (`twin.rollout.full_pull`);
    L is the height of the straight robot's tip.

    Action, Box(-1, 1, (n,)):

    | index | meaning | unit | bounds |
    |---|---|---|---|
    | 0..n-1 | rate of the commanded tension of tendon i, as its load cell reads it | `rate` F/s | -1, 1 |

    Observation, Box(-inf, inf, (3n + 6,)), float32, with `observe="sensors"`:

    | index | meaning | unit |
    |---|---|---|
    | 0..n-1 | load cell of tendon i | F |
    | n..2n-1 | encoder of tendon i, pulled in | travel at F |
    | 2n..3n-1 | commanded tension of tendon i | F |
    | 3n..3n+2 | tip x, y, z by camera | L |
    | 3n+3..3n+5 | goal x, y, z | L |

    With `observe="full"` there follow nv joint angles (rad) and nv joint speeds (10 rad/s). Of a robot without encoders or without
    a camera (`sensors=("load_cells", "tip")`, say) those rows are left out.

    `parts` names them: load_cells, encoders, commands, tip, goal, angles, speeds.

    Reward: -|tip - goal| / (0.1 L), of the true tip. `info`: distance (m), success (within `success`), tip, goal. An episode is
    truncated after 100 steps; it ends early, with a reward of -10 and the reason in `info["lost"]`, where the motion is lost.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(self, twin: str | Path | Twin = "continuum", render_mode: str | None = None, **options: Any) -> None:
        """Raises UnknownNameError for an option or a sensor there is not, DataError for a robot without dynamics and for joint
        speeds of one that is at rest."""
        self.options, self.render_mode = chosen(Options, options, render_mode, self.metadata["render_modes"]), render_mode
        for name in self.options.sensors:
            if name not in SENSORS:
                raise UnknownNameError("sensor", name, SENSORS)
        if self.options.observe == "full" and not self.options.dynamic:
            raise DataError('observe="full" shows joint speeds, which a robot at rest has not: leave out observe or dynamic=False')
        self.described = twin if isinstance(twin, Twin) else read_twin(twin)
        unsaid = isinstance(twin, Twin) or not self.options.randomise
        self._spread = Spread() if unsaid else read_spread(twin, self.described)  # type: ignore[arg-type]
        self.pull = full_pull(self.described)
        self.plant = Plant(self.described, self.options.interval)
        self._start = self.plant.sensed()
        self.length, self.n = float(self._start.tip[2]), self.described.robot.n_tendon
        self._actions, self._picture = Actions(self.n), None
        nv = len(self.plant.q) if self.options.observe == "full" else 0
        self.parts = {"load_cells": self.n, "encoders": self.n, "commands": self.n, "tip": 3, "goal": 3}
        self.parts |= {"angles": nv, "speeds": nv} if nv else {}
        self.parts = {name: size for name, size in self.parts.items() if self._has(name)}
        size = sum(self.parts.values())
        self.action_space = spaces.Box(-1.0, 1.0, (self.n,), np.float32)
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Slack and at rest, a twin, a payload and a goal drawn. Raises SolveError where draw after draw has no equilibrium."""
        super().reset(seed=seed)
        for attempt in range(REDRAWS):
            try:
                self.plant = self._drawn()
                self._path = self._goals()
                break
            except SolveError as fault:
                if attempt == REDRAWS - 1:
                    raise SolveError(f"{REDRAWS} drawn twins in a row stand nowhere, the last: {fault}; draw less widely") from None
        self.command, self._step = np.zeros(self.n), 0
        seen = self.plant.sensed()
        return self._observed(seen), self._info(seen)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Raises DataError for an action that is not n numbers."""
        rate, o = self._actions.checked(action), self.options
        most = o.most * self.pull.tension
        self.command = np.clip(self.command + rate * o.rate * self.pull.tension * o.interval, 0.0, most)
        self._step += 1
        try:
            seen = self.plant.step(self.command)
        except SolveError as fault:
            seen = self.plant.sensed()
            return self._observed(seen), -10.0, True, False, {**self._info(seen), "lost": str(fault)}
        info = self._info(seen)
        return self._observed(seen), -info["distance"] / (0.1 * self.length), False, False, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """(480, 640, 3) bytes with `render_mode="rgb_array"`. Raises TwinError where this machine cannot draw."""
        if self.render_mode is None:
            return None
        self._picture = self._picture or Picture(self.plant.body, self.length)
        return self._picture.draw(self.plant.q, self.goal)

    def close(self) -> None:
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    @property
    def goal(self) -> np.ndarray:
        """(3,) m, where the tip should be now."""
        return self._path[min(self._step, len(self._path) - 1)]

    def _drawn(self) -> Plant:
        """An episode's robot, at rest. Raises SolveError where it stands nowhere."""
        o, rng = self.options, self.np_random
        twin = draw(self.described, self._spread, o.ranges, rng)
        return Plant(twin, o.interval, float(rng.uniform(*o.payload)), o.dynamic)

    def _goals(self) -> np.ndarray:
        """(1, 3) m: where the described robot's tip rests under drawn pulls."""
        bend = np.sqrt(self.np_random.uniform(LEAST_BEND**2, MOST_BEND**2))
        return self._tips(np.array([bend]), self.np_random.uniform(0.0, 2.0 * np.pi, 1))

    def _tips(self, bend: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """(m, 3) m: the tip at rest of the described robot, without friction, bent (m,) full pulls towards angles (m,) rad."""
        robot = self.described.robot
        pulls = (bend[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])) @ self.pull.towards.T
        solver = robot.solver(robot.build(self.described.values))
        tension = np.vstack([np.zeros(self.n), np.maximum(pulls, 0.0) * self.pull.tension])
        path = solver.solve(Problem(np.arange(float(len(tension))), tension, Loads(robot.gravity)))
        if not path.status.all():
            raise SolveError("the described robot has no equilibrium under a goal's tensions")
        return path.markers[1:, -1]

    def _observed(self, seen: Sensed) -> np.ndarray:
        return np.concatenate(list(self._shown(seen).values())).astype(np.float32)

    def _shown(self, seen: Sensed) -> dict[str, np.ndarray]:
        """The observation by the names of its parts."""
        o, F, rng = self.options, self.pull, self.np_random
        tension = seen.tension + o.tension_noise * rng.standard_normal(self.n)
        travel = seen.displacement + o.displacement_noise * rng.standard_normal(self.n)
        tip = seen.markers[-1] + o.tip_noise * rng.standard_normal(3)
        shown = {
            "load_cells": tension / F.tension, "encoders": travel / F.displacement, "commands": self.command / F.tension,
            "tip": tip / self.length, "goal": self.goal / self.length,
        }  # fmt: skip
        if o.observe == "full":
            data = cast(Moving, self.plant.moving).data
            shown |= {"angles": data.qpos, "speeds": data.qvel / 10.0}
        return {name: part for name, part in shown.items() if self._has(name)}

    def _has(self, part: str) -> bool:
        return part not in SENSORS or part in self.options.sensors

    def _info(self, seen: Sensed) -> dict[str, Any]:
        distance = float(np.linalg.norm(seen.tip - self.goal))
        return {"distance": distance, "success": distance < self.options.success, "tip": seen.tip.copy(), "goal": self.goal.copy()}


class ContinuumTrack(ContinuumReach):
    """Follow a goal that goes round with the tip: a bend of drawn size whose direction turns once in 80 steps, from a drawn start.

    Options, actions, observations and reward are those of `ContinuumReach`; the goal observed is that of the present step. An
    episode is truncated after 200 steps.
    """

    def _goals(self) -> np.ndarray:
        bend, start = self.np_random.uniform(LEAST_BEND, MOST_BEND), self.np_random.uniform(0.0, 2.0 * np.pi)
        lap = self._tips(np.full(LAP, bend), start + 2.0 * np.pi * np.arange(LAP) / LAP)
        return np.tile(lap, (3, 1))
