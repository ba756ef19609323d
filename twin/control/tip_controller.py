"""Control the tip along a path: wanted tip -> tensions -> voltages, three springs.

At every step the shape is estimated from load cells and tendon displacements (`TensionShapeFilter`, which also estimates the
payload and the friction coefficient). Every INVERSE_SOLVE_PERIOD the tensions for the wanted tip are found by inverse kinematics,
from the robot with its friction history:

    tip* = wanted some time later + v + (tip of the model - tip estimated),   dv/dt = (wanted - tip estimated)/T_I

A path is known ahead, and springs are late: 25 K of their loop take some 2 s up and 8 s down before tension turns.

The springs' range bounds the tensions. Cold, a spring holds its plateau (1.9 N at rest here): less is no equilibrium that heat
controls, so all targets are at least that and a margin: the springs pull against each other, and bending goes both ways. A spring
relaxes slowly: its target is at least its present tension less LARGEST_TENSION_DROP, and the others pull against it until it has
cooled. Hot, it pulls at most E_A times its elongation, which shrinks while it bends the robot: that, with the two others' plateaus,
bounds the bend at some 0.4 rad (tip 24 mm off the axis, less with a payload that hangs).
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from twin.body import Loads
from twin.body.drives.spring import Spring
from twin.control.tension_loop import cold_tension
from twin.prediction.kinematics import LoadedRobot, inverse
from twin.prediction.kinematics.loaded_robot import ROOM_TEMPERATURE
from twin.prediction.twin import Twin
from twin.shape import TensionShapeFilter

INVERSE_SOLVE_PERIOD = 0.2  # s
PATH_LOOK_AHEAD = 3.0  # s: the best worst case of 2 to 5 s on four unloaded paths
COLD_TENSION_MARGIN = 0.1  # N, above the cold plateau
LARGEST_TENSION_DROP = 0.25  # N, by which a spring relaxes in one period, cooling at 3 K/s
HIGHEST_TENSION = 4.0  # N
TENSION_REACHED = 0.15  # N: with tensions further from their targets the integral stops
READING_ERROR = (
    1e-3  # m, of each reading, to the filter: cells and friction are wrong by a steady 0.2 mm of travel, 20 times a second
)
LARGEST_INTEGRAL = 6e-3  # m


class TensionControl(Protocol):
    """A tension loop, such as `TensionLoop`."""

    def step(
        self, target: np.ndarray, tension: np.ndarray, elongation: np.ndarray, dt: float, temperature: np.ndarray | None = None
    ) -> np.ndarray: ...


def twin_springs(twin: Twin, ambient: float = ROOM_TEMPERATURE) -> Spring:
    """Return the twin's springs with its effects on them. Raises DataError for a robot without springs."""
    return twin.heating(np.full(1, ambient)).spring


class TipController:
    """Controller of one robot, which starts at rest."""

    def __init__(
        self,
        twin: Twin,
        loads: Loads,
        loop: TensionControl,
        *,
        doubts: Mapping[str, float] | None = None,
        reset: float | None = 4.0,
    ) -> None:
        """`loads` as far as known; `doubts` as of `TensionShapeFilter`.

        `reset` is T_I in seconds; None disables shape feedback, and then only the load cells correct the model.
        """
        self.loop, self.reset, self.spring = loop, reset, twin_springs(twin)
        self.estimator = (
            TensionShapeFilter(twin, loads, doubts or {}, displacement_noise=READING_ERROR) if reset is not None else None
        )
        self.robot = self.estimator.robot if self.estimator is not None else LoadedRobot(twin, loads)
        self.tip_marker = int(np.argmin(np.linalg.norm(self.robot.shape().markers - self.robot.shape().tip, axis=1)))
        self.length = self.robot.length
        self.target = np.zeros(self.robot.n_tendon)
        self.integral, self.tip, self.age = np.zeros(3), self.robot.shape().tip, np.inf

    def step(
        self,
        wanted: np.ndarray,
        tension: np.ndarray,
        displacement: np.ndarray,
        dt: float,
        temperature: np.ndarray | None = None,
        ahead: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return voltages (n_tendon,) V to hold for dt seconds, towards the tip `wanted` (3,) m now.

        `ahead` (3,) m is the tip PATH_LOOK_AHEAD s later where the path is known. From load cells (n_tendon,) N, tendon
        displacements (n_tendon,) m and, where there are, thermometers (n_tendon,) K. Raises SolveError as `TensionShapeFilter`.
        """
        tension, displacement = np.maximum(tension, 0.0), np.asarray(displacement, float)
        elongation = self.spring.initial_elongation - displacement
        lead = self._update_estimate(wanted, tension, displacement, dt)
        self.age += dt
        if self.age >= INVERSE_SOLVE_PERIOD:
            self.age = 0.0
            least = np.maximum(
                cold_tension(self.spring, elongation, ROOM_TEMPERATURE) + COLD_TENSION_MARGIN, tension - LARGEST_TENSION_DROP
            )
            aim = (wanted if ahead is None else ahead) + self.integral - lead
            self.target = inverse(self.robot, aim, limit=HIGHEST_TENSION, within=2e-3, resting=least).tension
        return self.loop.step(self.target, tension, elongation, dt, temperature)

    def _update_estimate(self, wanted: np.ndarray, tension: np.ndarray, displacement: np.ndarray, dt: float) -> np.ndarray:
        """Move the robot and the integral to the measurements, and return the estimated tip's offset (3,) m from the robot's."""
        if self.estimator is None or self.reset is None:
            self.tip = self.robot.pull(tension).tip
            return np.zeros(3)
        tip = self.estimator.update(tension, displacement).markers[self.tip_marker]
        self.tip = tip + self._unexplained_motion(tip, displacement)
        if np.abs(self.target - tension).max() < TENSION_REACHED:
            self.integral = np.clip(self.integral + dt / self.reset * (wanted - self.tip), -LARGEST_INTEGRAL, LARGEST_INTEGRAL)
        return self.tip - self.robot.shape().tip

    def _unexplained_motion(self, tip: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Return the tip motion (3,) m in the displacements that the estimate leaves unexplained.

        A tendon shortens by its lever arm times the bend towards it, and the tip moves as that of a bend of constant curvature.
        """
        assert self.estimator is not None
        predicted = self.robot.shape().displacement
        for share, perturbed in zip(self.estimator.x, self.estimator.perturbed_robots, strict=True):
            predicted = predicted + share * (perturbed.shape().displacement - self.robot.shape().displacement)
        extra_bend = np.linalg.lstsq(self.robot.lever_arms[0], displacement - predicted, rcond=None)[0]  # rad, towards x and y
        length = float(np.hypot(*tip[:2]))
        bend = 2.0 * np.arctan2(length, tip[2]) * (tip[:2] / length if length > 0.0 else np.zeros(2))
        return bent_tip(bend + extra_bend, self.length) - bent_tip(bend, self.length)


def bent_tip(bend: np.ndarray, length: float) -> np.ndarray:
    """Return the tip (3,) m of a rod of `length` m that bends by a constant curvature, in all by (2,) rad towards x and y."""
    theta = float(np.hypot(*bend))
    if theta < 1e-6:
        return np.array([0.5 * length * bend[0], 0.5 * length * bend[1], length])
    across = length * (1.0 - np.cos(theta)) / theta
    return np.array([across * bend[0] / theta, across * bend[1] / theta, length * np.sin(theta) / theta])
