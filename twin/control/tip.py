"""The tip along a path: wanted tip -> tensions -> voltages, three springs.

At every step the shape is estimated from load cells and tendon displacements (`TensionShape`: the payload and the friction
coefficient found along). Every PERIOD the tensions for the wanted tip are found by inverse kinematics, the robot starting with the
friction it has met so far:

    tip* = wanted AHEAD s later + v + (tip of the model - tip estimated),   dv/dt = (wanted - tip estimated)/T_I

A path is known before it is gone, and springs are late: 25 K of their loop take some 2 s up and 8 s down before tension turns.

What a spring can do bounds them. Cold, it holds its plateau (1.9 N at rest here): less is no equilibrium that heat controls, so all
targets are at least that and a margin: the springs pull against each other, and bending goes both ways. A spring lets go slowly:
none is asked for less than it has now less DROP, and the others pull against it until it has cooled. Hot, it pulls at most E_A
times its elongation, which shrinks while it bends the robot: that, with the two others' plateaus, bounds the bend at some 0.4 rad
(tip 24 mm off the axis, less with a payload that hangs).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from twin.control.tension import passive
from twin.effects import Loads
from twin.kinematics import LoadedRobot, inverse
from twin.kinematics.robot import ROOM
from twin.shape import TensionShape
from twin.springs import Spring
from twin.twin import Twin

PERIOD = 0.2  # s, between two inverse solves
AHEAD = 3.0  # s: of 2 to 5 s tried on four unloaded paths, where the worst of them is best
MARGIN = 0.1  # N, above the cold plateau
DROP = 0.25  # N, that a spring lets go at most while PERIOD passes, cooling at 3 K/s
LIMIT = 4.0  # N
THERE = 0.15  # N: tensions further from their targets say nothing about what is wrong with these
DISPLACEMENT = (
    1e-3  # m, of each reading, to the filter: cells and friction are wrong by a steady 0.2 mm of travel, 20 times a second
)
FURTHEST = 6e-3  # m: of the integral


class Loop(Protocol):
    """A tension loop: `TensionLoop` or `PlainLoop`."""

    def step(
        self, target: np.ndarray, tension: np.ndarray, elongation: np.ndarray, dt: float, temperature: np.ndarray | None = None
    ) -> np.ndarray: ...


def springs(twin: Twin, ambient: float = ROOM) -> Spring:
    """The twin's springs, its effects on them included. Raises DataError for a robot without springs."""
    return twin.heating(np.full(1, ambient)).spring


class TipController:
    """Start it with the robot at rest."""

    def __init__(
        self,
        twin: Twin,
        loads: Loads,
        loop: Loop,
        *,
        doubts: Mapping[str, float] | None = None,
        reset: float | None = 4.0,
    ) -> None:
        """`loads` as far as known; `doubts` as of `TensionShape`. `reset` is T_I in seconds; None leaves shape feedback out, and
        then nothing but the load cells corrects the model."""
        self.loop, self.reset, self.spring = loop, reset, springs(twin)
        self.shape = TensionShape(twin, loads, doubts or {}, displacement_noise=DISPLACEMENT) if reset is not None else None
        self.robot = self.shape.robot if self.shape is not None else LoadedRobot(twin, loads)
        self.tip_marker = int(np.argmin(np.linalg.norm(self.robot.shape().markers - self.robot.shape().tip, axis=1)))
        self.length = self.robot.length
        self.target = np.zeros(self.robot.n_tendon)
        self.sum, self.tip, self.age = np.zeros(3), self.robot.shape().tip, np.inf

    def step(
        self,
        wanted: np.ndarray,
        tension: np.ndarray,
        displacement: np.ndarray,
        dt: float,
        temperature: np.ndarray | None = None,
        ahead: np.ndarray | None = None,
    ) -> np.ndarray:
        """Voltages (n_tendon,) V to hold for dt seconds, towards the tip `wanted` (3,) m now and, where the path is known, `ahead`
        (3,) m AHEAD s later, from load cells (n_tendon,) N, tendon displacements (n_tendon,) m and, where there are, thermometers
        (n_tendon,) K. Raises SolveError as `TensionShape`."""
        tension, displacement = np.maximum(tension, 0.0), np.asarray(displacement, float)
        elongation = self.spring.initial_elongation - displacement
        lead = self._sensed(wanted, tension, displacement, dt)
        self.age += dt
        if self.age >= PERIOD:
            self.age = 0.0
            least = np.maximum(passive(self.spring, elongation, ROOM) + MARGIN, tension - DROP)
            aim = (wanted if ahead is None else ahead) + self.sum - lead
            self.target = inverse(self.robot, aim, limit=LIMIT, within=2e-3, resting=least).tension
        return self.loop.step(self.target, tension, elongation, dt, temperature)

    def _sensed(self, wanted: np.ndarray, tension: np.ndarray, displacement: np.ndarray, dt: float) -> np.ndarray:
        """The robot moved to what is measured, the integral too; how far the estimated tip is from the robot's (3,) m."""
        if self.shape is None or self.reset is None:
            self.tip = self.robot.pull(tension).tip
            return np.zeros(3)
        tip = self.shape.update(tension, displacement).markers[self.tip_marker]
        self.tip = tip + self._left(tip, displacement)
        if np.abs(self.target - tension).max() < THERE:
            self.sum = np.clip(self.sum + dt / self.reset * (wanted - self.tip), -FURTHEST, FURTHEST)
        return self.tip - self.robot.shape().tip

    def _left(self, tip: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """What the displacements still say of the tip (3,) m when the estimate has done what its doubts allow: a tendon shortens by
        its lever arm times the bend towards it, and the tip moves as that of a bend of constant curvature."""
        assert self.shape is not None
        predicted = self.robot.shape().displacement
        for share, sister in zip(self.shape.x, self.shape.sisters, strict=True):
            predicted = predicted + share * (sister.shape().displacement - self.robot.shape().displacement)
        more = np.linalg.lstsq(self.robot.levers[0], displacement - predicted, rcond=None)[0]  # rad, towards x and y
        length = float(np.hypot(*tip[:2]))
        bend = 2.0 * np.arctan2(length, tip[2]) * (tip[:2] / length if length > 0.0 else np.zeros(2))
        return bent(bend + more, self.length) - bent(bend, self.length)


def bent(bend: np.ndarray, length: float) -> np.ndarray:
    """Tip (3,) m of a rod of `length` m that bends by a constant curvature, in all by (2,) rad towards x and y."""
    theta = float(np.hypot(*bend))
    if theta < 1e-6:
        return np.array([0.5 * length * bend[0], 0.5 * length * bend[1], length])
    across = length * (1.0 - np.cos(theta)) / theta
    return np.array([across * bend[0] / theta, across * bend[1] / theta, length * np.sin(theta) / theta])
