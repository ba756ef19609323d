"""Equilibrium of the robot under its drive: virtual work balanced by Newton, followed step by step along a trial."""

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.simulators.second_rod.loom import SLIDERS, Loom, drag
from tools.simulators.second_rod.mechanics.contact import Obstacle, push
from tools.simulators.second_rod.mechanics.fields import Jet, Magnet, blow, repel
from tools.simulators.second_rod.mechanics.rod import INTERVALS, PIECES_PER_INTERVAL, ROD_NODES, Rod, cross, imbalance, shape
from tools.simulators.second_rod.mechanics.tendons import ROD_TENDONS, Tendons, pull, segments, tensions

BALANCED = 2e-9  # N m, norm over q; EI / L is 1.3e-2 N m, so the shape is exact to 1e-6 rad
NEARLY_BALANCED = 1e-7  # N m: accepted where a corner (slack, a reversal) stops Newton short
ROD_NEWTON_STEPS = 60
STALLS = 6  # steps taken without descent, across a corner, before giving up
LARGEST_STEP = 0.5  # rad, of any coefficient in one step
DIFFERENCE = 3e-8  # rad, for the Jacobian by differences: a tendon just going slack changes stiffness within 1e-5 rad
STEP_HALVINGS = 6  # of a step of the loads that does not converge


class Model(NamedTuple):
    """A built robot for the compiled functions; SI units."""

    rod: Rod
    tendons: Tendons
    disk_masses: np.ndarray  # (INTERVALS,) kg
    outboard: np.ndarray  # (2,) mass beyond the tip, kg, and its lever along the tip's axis, m
    obstacle: Obstacle
    magnet: Magnet
    jet: Jet
    loom: Loom


class Loads(NamedTuple):
    """What acts from outside."""

    drive: np.ndarray  # (ROD_TENDONS,) N, or m pulled in
    gravity: np.ndarray  # (3,) m/s^2
    payload: float  # kg at the tip disk


class Memory(NamedTuple):
    """What the robot remembers from one equilibrium to the next."""

    mobilised: np.ndarray  # (ROD_TENDONS, INTERVALS) friction's z
    beyond: np.ndarray  # (ROD_TENDONS, INTERVALS) tendon length beyond each hole, m
    anchors: np.ndarray  # (SLIDERS, 3) m


class Problem(NamedTuple):
    """All that an equilibrium depends on."""

    model: Model
    rest: np.ndarray  # (3 n) coefficients without stress
    stiffness: float  # factor on the rod's stiffnesses
    loads: Loads
    memory: Memory


def empty_memory() -> Memory:
    """Return a memory of nothing, to be filled."""
    return Memory(np.zeros((ROD_TENDONS, INTERVALS)), np.zeros((ROD_TENDONS, INTERVALS)), np.zeros((SLIDERS, 3)))


@njit(cache=True)
def residual(coefficients, problem, after):
    """Return the imbalance (3 n) N m, and tensions (ROD_TENDONS,) N at the load cells; what is remembered goes into `after`."""
    model, rest, stiffness, loads, memory = problem
    pose = shape(coefficients, model.rod)
    rotations, positions = pose.rotations, pose.positions
    directions, lengths = segments(rotations, positions, model.tendons.holes)
    along, base = tensions(directions, lengths, loads.drive, model.tendons, memory, after)
    forces, moments = np.zeros((ROD_NODES, 3)), np.zeros((ROD_NODES, 3))
    pull(rotations, directions, along, model.tendons.holes, forces, moments)
    tip = ROD_NODES - 1
    at_tip = loads.payload + model.outboard[0] + model.loom.mass
    for axis in range(3):
        for node in range(0, ROD_NODES, 2):
            forces[node, axis] += model.rod.masses[node] * loads.gravity[axis]
        for disk in range(INTERVALS):
            forces[(disk + 1) * PIECES_PER_INTERVAL, axis] += model.disk_masses[disk] * loads.gravity[axis]
        forces[tip, axis] += at_tip * loads.gravity[axis]
    lever = cross(rotations[tip, :, 2], loads.gravity)
    for axis in range(3):
        moments[tip, axis] += model.outboard[0] * model.outboard[1] * lever[axis]
    if model.obstacle.kind > 0:
        push(positions, model.obstacle, forces)
    if model.magnet.energy > 0:
        repel(positions[tip], model.magnet, forces[tip])
    if model.jet.drag > 0:
        blow(rotations, positions, model.jet, forces)
    drag(positions[tip], model.loom, memory.anchors, after.anchors, forces[tip])
    return imbalance(rest, stiffness, model.rod, pose, forces, moments), base


@njit(cache=True)
def inverse_jacobian(coefficients, value, problem, after):
    """Return the inverse of the residual's derivative (3 n, 3 n), by differences from `value`, the residual there."""
    size = coefficients.size
    jacobian = np.empty((size, size))
    moved = coefficients.copy()
    for k in range(size):
        moved[k] = coefficients[k] + DIFFERENCE
        there, _ = residual(moved, problem, after)
        for row in range(size):
            jacobian[row, k] = (there[row] - value[row]) / DIFFERENCE
        moved[k] = coefficients[k]
    return np.linalg.inv(jacobian)


@njit(cache=True)
def norm(vector):
    """Return the Euclidean norm, summed in order."""
    total = 0.0
    for value in vector:
        total += value * value
    return np.sqrt(total)


@njit(cache=True)
def solve(coefficients, problem, after, inverse, known):
    """Newton from `coefficients` (3 n): the root, whether it is one, tensions at the load cells, the last inverse Jacobian.

    `known`: the inverse Jacobian given is from nearby and worth a try; it is made anew when it no longer brings much.
    """
    value, _ = residual(coefficients, problem, after)
    error, fresh, stalls = norm(value), False, 0
    for _ in range(ROD_NEWTON_STEPS):
        if error < BALANCED:
            break
        if not known:
            inverse = inverse_jacobian(coefficients, value, problem, after)
            known = fresh = True
        change = np.zeros(coefficients.size)
        for row in range(coefficients.size):
            for k in range(coefficients.size):
                change[row] -= inverse[row, k] * value[k]
        share = min(1.0, LARGEST_STEP / max(np.max(np.abs(change)), 1e-12))
        tried, there, left = coefficients, value, error
        for _ in range(10 if fresh else 1):
            tried = coefficients + share * change
            there, _ = residual(tried, problem, after)
            left = norm(there)
            if left < error * (1 - 0.1 * share):
                break
            share *= 0.5
        descends = left < error
        if not descends and not fresh:
            known = False
            continue
        if not descends:
            stalls += 1
            if error < NEARLY_BALANCED or stalls > STALLS:
                break
        known = descends and left < 0.25 * error
        fresh = False
        coefficients, value, error = tried, there, left
    _, base = residual(coefficients, problem, after)
    return coefficients, error < NEARLY_BALANCED, base, inverse


class Equilibrium:
    """One trial's equilibrium, from the straight, unloaded robot on. `failures`: steps that no halving brought to balance."""

    def __init__(self, model: Model) -> None:
        size = 3 * model.rod.basis.shape[1]
        self.model = model
        self.rest = np.zeros(size)
        self.coefficients = np.zeros(size)
        self.tensions = np.zeros(ROD_TENDONS)
        self.failures = 0
        self.memory = empty_memory()
        self.memory.anchors[:, 2] = model.rod.length
        rotations, positions, _, _ = shape(self.coefficients, model.rod)
        _, lengths = segments(rotations, positions, model.tendons.holes)
        self.memory.beyond[:] = np.cumsum(lengths[:, ::-1], axis=1)[:, ::-1]
        self._inverse, self._known = np.eye(size), False
        self._last = Loads(np.zeros(ROD_TENDONS), np.zeros(3), 0.0)

    def start(self, loads: Loads, stiffness: float, steps: int) -> None:
        """Gravity and payload first, then the drive, in so many steps (nominal.md: applied slowly)."""
        idle = np.zeros(ROD_TENDONS)
        for share in np.linspace(0, 1, 5)[1:]:
            self.step(Loads(idle, share * loads.gravity, share * loads.payload), stiffness)
        for share in np.linspace(0, 1, steps + 1)[1:]:
            self.step(loads._replace(drive=share * loads.drive), stiffness)

    def step(self, loads: Loads, stiffness: float, halvings: int = STEP_HALVINGS) -> None:
        """To the equilibrium under new loads; by halves where Newton does not get there at once."""
        after = empty_memory()
        problem = Problem(self.model, self.rest, stiffness, loads, self.memory)
        found, balanced, base, inverse = solve(self.coefficients, problem, after, self._inverse, self._known)
        balanced = balanced and bool(np.all(np.isfinite(found)))
        if not balanced and halvings > 0:
            last = self._last
            middle = Loads((last.drive + loads.drive) / 2, (last.gravity + loads.gravity) / 2, (last.payload + loads.payload) / 2)
            for part in (middle, loads):
                self._known = False
                self.step(part, stiffness, halvings - 1)
            return
        self.failures += not balanced
        self.coefficients, self.tensions, self.memory = found, base, after
        self._inverse, self._known, self._last = inverse, balanced, loads

    def disks(self) -> tuple[np.ndarray, np.ndarray]:
        """Centres (INTERVALS, 3) m of the disks and their axes (INTERVALS, 3)."""
        rotations, positions, _, _ = shape(self.coefficients, self.model.rod)
        return positions[PIECES_PER_INTERVAL::PIECES_PER_INTERVAL], rotations[PIECES_PER_INTERVAL::PIECES_PER_INTERVAL, :, 2]

    def pulled_in(self) -> np.ndarray:
        """(ROD_TENDONS,) rest path length - path length, m."""
        rotations, positions, _, _ = shape(self.coefficients, self.model.rod)
        _, lengths = segments(rotations, positions, self.model.tendons.holes)
        return self.model.tendons.rest_lengths - lengths.sum(1)
