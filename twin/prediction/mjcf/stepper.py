"""Steps an exported MJCF with the laws that MuJoCo has not, as its twin predicts it."""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from twin.body import Drive, Loads, Problem, Signals, Start
from twin.effects import Effect, effect_class
from twin.effects.base.chain import EffectChain
from twin.foundation.errors import DataError, SolveError, TwinError, short_repr
from twin.mechanics.mjcf import LoadedModel, ModelBody, ModelSolver, longest_step
from twin.prediction.mjcf.natives import erase_friction
from twin.prediction.twin import Twin
from twin.robots.families.mjcf import body_of
from twin.robots.schemas.mjcf import counts_of

PREFIX = "twin."  # of the custom numbers that hold laws: twin.EFFECT.PARAMETER
STEP_ROUNDING = 1e-9
_NO_ROW, _NOTHING = np.full(1, -1, np.int64), np.empty((0, 0))
_POSITIONS = ("joint angle", "joint shift", "actuator angle", "actuator length", "tendon length", "marker")


class Stepper(ABC):
    """A model in motion with the laws of effects, under controls given step by step."""

    effects: tuple[Effect, ...]
    step_length: float  # s

    def _take(self, effects: tuple[Effect, ...], body: ModelBody, loads: Loads) -> None:
        """Take what is stepped."""
        self.effects, self.step_length, self._body, self._loads = effects, body.longest_step, body, loads
        self._chain, self._solver = EffectChain(effects), ModelSolver(body)

    @property
    def model(self) -> mujoco.MjModel:
        """The model that is stepped."""
        return self._motion.model

    @property
    def data(self) -> mujoco.MjData:
        """Its state; positions of sites and tendons are those before the last step, as after `mj_step`."""
        return self._motion.data

    def reset(self, control: np.ndarray, settle: float = 2.0, pose: str = "") -> None:
        """Begin as a trial does: from a keyframe (or where springs and servos rest), held under `control` (nu,) for `settle` s."""
        control = np.asarray(control, float)
        problem = Problem(
            np.zeros(1), control[None], self._loads, self._chain.route, (Drive.CONTROL,) * len(control), start=Start(settle, pose)
        )
        first, self._laws = control, list[Callable[[np.ndarray], np.ndarray]]()
        for effect in (
            *(e for e in reversed(self.effects) if e.acts_in("command")),
            *(e for e in self.effects if e.acts_in("drive")),
        ):
            if (law := effect.by_step(self.step_length, first)) is not None:
                self._laws.append(law)
                first = first if effect.acts_in("drive") else law(first)
        self._motion = self._solver.begin(problem, self.step_length, first)
        self._began = float(self._motion.data.time)
        self._scratch = mujoco.MjData(self._motion.model)

    def step(self, control: np.ndarray) -> None:
        """Advance by one step under controls (nu,). Raises SolveError for a motion that diverges."""
        delivered = np.array(control, float)
        for law in self._laws:
            delivered = law(delivered)
        if not self._motion.stands or self._motion.advance(delivered[None], _NO_ROW, _NOTHING) < 1:
            raise SolveError("the model's motion diverges; check the controls, or give the file a shorter timestep")

    def readings(self) -> dict[str, float]:
        """Return the positions (SI) of joints, actuators, tendons and sites by channel, as its encoders and camera report them.

        What a drum behind an elastic tendon shows hangs on the actuator's force, which is here that under the last controls.
        """
        model, now = self._motion.model, self._scratch
        now.qpos[:] = self._motion.data.qpos
        for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon, mujoco.mj_transmission):
            compute(model, now)
        tension = -self._motion.data.actuator_force[None]
        angle = now.qpos[model.jnt_qposadr]
        columns = dict(zip(_POSITIONS, (angle, angle, now.actuator_length, now.actuator_length, now.ten_length), strict=False))
        nu, time = np.zeros((1, model.nu)), np.full(1, self._motion.data.time - self._began)
        true = Signals(
            time, time, tension, nu, now.site_xpos[None].copy(), np.zeros(1),
            others={name: column[None].copy() for name, column in columns.items()},
        )  # fmt: skip
        seen = self._chain.sense(true)
        senses = {name: s for name, s in self._body.senses.items() if s.group in _POSITIONS}
        return {name: float(seen.group(s.group)[0, s.index, s.axis]) for name, s in senses.items()}


class TwinStepper(Stepper):
    """A twin of an MJCF in motion: its own prediction, step by step."""

    def __init__(self, twin: Twin, interval: float, loads: Loads | None = None) -> None:
        """Take steps that divide an `interval` (s), under `loads` beside the twin's own. Raises DataError for another robot."""
        body = twin.body()
        if not isinstance(body, ModelBody):
            raise DataError(f"robot {twin.robot.name!r} is no MJCF, which is what is stepped here; give a twin of one")
        self.steps = max(1, int(np.ceil(interval / longest_step(body, twin.effect_chain.route) - STEP_ROUNDING)))
        own = twin.effect_chain.surround(loads or Loads(twin.robot.gravity))
        self._take(twin.effects, replace(body, longest_step=interval / self.steps), own)


class ModelStepper(Stepper):
    """An exported MJCF in motion.

    `model` and `data` are MuJoCo's, to be read, drawn or put into an environment; `model` is the file's without what stands there
    in place of laws that are stepped here. Steps are as long as the file's timestep. As in the twin, damping acts at the mean of
    the rates before and after a step, what rubs is followed in short steps, and commands run straight from step to step:
    along a trial whose rows are steps it gives the twin's own prediction to rounding. Where rows are further apart, give the
    commands straight between rows; a twin's prediction rounds the corners of late and filtered ones by a millisecond.

        stepper = ModelStepper("robot.xml")
        stepper.reset(control)
        while True:
            stepper.step(control)
            stepper.readings()["joint.knee.position"]
    """

    def __init__(self, path: str | Path) -> None:
        """Read the file. Raises DataError for a file that does not load, or holds laws that are not known."""
        effects, loaded = _read(Path(path))
        body = body_of(loaded, {"timestep": float(loaded.spec.option.timestep)}, {})
        self._take(effects, body, Loads(np.array(body.model.opt.gravity)))
        self._chain.check_body(body, Path(path).name)
        self.reset(np.zeros(loaded.model.nu), settle=0.0)


def _read(path: Path) -> tuple[tuple[Effect, ...], LoadedModel]:
    """Return the laws of an exported file, and its model without what stands there in their place."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compile()
        numbers = {n.name: np.array(n.data) for n in spec.numerics if n.name.startswith(PREFIX)}
        found: dict[str, dict[str, float]] = {}
        for name, value in numbers.items():
            effect, _, parameter = name.removeprefix(PREFIX).partition(".")
            found.setdefault(effect, {})[parameter] = float(value[0])
        counts = counts_of(LoadedModel(path, spec, spec.compile()))
        effects = tuple(effect_class(name)(values, counts) for name, values in found.items())
        erase_friction(spec, EffectChain(effects).route.rubbing)
        for effect in effects:
            effect.erase(spec)
        return effects, LoadedModel(path, spec, spec.compile())
    except (ValueError, TwinError, mujoco.FatalError) as error:
        raise DataError(f"{short_repr(str(path), 300)}: {' '.join(str(error).split())}; export it again") from None


def numbers_of(effect: Effect) -> Mapping[str, float]:
    """Return the custom numbers that hold a law, for `_read`."""
    return {f"{PREFIX}{effect.id}.{name}": value for name, value in effect.values.items()}
