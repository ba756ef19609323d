"""Silicone stepped in time under commanded tendon displacements: a finger alone, or a hand among things.

A finger is moved by MuJoCo's steps, not from one static equilibrium to the next: it then has mass and lag, all effects act (statics
from command to command, `twin.control.held_finger`, has no creep and no loads but the weight), and every command has an answer. An
interval of 48 ms took 11 ms this way on a busy machine, an equilibrium 1.5 mm further 7 to 8 ms.
"""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from twin.body import Drive, Loads, Problem, Route
from twin.env.episodes.validation import select_arrays
from twin.env.plants.effect_io import EffectIO
from twin.env.plants.rod_plant import get_mujoco_state, set_mujoco_state
from twin.foundation.errors import DataError
from twin.mechanics.silicone import HandBody
from twin.mechanics.silicone.material.flex import flex_spec
from twin.mechanics.silicone.motion.dynamics import CreepBetweenSamples, RestingBody, SoftMotion, motion_step
from twin.mechanics.silicone.motion.scene import Scene, SceneState, Thing
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.prepared import ROOM_TEMPERATURE
from twin.prediction.twin import Twin


class FingerReadings(NamedTuple):
    """Readings of the sensors at one instant.

    Tension (t,) N, displacement (t,) m, resistance (s,) over that at no strain; and the true places of the markers, (m, 3) m of the
    base frame, the tip last.
    """

    tension: np.ndarray
    displacement: np.ndarray
    resistance: np.ndarray
    markers: np.ndarray


class FingerPlant:
    """A finger whose tendons motors hold at displacements, counted from hanging at rest. One instance serves one thread."""

    def __init__(self, twin: Twin, interval: float) -> None:
        """Hang the finger at rest; `interval` (s) is rounded to whole steps.

        Raises DataError for a robot that is no silicone finger, SolveError where it has no equilibrium.
        """
        body = twin.robot.silicone(twin.body())
        effect_chain, n = twin.effect_chain, body.n_tendon
        self.body, self._effect_io = body, EffectIO(effect_chain, Drive.DISPLACEMENT, body)
        stiffness = effect_chain.stiffness(np.full(1, ROOM_TEMPERATURE), np.zeros(1))
        loads, at = effect_chain.surround(Loads(twin.robot.gravity)), np.zeros((1, n))
        self._resting = RestingBody.of(
            body,
            Problem(np.zeros(1), at, loads, effect_chain.route, self._effect_io.drives, effect_chain.creep, stiffness=stiffness),
        )
        self.spec = flex_spec(self._resting.body, motion_step(self._resting.body))
        self.spec.option.gravity = loads.gravity @ rotation_about_z(body.turn)
        self.motion = SoftMotion.of(self.spec, [self._resting], [""], ["the finger"])
        self._creep = CreepBetweenSamples(self._resting)
        self._steps = max(1, round(interval / self.motion.step))
        self.interval = self._steps * self.motion.step
        self._record(self._effect_io.apply_to_command(0.0, at[0]))

    def step(self, command: np.ndarray) -> FingerReadings:
        """Step one interval on, the motors going straight to the `command` (t,) m. Raises SolveError where the motion is lost."""
        actuated = self._effect_io.apply_to_command(self._effect_io.time[-1] + self.interval, command)
        self.motion.run(self._effect_io.actuated[-2][None], actuated[None], self._steps)
        self._creep.advance(self.motion.bodies[0], self.motion.displacement(0).ravel(), self.interval)
        self._record(actuated)
        return self.readings()

    def readings(self) -> FingerReadings:
        """Return the sensors' readings now."""
        sensed = self._effect_io.read_sensors()
        resistance = sensed.others["sensor"][-1] / self.body.cords.rest
        return FingerReadings(sensed.tension[-1], sensed.displacement[-1], resistance, self.markers)

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the state as arrays by name."""
        arrays = {f"motion.{name}": a for name, a in get_motion_state(self.motion).items()}
        arrays |= {f"effects.{name}": a for name, a in self._effect_io.get_state().items()}
        return arrays | {"markers": self.markers.copy(), "relaxed": self._creep.relaxed.copy()}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a saved state of a plant with the same twin and interval."""
        set_motion_state(self.motion, select_arrays(state, "motion"))
        self._effect_io.set_state(select_arrays(state, "effects"))
        self.markers, self._creep.relaxed[:] = state["markers"].copy(), state["relaxed"]
        if self._creep.amplitude.size:
            self.motion.bodies[0].work.relaxed[:] = self._creep.relaxed.sum(axis=0)

    def _record(self, actuated: np.ndarray) -> None:
        """Record the true signals under the actuated command."""
        u, statics = self.motion.displacement(0)[None], self._resting.statics
        self.markers = statics.markers(u)[0]
        others = {group: column[0] for group, column in statics.sensor_signals(u).items()}
        self._effect_io.record_truth(
            self.motion.bodies[0].tension.copy(), actuated, self.body.frame.to_marker_frame(self.markers), others
        )


def hand_among_things(twin: Twin) -> tuple[HandBody, np.ndarray, Route]:
    """Return the hand of a twin, gravity (3,) m/s^2 in the palm's frame and the tendons' route.

    Raises DataError for a robot that is no hand and for effects that do not act among things.
    """
    body = twin.robot.hand(twin.body())
    idle = [e.id for e in twin.effects if e.acts_in("soften", "deform", "command", "drive", "sense")]
    if idle:
        raise DataError(f"effects {', '.join(idle)} do not act among things that the hand touches: remove them from the twin")
    loads = twin.effect_chain.surround(Loads(twin.robot.gravity))
    if loads.payload or loads.force.any() or loads.wall[4]:
        raise DataError("a payload, a force or a wall does not act among things that the hand touches: remove that effect")
    return body, loads.gravity, twin.effect_chain.route


class HandPlant:
    """A hand and things, its pairs of antagonist tendons driven by servos. One instance serves one thread."""

    def __init__(self, twin: Twin, things: list[Thing], interval: float) -> None:
        """Start at rest, the servos at zero.

        Raises DataError for a robot that is no hand and for effects that do not act here, SolveError where it has no equilibrium.
        """
        body, gravity, route = hand_among_things(twin)
        self.body, self.scene = body, Scene(body, things, gravity, route)
        self.interval = max(1, round(interval / self.scene.motion.step)) * self.scene.motion.step
        self.rest = np.stack([finger.cords.rest for finger in body.fingers])
        self.state = self.scene.observe()

    def reset(self) -> SceneState:
        """Return to the initial rest."""
        self.state = self.scene.reset()
        return self.state

    def step(self, servos: np.ndarray) -> SceneState:
        """Step one interval on, the servos (finger, pair) m going straight to their command.

        Raises SolveError where the motion is lost.
        """
        self.state = self.scene.step(servos, self.interval)
        return self.state

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the state as arrays by name."""
        arrays = {f"motion.{name}": a for name, a in get_motion_state(self.scene.motion).items()}
        return arrays | {f"scene.{f.name}": np.array(getattr(self.state, f.name)) for f in fields(SceneState)}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a saved state of a hand with the same twin, things and interval."""
        set_motion_state(self.scene.motion, select_arrays(state, "motion"))
        scene: dict[str, Any] = {name: a.copy() if a.ndim else a.item() for name, a in select_arrays(state, "scene").items()}
        self.state = SceneState(**scene)
        self.scene.restore_shortening(self.state.shortening)


def get_motion_state(motion: SoftMotion) -> dict[str, np.ndarray]:
    """Return MuJoCo's state and the arrays of the bodies beside it."""
    return {name: a.copy() for name, a in _body_arrays(motion).items()} | {"mujoco": get_mujoco_state(motion.model, motion.data)}


def set_motion_state(motion: SoftMotion, state: Mapping[str, np.ndarray]) -> None:
    """Continue from a saved state."""
    for name, array in _body_arrays(motion).items():
        array[:] = state[name]
    set_mujoco_state(motion.model, motion.data, state["mujoco"])


def _body_arrays(motion: SoftMotion) -> dict[str, np.ndarray]:
    """Return the arrays, by name, that the bodies change beside MuJoCo's state."""
    names = ("slip", "distal", "tension", "force")
    return {f"{name}_{k}": getattr(body, name) for k, body in enumerate(motion.bodies) for name in names}
