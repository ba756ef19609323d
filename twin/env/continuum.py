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
from twin.effects import Drive, Loads
from twin.env.checks import Actions, chosen
from twin.env.domain import Spread, draw, read_spread
from twin.env.picture import Mark, Picture
from twin.env.plant import Plant, Sensed
from twin.errors import DataError, SolveError, UnknownNameError
from twin.kinematics import HeatedRobot, warmest_current
from twin.rollout import full_pull
from twin.storage import read_twin
from twin.twin import Twin

REDRAWS = 20  # of a twin or a goal that has no equilibrium
MOST_BEND = 1.2  # of goals, in full pulls; of springs what they reach
SMALL = 1.0 / 6.0  # of the most, the least
LAP = 80  # steps of a tracked path
SENSORS = ("load_cells", "encoders", "tip")
INTERVAL = {Drive.TENSION: 0.05, Drive.DISPLACEMENT: 0.05, Drive.CURRENT: 0.5}  # s: springs warm and cool in tens of seconds
HEATING, WAIT = 120, 1.0  # steps of a second after which springs under a current that stays pull as they will


@dataclass(frozen=True)
class Options:
    """What `gymnasium.make` takes beside the twin and `render_mode`."""

    drive: Literal["tension", "displacement", "current"] = "tension"  # what is commanded
    interval: float | None = None  # s between two actions: 0.05, of currents 0.5
    dynamic: bool = True  # by MuJoCo's steps; else at rest at each interval's end, for a robot moved slowly
    rate: float = 1.0  # full pulls a second that an action of 1 adds
    most: float = 1.5  # full pulls: the largest tension, or bend by displacements; of currents at most 1
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
    an episode's own history. n tendons; one full pull F bends the robot by some one radian (`twin.rollout.full_pull`), in
    newtons or as the travel of a motor, with `drive="displacement"`; with `drive="current"` it is the current under which an SMA
    spring rests 45 K above its phase change (`twin.kinematics.warmest_current`). Springs start cold, pull on one side only
    and bend less: goals are then within what they reach. L is the height of the straight robot's tip.

    Action, Box(-1, 1, (n,)):

    | index | meaning | unit | bounds |
    |---|---|---|---|
    | 0..n-1 | rate of the commanded tension (as its load cell reads it), or current, of tendon i | `rate` F/s | -1, 1 |

    With `drive="displacement"`, Box(-1, 1, (2,)), since tendons wound in one by one jam: motor i takes in F times how far the bend
    points its way,

    | index | meaning | unit | bounds |
    |---|---|---|---|
    | 0, 1 | rate of the commanded bend along x, y | `rate` F/s | -1, 1 |

    Observation, Box(-inf, inf, (2n + k + 6,)), float32, of k actions, with `observe="sensors"`:

    | index | meaning | unit |
    |---|---|---|
    | 0..n-1 | load cell of tendon i | full pull, N |
    | n..2n-1 | encoder of tendon i, pulled in | full pull, m |
    | 2n..2n+k-1 | what is commanded, as the actions | F |
    | 2n+k..2n+k+2 | tip x, y, z by camera | L |
    | 2n+k+3..2n+k+5 | goal x, y, z | L |

    With `observe="full"` there follow nv joint angles (rad) and nv joint speeds (10 rad/s). Of a robot without encoders or without
    a camera (`sensors=("load_cells", "tip")`, say) those rows are left out.

    `parts` names them: load_cells, encoders, commands, tip, goal, angles, speeds.

    Reward: -|tip - goal| / (0.1 L), of the true tip. `info`: distance (m), success (within `success`), tip, goal. An episode is
    truncated after 100 steps; it ends early, with a reward of -10 and the reason in `info["lost"]`, where the motion is lost.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(self, twin: str | Path | Twin = "continuum", render_mode: str | None = None, **options: Any) -> None:
        """Raises UnknownNameError for an option, a drive or a sensor there is not, DataError for a robot without dynamics, for
        joint speeds of one that is at rest, and for currents through springs that a robot has not."""
        self.options, self.render_mode = chosen(Options, options, render_mode, self.metadata["render_modes"]), render_mode
        if self.options.drive not in list(Drive):
            raise UnknownNameError("drive", str(self.options.drive), list(Drive))
        self.drive = Drive(self.options.drive)
        self.interval = self.options.interval or INTERVAL[self.drive]
        for name in self.options.sensors:
            if name not in SENSORS:
                raise UnknownNameError("sensor", name, SENSORS)
        if self.options.observe == "full" and not self.options.dynamic:
            raise DataError('observe="full" shows joint speeds, which a robot at rest has not: leave out observe or dynamic=False')
        self.described = twin if isinstance(twin, Twin) else read_twin(twin)
        unsaid = isinstance(twin, Twin) or not self.options.randomise
        self._spread = Spread() if unsaid else read_spread(twin, self.described)  # type: ignore[arg-type]
        self.pull = full_pull(self.described)
        by_current = self.drive is Drive.CURRENT
        self.full = warmest_current(self.described)[0] if by_current else getattr(self.pull, self.drive)
        self._most = self.full * (min(self.options.most, 1.0) if by_current else self.options.most)
        self._reach = self._by_springs(self._most) if by_current else MOST_BEND
        self.plant = Plant(self.described, self.interval, drive=self.drive)
        self._start = self.plant.sensed()
        self.length, self.n = float(self._start.tip[2]), self.described.robot.n_tendon
        self._mix = self.pull.towards if self.drive is Drive.DISPLACEMENT else np.eye(self.n)  # of tendons (n, k) by actions
        k = self._mix.shape[1]
        self._actions, self._picture = Actions(k), None
        nv = len(self.plant.q) if self.options.observe == "full" else 0
        self.parts = {"load_cells": self.n, "encoders": self.n, "commands": k, "tip": 3, "goal": 3}
        self.parts |= {"angles": nv, "speeds": nv} if nv else {}
        self.parts = {name: size for name, size in self.parts.items() if self._has(name)}
        size = sum(self.parts.values())
        self.action_space = spaces.Box(-1.0, 1.0, (k,), np.float32)
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
        self.command, self._step = np.zeros(self._actions.n), 0
        seen = self.plant.sensed()
        return self._observed(seen), self._info(seen)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Raises DataError for an action that is not k numbers."""
        rate = self._actions.checked(action)
        self.command = self._within(self.command + rate * self.options.rate * self.full * self.interval)
        self._step += 1
        try:
            seen = self.plant.step(self._mix @ self.command)
        except SolveError as fault:
            seen = self.plant.sensed()
            return self._observed(seen), -10.0, True, False, {**self._info(seen), "lost": str(fault)}
        info = self._info(seen)
        return self._observed(seen), -info["distance"] / (0.1 * self.length), False, False, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """(480, 640, 3) bytes with `render_mode="rgb_array"`. Raises TwinError where this machine cannot draw."""
        if self.render_mode is None:
            return None
        self._picture = self._picture or Picture(self.plant.body.spec, self.length)
        return self._picture.draw(self.plant.q, [Mark(self.goal, 0.025 * self.length)])

    def close(self) -> None:
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    @property
    def goal(self) -> np.ndarray:
        """(3,) m, where the tip should be now."""
        return self._path[min(self._step, len(self._path) - 1)]

    def _within(self, command: np.ndarray) -> np.ndarray:
        """(k,) the nearest that may be commanded."""
        if self.drive is Drive.DISPLACEMENT:
            return command * min(1.0, self._most / max(float(np.linalg.norm(command)), 1e-12))
        return np.clip(command, 0.0, self._most)

    def _drawn(self) -> Plant:
        """An episode's robot, at rest. Raises SolveError where it stands nowhere."""
        o, rng = self.options, self.np_random
        twin = draw(self.described, self._spread, o.ranges, rng)
        return Plant(twin, self.interval, float(rng.uniform(*o.payload)), o.dynamic, self.drive)

    def _by_springs(self, current: float) -> float:
        """Full pulls to which one spring bends the described robot under a current (A) that stays, against all others, cold."""
        robot = HeatedRobot(self.described)
        for _ in range(HEATING):
            tension = robot.step(current * np.eye(self.described.robot.n_tendon)[0], WAIT)
        return float(tension[0] - tension[1:].mean()) / self.pull.tension

    def _goals(self) -> np.ndarray:
        """(1, 3) m: where the described robot's tip rests under drawn pulls."""
        bend = self._reach * np.sqrt(self.np_random.uniform(SMALL**2, 1.0))
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
            "load_cells": tension / F.tension, "encoders": travel / F.displacement, "commands": self.command / self.full,
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
        bend, start = self._reach * self.np_random.uniform(SMALL, 1.0), self.np_random.uniform(0.0, 2.0 * np.pi)
        lap = self._tips(np.full(LAP, bend), start + 2.0 * np.pi * np.arange(LAP) / LAP)
        return np.tile(lap, (3, 1))
