"""Silicone stepped in time under commanded tendon displacements, a finger alone or a hand among things it touches.

A finger is moved by MuJoCo's steps, not from one static equilibrium to the next: it then has mass and lag, all effects act (statics
from command to command, `twin.control.held`, knows neither creep nor loads but the weight), and no command is without an answer. An
interval of 48 ms took 11 ms so on a busy machine, an equilibrium 1.5 mm further 7 to 8 ms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.bench import ROOM
from twin.body import Problem
from twin.effects import Drive, Loads
from twin.env.wires import Wires
from twin.errors import DataError
from twin.soft.dynamics import Moving, Relaxed, Started, step_for
from twin.soft.flex import flex
from twin.soft.scene import Scene, Sight, Thing
from twin.soft.statics import turned
from twin.twin import Twin


class Felt(NamedTuple):
    """What sensors report at one instant: tension (t,) N, displacement (t,) m, resistance (s,) over that at no strain; and where
    the markers truly are, (m, 3) m of the base frame, the tip last."""

    tension: np.ndarray
    displacement: np.ndarray
    resistance: np.ndarray
    markers: np.ndarray


class FingerPlant:
    """A finger whose tendons motors hold at displacements, counted from hanging at rest. One instance serves one thread."""

    def __init__(self, twin: Twin, interval: float) -> None:
        """Hanging at rest; `interval` (s) is rounded to whole steps. Raises DataError for a robot that is no silicone finger,
        SolveError where it has no equilibrium."""
        body = twin.robot.silicone(twin.body())
        laws, n = twin.laws, body.n_tendon
        self.body, self._wires = body, Wires(laws, Drive.DISPLACEMENT, n)
        stiffness = laws.stiffness(np.full(1, ROOM), np.zeros(1))
        loads, at = laws.surround(Loads(twin.robot.gravity)), np.zeros((1, n))
        self._started = Started.of(
            body, Problem(np.zeros(1), at, loads, laws.route, self._wires.drives, laws.creep, stiffness=stiffness)
        )
        self.spec = flex(self._started.body, step_for(self._started.body))
        self.spec.option.gravity = loads.gravity @ turned(body.turn)
        self.moving = Moving.of(self.spec, [self._started], [""], ["the finger"])
        self._relaxed = Relaxed(self._started)
        self._steps = max(1, round(interval / self.moving.step))
        self.interval = self._steps * self.moving.step
        self._note(self._wires.driven(0.0, at[0]))

    def step(self, command: np.ndarray) -> Felt:
        """One interval on, motors going straight to what `command` (t,) m makes of them. Raises SolveError where the motion is
        lost."""
        base = self._wires.driven(self._wires.time[-1] + self.interval, command)
        self.moving.run(self._wires.base[-2][None], base[None], self._steps)
        self._relaxed.on(self.moving.limbs[0], self.moving.u(0).ravel(), self.interval)
        self._note(base)
        return self.felt()

    def felt(self) -> Felt:
        """As its sensors report it now."""
        seen = self._wires.sensed()
        resistance = seen.others["sensor"][-1] / self.body.cords.rest
        return Felt(seen.tension[-1], seen.displacement[-1], resistance, self.markers)

    def _note(self, base: np.ndarray) -> None:
        u, statics = self.moving.u(0)[None], self._started.statics
        self.markers = statics.markers(u)[0]
        others = {group: column[0] for group, column in statics.sensed(u).items()}
        self._wires.note(self.moving.limbs[0].tension.copy(), base, self.body.frame.reported(self.markers), others)


class HandPlant:
    """A hand and things, its pairs of antagonist tendons driven by servos. One instance serves one thread."""

    def __init__(self, twin: Twin, things: list[Thing], interval: float) -> None:
        """At rest, the servos at zero. Raises DataError for a robot that is no hand and for effects that do not act here,
        SolveError where it has no equilibrium."""
        body = twin.robot.hand(twin.body())
        idle = [e.id for e in twin.effects if e.acts_in("soften", "deform", "command", "drive", "sense")]
        if idle:
            raise DataError(f"effects {', '.join(idle)} do not act among things that the hand touches: remove them from the twin")
        loads = twin.laws.surround(Loads(twin.robot.gravity))
        if loads.payload or loads.force.any() or loads.wall[4]:
            raise DataError("a payload, a force or a wall does not act among things that the hand touches: remove that effect")
        self.body, self.scene = body, Scene(body, things, loads.gravity, twin.laws.route)
        self.interval = max(1, round(interval / self.scene.moving.step)) * self.scene.moving.step
        self.rest = np.stack([finger.cords.rest for finger in body.fingers])

    def step(self, servos: np.ndarray) -> Sight:
        """One interval on, the servos (finger, pair) m going straight to where they are told. Raises SolveError where the motion is
        lost."""
        return self.scene.step(servos, self.interval)
