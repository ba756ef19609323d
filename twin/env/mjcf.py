"""Tracking a logged motion with any robot that is an MJCF."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gymnasium import spaces

from twin.body import Body, Drive, Loads, Start
from twin.body.hinge_chain import REFERENCE_SIZE
from twin.env.episodes.base import TwinEnv, refuse_before_reset
from twin.env.episodes.observation import ObservationLayout, PartBounds
from twin.env.episodes.rendering import FrameRenderer
from twin.env.episodes.validation import ActionBounds
from twin.env.plants.model_plant import ModelPlant
from twin.foundation.errors import DataError, SolveError, UnknownNameError
from twin.measurements import Recording, read
from twin.prediction.first_pose import true_start
from twin.prediction.prepared import Inputs, prepare
from twin.prediction.rollout import Drawing, draw_controls
from twin.prediction.twin import Twin

POSITION_RANGE, SPEED_RANGE, COORDINATE_RANGE = 8.0, 40.0, 50.0  # largest part of an observation, in its unit
SPEED_UNIT = 10.0  # 1/s, of a joint's unit
DRAWN_STEPS = 200  # of a drawn motion
LEAST_SPAN = 1e-2  # of a joint's unit: what a joint that hardly moves in the log is rewarded by
UNIT_OF_ERROR = 0.1  # of a joint's span
JOINTS = ("joint angle", "joint shift")


@dataclass(frozen=True)
class MJCFOptions:
    """Options of `gymnasium.make` beside the twin and `render_mode`."""

    motion: str | Path | Recording | None = None  # a measurement set with joints' positions; None: drawn motions of the twin itself
    trial: str | None = None  # of the set; None: drawn for each episode
    interval: float = 0.05  # s between two actions
    ahead: int = 3  # targets shown beside the present one, an interval apart
    observe: Literal["sensors", "full"] = "sensors"
    success: float = 0.05  # of each joint's span, of all joints from their targets
    randomise: bool = False  # draw each episode's twin from its uncertainty
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # SI, drawn uniformly for each episode


@dataclass(frozen=True)
class Motion:
    """Controls (n, nu) and targets (n, joint) SI, an interval apart; the trial's loads and start."""

    controls: np.ndarray
    targets: np.ndarray
    loads: Loads
    start: Start


class MJCFTrack(TwinEnv):
    """Follow the measured joints of a logged motion with the controls of an MJCF's actuators.

    `twin`: a twin.toml, a report's folder or a robot. `motion`: a measurement set with positions of joints; those are tracked, from
    each trial's own start, under its payload. Without one each episode has a motion of the twin under drawn controls. A joint's
    unit is the farther end of its range, else half a turn, or the robot's reach; its span is what it moves in the log, else
    its unit.

    Action, Box(-1, 1, (nu,)): the model's controls at the end of the interval, to which they go straight,

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..nu-1 | control of actuator i, from the least to the most that its range (or the log) has | -1 | 1 | half its range |

    Observation, float32, of j tracked joints:

    | index | meaning | min | max | unit |
    |---|---|---|---|---|
    | 0..j-1 | position of joint i by its encoder | -8 | 8 | its unit |
    | j..2j-1 | rate of joint i | -40 | 40 | 10 units a second |
    | 2j..2j+nu-1 | control, as the actions | -1 | 1 | half its range |
    | 2j+nu.. | target of each joint now, then `ahead` times an interval later each | -8 | 8 | its unit |

    With `observe="full"` all coordinates (rad, m) and rates (10 rad/s, 10 m/s) of the model follow.

    Reward: minus the mean over joints of |position - target| over a tenth of its span. `info`: error (rad or m of each joint),
    is_success (all within `success` of their spans), target, position. An episode is truncated where the motion ends, or after
    200 steps; it ends early, with a reward of -10 and the reason in `info["lost"]`, where the motion diverges.
    """

    options_type = MJCFOptions
    plant: ModelPlant

    def __init__(self, twin: str | Path | Twin = "tendon_leg", render_mode: str | None = None, **options: Any) -> None:
        """Raises UnknownNameError for an unknown option or trial, and DataError for a robot or a motion that do not fit."""
        super().__init__(twin, render_mode, options)
        if not isinstance(self.options.ahead, int) or self.options.ahead < 0:
            raise DataError(f"option ahead = {self.options.ahead!r}; a whole number from 0 on is needed")
        self._robot = robot = self.described.robot
        body = robot.build()
        ports = [next((p for p in ports if p.drive is Drive.CONTROL), None) for ports in body.ports]
        if None in ports:
            raise DataError(f"robot {robot.name!r} is no MJCF, whose actuators' controls are the actions; give a twin of one")
        self._low, rest, self._high = np.array([p.span for p in ports if p is not None], float).T
        self._motions = self._read_motions()
        if not self._motions:
            self.joints = tuple(c for c, s in body.senses.items() if s.group in JOINTS and c.endswith(".position"))
        self._bound_controls([p.channel for p in ports if p is not None])
        self._dofs, self.units, self.spans = self._scales(body)
        self._first = np.clip(rest, self._low, self._high)
        self._drawn = (self.described, -1.0)
        self.plant = ModelPlant(self.described, self.options.interval, self._first, Loads(robot.gravity), Start())
        self._actions = ActionBounds(len(ports))
        j, full = len(self.joints), int(self.options.observe == "full")
        self.layout = ObservationLayout(
            {
                "positions": PartBounds.within(j, POSITION_RANGE), "speeds": PartBounds.within(j, SPEED_RANGE),
                "commands": PartBounds.within(len(ports), 1.0),
                "targets": PartBounds.within(j * (1 + self.options.ahead), POSITION_RANGE),
                "coordinates": PartBounds.within(full * len(self.plant.q), COORDINATE_RANGE),
                "rates": PartBounds.within(full * len(self.plant.rates), SPEED_RANGE),
            }
        )  # fmt: skip
        self.action_space = spaces.Box(-1.0, 1.0, (len(ports),), np.float32)
        self.observation_space = self.layout.box(self.layout.parts)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Step one interval on. Raises DataError for an action that is not nu finite numbers."""
        self.command = self._actions.clip(action)
        self._step += 1
        try:
            self.plant.step(self._low + 0.5 * (self.command + 1.0) * (self._high - self._low))
        except SolveError as fault:
            return self._observation(), -10.0, True, False, {**self._info(), "lost": str(fault), "is_success": False}
        observation, info = self._observation(), self._info()
        reward = -float(np.mean(info["error"] / (UNIT_OF_ERROR * self.spans)))
        return observation, reward, False, self._step >= len(self.motion.targets) - 1, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return (480, 640, 3) bytes with `render_mode="rgb_array"`. Raises TwinError where this machine cannot draw."""
        if self.render_mode is None:
            return None
        figure = self.described.figure()
        self._renderer = self._renderer or FrameRenderer(self._robot.build().spec, figure.height, middle=figure.middle)
        return self._renderer.draw(self.plant.q, [])

    def action_of(self, control: np.ndarray) -> np.ndarray:
        """Return the action (..., nu) that gives controls (..., nu), clipped to their ranges."""
        return np.clip(2.0 * (np.asarray(control, float) - self._low) / (self._high - self._low) - 1.0, -1.0, 1.0)

    @property
    def target(self) -> np.ndarray:
        """The wanted positions (joint,) SI now."""
        return self._target(0)

    def _target(self, ahead: int) -> np.ndarray:
        return self.motion.targets[min(self._step + ahead, len(self.motion.targets) - 1)]

    def _read_motions(self) -> list[Motion]:
        """Return the motions of the set, of the chosen trial only, and name their joints."""
        given = self.options.motion
        if given is None:
            return []
        recording = given if isinstance(given, Recording) else read(given)
        prepared = prepare(recording, self._robot)
        found = [(j, o.channel.means) for j, o in enumerate(prepared.outputs) if o.group in JOINTS]
        if not found:
            raise DataError(f"{recording.title}: it has no position of a joint to follow; give a set with joint.NAME.position")
        self.joints, columns = tuple(name for _, name in found), [j for j, _ in found]
        names = [i.name.removesuffix(".csv") for i in prepared.inputs]
        if self.options.trial is not None and self.options.trial not in names:
            raise UnknownNameError("trial", self.options.trial, names)
        chosen = zip(names, prepared.inputs, prepared.measured, strict=True)
        return [self._motion(i, m[:, columns]) for n, i, m in chosen if self.options.trial in (None, n)]

    def _motion(self, inputs: Inputs, measured: np.ndarray) -> Motion:
        """Return a trial at the environment's interval; readings that lack are bridged."""
        time = np.arange(inputs.time[0], inputs.time[-1] + 1e-9, self.options.interval)
        targets = []
        for name, column in zip(self.joints, measured.T, strict=True):
            seen = np.isfinite(column)
            if not seen.any():
                raise DataError(f"{inputs.name}: {name} was never measured; choose another trial by `trial`, or leave it out")
            targets.append(np.interp(time, inputs.time[seen], column[seen]))
        controls = np.stack([np.interp(time, inputs.time, u) for u in inputs.command.T], axis=1)
        return Motion(controls, np.stack(targets, axis=1), inputs.loads, true_start(inputs, self.described.effect_chain))

    def _bound_controls(self, names: list[str]) -> None:
        """Widen the controls' ranges to the log's. Raises DataError for one that nothing bounds."""
        if self._motions:
            every = np.concatenate([m.controls for m in self._motions])
            self._low = np.where(np.isfinite(self._low), np.minimum(self._low, every.min(axis=0)), every.min(axis=0))
            self._high = np.where(np.isfinite(self._high), np.maximum(self._high, every.max(axis=0)), every.max(axis=0))
        lost = [n for n, low, high in zip(names, self._low, self._high, strict=True) if not 0.0 < high - low < np.inf]
        if lost:
            raise DataError(f"{lost[0]} has no range for actions; give the actuator a ctrlrange in the model, or a log by `motion`")

    def _scales(self, body: Body) -> tuple[list[int], np.ndarray, np.ndarray]:
        """Return each tracked joint's place among the rates, its unit and its span (SI)."""
        reach = REFERENCE_SIZE[0] * self._robot.size.length
        model, dofs, units = body.spec.compile(), [], []
        for name in self.joints:
            k = body.senses[name].index
            sliding = body.senses[name].group == "joint shift"
            dofs.append(int(model.jnt_dofadr[k]))
            units.append(float(np.abs(model.jnt_range[k]).max()) if model.jnt_limited[k] else reach if sliding else np.pi)
        scale = np.array(units)
        if not self._motions:
            return dofs, scale, scale
        every = np.concatenate([m.targets for m in self._motions])
        return dofs, scale, np.maximum(np.ptp(every, axis=0), LEAST_SPAN * scale)

    def _draw_episode(self) -> None:
        k = int(self.np_random.integers(len(self._motions))) if self._motions else -1
        self._drawn = (self._draw_twin(), float(k))
        self.motion = self._motions[k] if self._motions else self._draw_motion()
        self.plant = self._build_plant()
        self.command, self._step = self.action_of(self.plant.get_state()["controls"][0]), 0

    def _draw_motion(self) -> Motion:
        """Return a motion of the described twin under drawn controls. Raises SolveError where it diverges."""
        o = self.options
        drawing = Drawing(DRAWN_STEPS * o.interval, 1.0 / o.interval)
        drawn = draw_controls(self.described, 1, int(self.np_random.integers(2**31)), drawing)
        values = self.described.predict(drawn).trials[0].values
        controls = np.stack([values[c.name] for c in drawn.inputs()], axis=1)
        return Motion(controls, np.stack([values[n] for n in self.joints], axis=1), Loads(self._robot.gravity), Start())

    def _build_plant(self) -> ModelPlant:
        twin, k = self._drawn
        if k < 0.0:
            return ModelPlant(twin, self.options.interval, self._first, Loads(self._robot.gravity), Start())
        motion = self._motions[int(k)]
        return ModelPlant(twin, self.options.interval, motion.controls[0], motion.loads, motion.start)

    def _positions(self) -> np.ndarray:
        seen = self.plant.positions()
        return np.array([seen[name] for name in self.joints])

    def _observation_parts(self) -> dict[str, np.ndarray]:
        targets = [self._target(k) / self.units for k in range(1 + self.options.ahead)]
        return {
            "positions": self._positions() / self.units, "speeds": self.plant.rates[self._dofs] / (SPEED_UNIT * self.units),
            "commands": self.command, "targets": np.concatenate(targets), "coordinates": self.plant.q,
            "rates": self.plant.rates / SPEED_UNIT,
        }  # fmt: skip

    def _info(self) -> dict[str, Any]:
        position = self._positions()
        error = np.abs(position - self.target)
        near = bool(np.all(error <= self.options.success * self.spans))
        return {"error": error, "is_success": near, "target": self.target.copy(), "position": position}

    def _episode_arrays(self) -> dict[str, np.ndarray]:
        refuse_before_reset(self, "motion")
        return {
            "command": self.command, "step": np.array(self._step), "controls": self.motion.controls, "targets": self.motion.targets
        }  # fmt: skip

    def _restore_episode(self, arrays: Mapping[str, np.ndarray]) -> None:
        self.command, self._step = arrays["command"].copy(), int(arrays["step"])
        k = int(self._drawn[1])
        loads, start = (self._motions[k].loads, self._motions[k].start) if k >= 0 else (Loads(self._robot.gravity), Start())
        self.motion = Motion(arrays["controls"].copy(), arrays["targets"].copy(), loads, start)
