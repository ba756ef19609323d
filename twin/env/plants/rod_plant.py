"""A backbone stepped in time under commands that are chosen step by step.

It moves by MuJoCo's steps, or from one static equilibrium to the next, which is ten times faster for a robot moved slowly.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from twin.body import Drive, Loads, Problem
from twin.env.episodes.validation import select_arrays
from twin.env.plants.effect_io import EffectIO
from twin.foundation.errors import SolveError
from twin.mechanics.rod.balance.newton import update_kinematics
from twin.mechanics.rod.dynamics import ChainMotion, Dynamics, MotionSamples
from twin.prediction.prepared import ROOM_TEMPERATURE
from twin.prediction.twin import Twin


class RodReadings(NamedTuple):
    """Readings of the sensors at one instant.

    Tension (n_tendon,) N, displacement (n_tendon,) m, markers (n_marker, 3) m; and the true place of the tip, (3,) m of the base
    frame.
    """

    tension: np.ndarray
    displacement: np.ndarray
    markers: np.ndarray
    tip: np.ndarray


class DynamicRod(ChainMotion):
    """A chain in motion whose state can be saved."""

    def get_state(self) -> dict[str, np.ndarray]:
        """Return MuJoCo's state and the arrays that the motion keeps beside it."""
        return {name: a.copy() for name, a in self._arrays().items()} | {
            "mujoco": get_mujoco_state(self.model, self.data), "reached": np.array(self._motion.reached),
            "taken": np.array(self._motion.taken),
        }  # fmt: skip

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a saved state."""
        for name, array in self._arrays().items():
            array[:] = state[name]
        set_mujoco_state(self.model, self.data, state["mujoco"])
        self._motion = self._motion._replace(reached=float(state["reached"]), taken=int(state["taken"]))
        update_kinematics(self._system, self.state.q)

    def _arrays(self) -> dict[str, np.ndarray]:
        """Return the arrays, by name, that the motion changes beside MuJoCo's state."""
        actuation = self._held.actuation._asdict()
        found = {f"actuation_{name}": a for name, a in actuation.items() if isinstance(a, np.ndarray) and a.dtype == float}
        found |= {f"chain_{name}": a for name, a in self.state._asdict().items()}
        found |= {name: getattr(self._held, name) for name in ("stiffness", "band", "bowing", "total_tension")}
        return found | {"delayed": self._creep.delayed, "rest": self.model.qpos_spring}


class QuasiStaticRod:
    """A body at rest at each interval's end, with slip and creep along its way.

    The whole way is solved again each time, since a solve starts from the unloaded robot: a sample takes some 40 us, so that 20
    intervals of 0.2 s take 12 ms where MuJoCo's steps take 180.
    """

    def __init__(self, dynamics: Dynamics, problem: Problem) -> None:
        self._statics, self._problem = dynamics.statics, problem
        self._time, self._command = np.zeros(0), np.zeros((0, problem.command.shape[1]))

    def run(self, time: np.ndarray, command: np.ndarray, ambient: np.ndarray) -> tuple[MotionSamples, int, str]:
        """Continue as `ChainMotion.run`, in a room at `ROOM_TEMPERATURE`."""
        known = max(0, len(self._time) - 1)  # the last sample is solved again: a current holds from there on
        self._time, self._command = np.append(self._time[:known], time), np.vstack([self._command[:known], command])
        n, rows, problem = len(self._time), slice(-len(time), None), self._problem
        stiffness = np.full(n, 1.0 if problem.stiffness is None else problem.stiffness[0])
        heating = None if problem.heating is None else replace(problem.heating, ambient=np.full(n, ROOM_TEMPERATURE))
        path = self._statics.solve(replace(problem, time=self._time, command=self._command, stiffness=stiffness, heating=heating))
        found = bool(path.start_status) and bool(path.status[rows].all())
        unit, factor = problem.drives[0].display_unit
        pulls = ", ".join(f"{factor * c:.4g}" for c in command[-1])
        seen = MotionSamples(
            path.markers[rows], path.path[rows], path.tension[rows], path.others["temperature"][rows], path.q[rows]
        )
        return seen, len(time) if found else 0, "" if found else f"no equilibrium under {pulls} {unit} at t = {time[-1]:.4g} s"

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the times and commands so far."""
        return {"time": self._time.copy(), "command": self._command.copy()}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue after these times and commands."""
        self._time, self._command = state["time"].copy(), state["command"].copy()


class RodPlant:
    """A body whose tendons are all driven alike at equal intervals, by tensions as load cells read them, displacements, or currents
    through springs.

    One instance serves one thread.
    """

    def __init__(
        self, twin: Twin, interval: float, payload: float = 0.0, dynamic: bool = True, drive: Drive = Drive.TENSION
    ) -> None:
        """Start at rest, slack or with cold springs, under gravity and `payload` (kg).

        Raises DataError for a robot without a backbone, or without springs for currents to heat, SolveError where the load has no
        equilibrium.
        """
        self.twin, self.interval, self.body = twin, interval, twin.robot.chain(twin.body())
        effect_chain, n = twin.effect_chain, twin.robot.n_tendon
        dynamics = Dynamics(self.body)
        room = np.full(1, ROOM_TEMPERATURE)
        loads, stiffness = effect_chain.surround(Loads(twin.robot.gravity, payload)), effect_chain.stiffness(room, np.zeros(1))
        heating = twin.heating(room) if drive is Drive.CURRENT else None
        problem = Problem(
            np.zeros(1), np.zeros((1, n)), loads, effect_chain.route, (drive,) * n, effect_chain.creep, stiffness=stiffness,
            heating=heating,
        )  # fmt: skip
        self.motion = (DynamicRod if dynamic else QuasiStaticRod)(dynamics, problem)
        self._straight, self._route = dynamics.straight_path, effect_chain.route
        self._effect_io = EffectIO(effect_chain, drive, self.body)
        actuated = self._effect_io.apply_to_command(0.0, np.zeros(n))
        seen, samples, lost = self.motion.run(np.zeros(1), actuated[None], room)
        if samples < 1:
            raise SolveError(lost)
        self._record(seen, 0)

    def step(self, command: np.ndarray) -> RodReadings:
        """Step one interval on, towards tensions or displacements `command` (n_tendon,) N or m, or under constant currents (A).

        Raises SolveError where the motion is lost.
        """
        self._effect_io.apply_to_command(self._effect_io.time[-1] + self.interval, command)
        seen, samples, lost = self.motion.run(
            np.array(self._effect_io.time[-2:]), np.array(self._effect_io.actuated[-2:]), np.full(2, ROOM_TEMPERATURE)
        )
        if samples < 2:
            raise SolveError(lost)
        self._record(seen, 1)
        return self.readings()

    def readings(self) -> RodReadings:
        """Return the sensors' readings now."""
        sensed = self._effect_io.read_sensors()
        return RodReadings(sensed.tension[-1], sensed.displacement[-1], sensed.markers[-1], self._tip)

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the state as arrays by name."""
        parts = {"effects": self._effect_io.get_state(), "motion": self.motion.get_state()}
        arrays = {f"{part}.{name}": a for part, group in parts.items() for name, a in group.items()}
        return arrays | {"tip": self._tip.copy(), "q": self.q.copy()}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a saved state of a plant with the same twin and settings."""
        self._effect_io.set_state(select_arrays(state, "effects"))
        self.motion.set_state(select_arrays(state, "motion"))
        self._tip, self.q = state["tip"].copy(), state["q"].copy()

    def _record(self, seen: MotionSamples, i: int) -> None:
        """Record the true signals of sample i."""
        self._tip, self.q = seen.markers[i, -1], seen.q[i]
        travel = self._straight - seen.path[i] + self._route.elongation(seen.tension[i])
        self._effect_io.record_truth(seen.tension[i], travel, self.body.frame.to_marker_frame(seen.markers[i]))


def get_mujoco_state(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return all of MuJoCo's state that its steps integrate."""
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    return state


def set_mujoco_state(model: mujoco.MjModel, data: mujoco.MjData, state: np.ndarray) -> None:
    """Set a state that `get_mujoco_state` returned."""
    mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
