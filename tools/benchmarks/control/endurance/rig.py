"""A finger that MuJoCo steps, its controller, and what is looked at in every step of both.

    lost       the finger's motion: a cell inside out, a node not finite or faster than any; it cannot go on
    nan        a number of the state, of the readings or of the commands that is not finite
    rate       a tendon told to go faster than the controller's limit
    most       the controller's tension of a tendon above its limit by more than OVER
    no answer  the controller found no equilibrium: the tendons then stay, which is no fault

The finger's E, R0, kappa and mounting are drawn by the seed and its tendons rub; the controller's twin is what an alignment would
leave of it (`twin/tasks/imitation/hand_model.py`), E as described, without friction. Both run as a hand does its tasks: a look, a
control step, and its time of motion in steps of 4 ms. A tension is limited by a tangent: while the finger moves, the twin's own may
end that little above it by which the tangent is off, OVER being a hundredth of the limit.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import NamedTuple

import mujoco
import numpy as np

from tools.benchmarks.control.endurance.course import Course
from twin.body import Drive, Loads, Problem
from twin.control import ShapeController
from twin.effects import effect_class
from twin.foundation.errors import SolveError
from twin.mechanics.silicone.material.flex import flex_spec
from twin.mechanics.silicone.motion.dynamics import RestingBody, SoftMotion, motion_step
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.twin import Twin
from twin.robots import load
from twin.tasks import CONTROL_STEP
from twin.tasks.imitation.hand_model import draw_alignment, draw_built_hand
from twin.tasks.imitation.representations import GRIP_LIMITS

OVER = 0.01  # of the most pull: 22 mN; what is above 10 mN the controller pays out again, by a tangent too
ROUNDING = 1e-9
FRICTION = 0.1  # of the plant's tendons, by Capstan's law
STRIDE = 1e-3  # m by which tendons are taken back to where they were


class Look(NamedTuple):
    """One step: mean distance (m) of the true points from the wanted ones; whether something presses; the largest tensions (N), by
    the twin and of the plant; the largest shortening (m) and its share of the rate allowed; the lowest pull by the twin (N)."""

    error: float
    pushed: bool
    twin: float
    plant: float
    shortening: float
    rate: float
    least: float


class Plant:
    """The built finger, its tendons held at lengths. SI."""

    def __init__(self, twin: Twin) -> None:
        """Hanging at rest."""
        body, laws = twin.robot.silicone(twin.body()), twin.effect_chain
        n = body.n_tendon
        rest = Problem(np.zeros(1), np.zeros((1, n)), Loads(twin.robot.gravity), laws.route, (Drive.DISPLACEMENT,) * n)
        self._started = RestingBody.of(body, rest)
        spec = flex_spec(self._started.body, motion_step(self._started.body))
        spec.option.gravity = twin.robot.gravity @ rotation_about_z(body.turn)
        self.moving = SoftMotion.of(spec, [self._started], [""], ["the finger"])
        self.steps = round(CONTROL_STEP / self.moving.step)
        self._own = rotation_about_z(body.turn).T
        self._still, self.shortening = self.moving.bodies[0].force.copy(), np.zeros(n)

    def move(self, shortening: np.ndarray, push: np.ndarray | None) -> None:
        """Move for a control step, tendons going to shortenings (t,) m. Raises SolveError where the motion is lost."""
        self.moving.bodies[0].force[:] = self._still if push is None else self._still + push.ravel()
        self.moving.run(self.shortening[None], shortening[None], self.steps)
        self.shortening = shortening.copy()

    def resistance(self) -> np.ndarray:
        """Return the true resistances (s,) ohm."""
        return self._started.statics.sensor_signals(self.moving.displacement(0)[None])["sensor"][0]

    def points(self, rest: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the points (P, 3) m in the base frame."""
        return (rest + weights @ self.moving.displacement(0)) @ self._own

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """All that is kept from step to step."""
        limb, data = self.moving.bodies[0], self.moving.data
        own = {name: getattr(limb, name) for name in ("slip", "beyond", "tension")}
        return own | {"qpos": data.qpos, "qvel": data.qvel, "shortening": self.shortening}

    def put(self, kept: dict[str, np.ndarray]) -> None:
        """Set all that `arrays` gave."""
        for name, array in self.arrays.items():
            array[:] = kept[name]
        mujoco.mj_forward(self.moving.model, self.moving.data)

    @property
    def finite(self) -> bool:
        return all(np.isfinite(a).all() for a in self.arrays.values())


@dataclass
class Rig:
    """Plant, controller and course of a seed, at `steps` of STEP s."""

    seed: int
    steps: int = 0

    def __post_init__(self) -> None:
        robot = load("finger")
        values = draw_built_hand(robot, self.seed)
        twin = Twin(robot, values, (effect_class("tendon_friction")({"mu": FRICTION}, robot.n_tendon),))
        self.plant, self.course = Plant(twin), Course(twin, self.seed)
        self.law = ShapeController(replace(twin, values=draw_alignment(robot, values, self.seed), effects=()), limits=GRIP_LIMITS)
        self._rest = self.law.finger.rest
        self._weights = self.law.finger.body.lattice.weights(self._rest)
        self.faults: Counter[str] = Counter()

    @property
    def time(self) -> float:
        """s."""
        return self.steps * CONTROL_STEP

    def step(self) -> Look:
        """Do a control step and its motion; return a look at both. Raises SolveError where the motion is lost."""
        plant, law, time = self.plant, self.law, self.time
        felt, wanted, push = self.course.read(plant.resistance(), time), self.course.wanted(time), self.course.push(time)
        told = law.finger.shortening
        try:
            told = law.step(wanted, felt, CONTROL_STEP).shortening
        except SolveError:
            self.faults["no answer"] += 1
        rate = float(np.abs(told - plant.shortening).max()) / (GRIP_LIMITS.rate * CONTROL_STEP)
        plant.move(told, push)
        self.steps += 1
        error = np.linalg.norm(plant.points(self._rest, self._weights) - self.course.wanted(self.time), axis=1).mean()
        tension = law.finger.tension
        look = Look(
            float(error), push is not None, float(tension.max()), float(plant.moving.bodies[0].tension.max()),
            float(np.abs(told).max()), rate, float(tension.min()),
        )  # fmt: skip
        self.faults["nan"] += not (plant.finite and np.isfinite(felt).all() and np.isfinite(look).all())
        self.faults["rate"] += not rate <= 1.0 + ROUNDING
        self.faults["most"] += not look.twin <= (1.0 + OVER) * GRIP_LIMITS.most
        return look

    def state(self) -> dict[str, np.ndarray]:
        """Return what a rig needs to go on."""
        return {f"plant.{name}": array.copy() for name, array in self.plant.arrays.items()} | {
            "seed": np.array(self.seed), "steps": np.array(self.steps), "law": self.law.finger.shortening.copy(),
        }  # fmt: skip

    @staticmethod
    def of(state: dict[str, np.ndarray]) -> Rig:
        """Return the rig where it was: the plant to the last bit; equilibria are found anew, within what Newton leaves."""
        rig = Rig(int(state["seed"]), int(state["steps"]))
        rig.plant.put({name.removeprefix("plant."): a for name, a in state.items() if name.startswith("plant.")})
        for finger, goal in ((rig.law.finger, state["law"]), (rig.course.finger, rig.course.command(rig.time))):
            count = max(1, int(np.ceil(np.abs(goal).max() / STRIDE)))
            for share in np.arange(1, count + 1) / count:
                finger.hold_at(share * goal)
        return rig
