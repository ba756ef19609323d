"""Reaching and tracking with the tip of a backbone pulled by tendons."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gymnasium import spaces
from scipy.optimize import least_squares

from twin.body import Drive, Loads, Problem
from twin.env.episodes.base import TwinEnv, refuse_before_reset
from twin.env.episodes.observation import PLACE_RANGE, PULL_RANGE, SPEED_RANGE, ObservationLayout, PartBounds
from twin.env.episodes.rendering import FrameRenderer, Mark
from twin.env.episodes.validation import ActionBounds, parse_goal
from twin.env.plants.rod_plant import RodPlant
from twin.foundation.errors import DataError, SolveError, UnknownNameError
from twin.prediction.kinematics import HeatedRobot, warmest_current
from twin.prediction.rollout import full_pull
from twin.prediction.twin import Twin

LARGEST_GOAL_BEND = 1.2  # of goals, in full pulls; with springs, what these reach
SMALLEST_GOAL_SHARE = 1.0 / 6.0  # of the largest goal
STEPS_PER_LAP = 80
CONTINUUM_SENSORS = ("load_cells", "encoders", "tip")
# s: springs warm and cool in tens of seconds
DEFAULT_INTERVALS = {Drive.TENSION: 0.05, Drive.DISPLACEMENT: 0.05, Drive.CURRENT: 0.5}
REACH_HEATING_STEPS, REACH_HEATING_STEP = 120, 1.0  # steps, s: then springs under a constant current are at rest


@dataclass(frozen=True)
class ContinuumOptions:
    """Options of `gymnasium.make` beside the twin and `render_mode`."""

    drive: Literal["tension", "displacement", "current"] = "tension"  # what is commanded
    interval: float | None = None  # s between two actions: 0.05, of currents 0.5
    dynamic: bool = True  # MuJoCo's steps; else at rest at each interval's end, for a robot moved slowly
    rate: float = 1.0  # full pulls a second that an action of 1 adds
    most: float = 1.5  # full pulls: the largest tension, or bend by displacements; of currents at most 1
    observe: Literal["sensors", "full"] = "sensors"
    sensors: tuple[str, ...] = CONTINUUM_SENSORS  # those that the robot has
    tension_noise: float = 0.0  # N, one standard deviation of a load cell
    displacement_noise: float = 0.0  # m, of an encoder
    tip_noise: float = 0.0  # m, of the camera
    payload: tuple[float, float] = (0.0, 0.0)  # kg at the tip, drawn uniformly for each episode
    randomise: bool = False  # draw each episode's twin from its uncertainty
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # SI, drawn uniformly for each episode
    success: float = 3e-3  # m, of the tip from its goal


class ContinuumReach(TwinEnv):
    """Bring the tip of a tendon-driven backbone to a goal and hold it there.

    `twin`: a twin.toml, a report's folder or a robot's name. Its effects act as in predictions, with lag, drift and hysteresis of
    the
    episode's own history. n tendons; one full pull F bends the robot by some one radian (`twin.prediction.rollout.full_pull`), in
    newtons, or with `drive="displacement"` as the travel of a motor; with `drive="current"` it is the current under which an SMA
    spring rests 45 K above its phase change (`twin.prediction.kinematics.warmest_current`). Springs start cold, pull on one side
    only and bend less: goals are then within their reach. L is the height of the straight robot's tip.

    Action, Box(-1, 1, (n,)):

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..n-1 | rate of the commanded tension (as its load cell reads it), or current, of tendon i | -1 | 1 | `rate` F/s |

    With `drive="displacement"`, Box(-1, 1, (2,)), since tendons wound in one by one jam: motor i takes in F times the component of
    the bend towards it,

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..1 | rate of the commanded bend along x, y | -1 | 1 | `rate` F/s |

    Observation, Box, (2n + k + 6,), float32, of k actions, with `observe="sensors"`; readings saturate at their bounds:

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..n-1 | load cell of tendon i | -4 `most` | 4 `most` | full pull, N |
    | n..2n-1 | encoder of tendon i, pulled in | -4 `most` | 4 `most` | full pull, m |
    | 2n..2n+k-1 | command, as the actions | 0, of bends -`most` | `most`, of currents at most 1 | F |
    | 2n+k..2n+k+2 | tip x, y, z by camera | -2 | 2 | L |
    | 2n+k+3..2n+k+5 | goal x, y, z | -2 | 2 | L |

    With `observe="full"` there follow nv joint angles (rad, within pi) and nv joint speeds (10 rad/s, within 100). For a robot
    without encoders or without a camera (`sensors=("load_cells", "tip")`, say) those rows are left out. `parts` names the rows:
    load_cells, encoders, commands, tip, goal, angles, speeds.

    `reset(options={"goal": (x, y, z)})`, in m, chooses the goal; it must lie within `success` of a place where the tip rests under
    tensions up to `most`.

    Reward: -|tip - goal| / (0.1 L), of the true tip. `info`: distance (m), is_success (within `success`), tip, goal. An episode is
    truncated after 100 steps; it ends early, with a reward of -10 and the reason in `info["lost"]`, where the motion is lost.
    """

    options_type = ContinuumOptions

    def __init__(self, twin: str | Path | Twin = "continuum", render_mode: str | None = None, **options: Any) -> None:
        """Raises UnknownNameError for an unknown option, drive or sensor, and DataError for a robot that they do not fit.

        These are robots without dynamics, joint speeds of a robot at rest, and currents without springs.
        """
        super().__init__(twin, render_mode, options)
        if self.options.drive not in list(Drive):
            raise UnknownNameError("drive", str(self.options.drive), list(Drive))
        self.drive = Drive(self.options.drive)
        self.interval = self.options.interval or DEFAULT_INTERVALS[self.drive]
        for name in self.options.sensors:
            if name not in CONTINUUM_SENSORS:
                raise UnknownNameError("sensor", name, CONTINUUM_SENSORS)
        if self.options.observe == "full" and not self.options.dynamic:
            raise DataError('observe="full" shows joint speeds, which a robot at rest has not: leave out observe or dynamic=False')
        self.pull = full_pull(self.described)
        by_current = self.drive is Drive.CURRENT
        self.full = warmest_current(self.described)[0] if by_current else getattr(self.pull, self.drive)
        self._largest_command = self.full * (min(self.options.most, 1.0) if by_current else self.options.most)
        self._goal_reach = self._spring_reach(self._largest_command) if by_current else LARGEST_GOAL_BEND
        self.plant = RodPlant(self.described, self.interval, drive=self.drive)
        self._drawn = (self.described, 0.0)
        self.length, self.n = float(self.plant.readings().tip[2]), self.described.robot.n_tendon
        # Tendons (n, k) by actions.
        self._tendons_by_action = self.pull.towards if self.drive is Drive.DISPLACEMENT else np.eye(self.n)
        k = self._tendons_by_action.shape[1]
        self._actions = ActionBounds(k)
        nv = len(self.plant.q) if self.options.observe == "full" else 0
        self.layout = self._bounded_parts(k, nv)
        self.parts = {name: part.size for name, part in self.layout.parts.items()}
        self.action_space = spaces.Box(-1.0, 1.0, (k,), np.float32)
        self.observation_space = self.layout.box(self.parts)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Step one interval on. Raises DataError for an action that is not k finite numbers."""
        rate = self._actions.clip(action)
        self.command = self._limit_command(self.command + rate * self.options.rate * self.full * self.interval)
        self._step += 1
        try:
            self.plant.step(self._tendons_by_action @ self.command)
        except SolveError as fault:
            return self._observation(), -10.0, True, False, {**self._info(), "lost": str(fault)}
        reward = float(self._goal_reward(self._achieved(), self._desired()))
        return self._observation(), reward, False, False, self._info()

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return (480, 640, 3) bytes with `render_mode="rgb_array"`. Raises TwinError where this machine cannot draw."""
        if self.render_mode is None:
            return None
        self._renderer = self._renderer or FrameRenderer(self.plant.body.spec, self.length, self.described.robot.gravity[2] > 0.0)
        return self._renderer.draw(self.plant.q, [Mark(self.goal, 0.025 * self.length)])

    @property
    def goal(self) -> np.ndarray:
        """The tip's wanted place (3,) m now."""
        return self._path[min(self._step, len(self._path) - 1)]

    def _bounded_parts(self, k: int, nv: int) -> ObservationLayout:
        """Return the observation's parts, of k actions and nv joints that are shown."""
        most, sensed = self._largest_command / self.full, PULL_RANGE * self.options.most
        parts = {
            "load_cells": PartBounds.within(self.n, sensed), "encoders": PartBounds.within(self.n, sensed),
            "commands": PartBounds(k, -most if self._signed else 0.0, most),
            "tip": PartBounds.within(3, PLACE_RANGE), "goal": PartBounds.within(3, PLACE_RANGE),
            "angles": PartBounds.within(nv, np.pi), "speeds": PartBounds.within(nv, SPEED_RANGE),
        }  # fmt: skip
        return ObservationLayout({name: part for name, part in parts.items() if self._includes(name)})

    @property
    def _signed(self) -> bool:
        """Whether commands go below zero: displacements, and tensions of rods."""
        return self.drive is Drive.DISPLACEMENT or (self.drive is Drive.TENSION and self.plant.body.pushes)

    def _limit_command(self, command: np.ndarray) -> np.ndarray:
        """Return the nearest command (k,) within the limits."""
        if self.drive is Drive.DISPLACEMENT:
            return command * min(1.0, self._largest_command / max(float(np.linalg.norm(command)), 1e-12))
        return np.clip(command, -self._largest_command if self._signed else 0.0, self._largest_command)

    def _draw_plant(self) -> RodPlant:
        """Draw an episode's twin and payload, and build its robot. Raises SolveError where it has no equilibrium."""
        self._drawn = (self._draw_twin(), float(self.np_random.uniform(*self.options.payload)))
        return self._build_plant()

    def _build_plant(self) -> RodPlant:
        twin, payload = self._drawn
        return RodPlant(twin, self.interval, payload, self.options.dynamic, self.drive)

    def _draw_episode(self) -> None:
        self.plant = self._draw_plant()
        self._path = self._draw_goals()
        self.command, self._step = np.zeros(self._actions.n), 0

    def _episode_arrays(self) -> dict[str, np.ndarray]:
        refuse_before_reset(self, "command")
        return {"command": self.command, "step": np.array(self._step), "goals": self._path}

    def _restore_episode(self, arrays: Mapping[str, np.ndarray]) -> None:
        self.command, self._step, self._path = arrays["command"].copy(), int(arrays["step"]), arrays["goals"].copy()

    def _spring_reach(self, current: float) -> float:
        """Return the full pulls to which one spring under a constant current (A) bends the robot against all others, cold."""
        robot = HeatedRobot(self.described)
        for _ in range(REACH_HEATING_STEPS):
            tension = robot.step(current * np.eye(self.described.robot.n_tendon)[0], REACH_HEATING_STEP)
        return float(tension[0] - tension[1:].mean()) / self.pull.tension

    def _draw_goals(self) -> np.ndarray:
        """Return goals (1, 3) m: where the described robot's tip rests under drawn pulls."""
        bend = self._goal_reach * np.sqrt(self.np_random.uniform(SMALLEST_GOAL_SHARE**2, 1.0))
        return self._rest_tips(np.array([bend]), self.np_random.uniform(0.0, 2.0 * np.pi, 1))

    def _rest_tips(self, bend: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """Return the tip (m, 3) m of the described robot at rest, without friction, bent (m,) full pulls towards (m,) rad."""
        robot = self.described.robot
        pulls = (bend[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])) @ self.pull.towards.T
        solver = robot.solver(robot.build(self.described.values))
        tension = np.vstack([np.zeros(self.n), self.plant.body.bending(pulls) * self.pull.tension])
        path = solver.solve(Problem(np.arange(float(len(tension))), tension, Loads(robot.gravity)))
        if not path.status.all():
            raise SolveError("the described robot has no equilibrium under a goal's tensions")
        return path.markers[1:, -1]

    def _check_goal(self, given: Any) -> np.ndarray:
        goal = parse_goal(given, (3,), "a place (x, y, z) of the tip, m")
        self._refuse_out_of_reach(goal)
        return goal[None]

    def _place_goal(self, goal: np.ndarray) -> None:
        self._path = goal

    def _refuse_out_of_reach(self, place: np.ndarray) -> None:
        """Raise DataError where the described robot's tip rests nowhere within `success` of a place (3,) m."""
        nearest, allowed = self._nearest_tip(place), self.options.success
        off = float(np.linalg.norm(nearest - place))
        if off > allowed:
            words = ", ".join(f"{x:.4f}" for x in nearest)
            raise DataError(
                f"the goal {np.round(place, 5).tolist()} m is out of reach: the nearest place where the tip rests, ({words}), is "
                f"{1e3 * off:.1f} mm away and {1e3 * allowed:g} mm (`success`) are allowed; give that place, or a larger `most`"
            )

    def _nearest_tip(self, place: np.ndarray) -> np.ndarray:
        """Return the tip (3,) m at rest nearest to a place (3,) m, of the described robot within its commands."""
        most = self._goal_reach if self.drive is Drive.CURRENT else self.options.most
        towards, bends = float(np.arctan2(place[1], place[0])), np.linspace(0.0, most, 13)
        tips = self._rest_tips(bends, np.full(len(bends), towards))
        start = bends[np.argmin(np.linalg.norm(tips - place, axis=1))]
        found = least_squares(
            lambda x: self._rest_tips(x[:1], x[1:])[0] - place, (start, towards), diff_step=1e-3,
            bounds=([0.0, towards - 1.0], [most, towards + 1.0]),
        )  # fmt: skip
        return self._rest_tips(found.x[:1], found.x[1:])[0]

    def _achieved(self) -> np.ndarray:
        """Return the true tip (3,) L."""
        return self.plant.readings().tip / self.length

    def _desired(self) -> np.ndarray:
        """Return the goal (3,) L."""
        return self.goal / self.length

    def _goal_reward(self, achieved: np.ndarray, desired: np.ndarray) -> np.ndarray:
        """Return the reward (...) of tips (..., 3) L with goals (..., 3) L."""
        return -np.linalg.norm(achieved - desired, axis=-1) / 0.1

    def _observation_parts(self) -> dict[str, np.ndarray]:
        o, F, rng, readings = self.options, self.pull, self.np_random, self.plant.readings()
        tension = readings.tension + o.tension_noise * rng.standard_normal(self.n)
        travel = readings.displacement + o.displacement_noise * rng.standard_normal(self.n)
        tip = readings.markers[-1] + o.tip_noise * rng.standard_normal(3)
        parts = {
            "load_cells": tension / F.tension, "encoders": travel / F.displacement, "commands": self.command / self.full,
            "tip": tip / self.length, "goal": self.goal / self.length,
        }  # fmt: skip
        if o.observe == "full":
            data = self.plant.motion.data
            parts |= {"angles": data.qpos, "speeds": data.qvel / 10.0}
        return parts

    def _includes(self, part: str) -> bool:
        """Return whether the observation has this part."""
        return part not in CONTINUUM_SENSORS or part in self.options.sensors

    def _info(self) -> dict[str, Any]:
        tip = self.plant.readings().tip
        distance = float(np.linalg.norm(tip - self.goal))
        return {"distance": distance, "is_success": distance < self.options.success, "tip": tip.copy(), "goal": self.goal.copy()}


class ContinuumTrack(ContinuumReach):
    """Follow a goal on a circle with the tip: a bend of drawn size whose direction turns once in 80 steps, from a drawn start.

    Options, actions, observations and reward are those of `ContinuumReach`; the goal observed is that of the present step. An
    episode is truncated after 200 steps. `reset(options={"goal": path})`, (m, 3) m, chooses the goals of m steps; the last stays.
    """

    def _draw_goals(self) -> np.ndarray:
        bend, start = self._goal_reach * self.np_random.uniform(SMALLEST_GOAL_SHARE, 1.0), self.np_random.uniform(0.0, 2.0 * np.pi)
        lap = self._rest_tips(np.full(STEPS_PER_LAP, bend), start + 2.0 * np.pi * np.arange(STEPS_PER_LAP) / STEPS_PER_LAP)
        return np.tile(lap, (3, 1))

    def _check_goal(self, given: Any) -> np.ndarray:
        path = parse_goal(given, (-1, 3), "a path of places (x, y, z) of the tip, a row a step, m")
        for place in path:
            self._refuse_out_of_reach(place)
        return path
