"""One equilibrium at a time, for callers that choose commands and forces step by step, such as estimators."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import typeof

from twin.body import Route
from twin.mechanics.silicone.body import SoftBody
from twin.mechanics.silicone.cables import TendonForces
from twin.mechanics.silicone.newton import (
    NO_TANGENT,
    NODE_TOLERANCE,
    OWN_TANGENT,
    BodyArrays,
    NewtonProblem,
    SoftNeighbour,
    SoftResult,
    SoftState,
    solve_samples,
)
from twin.mechanics.silicone.solver_arrays import undeformed_state, work_arrays

MOVE_TOLERANCE = 1e-7  # m, last step of a shape that is only passed
SMALLEST_MOVE_PART = 1 / 64  # of a move
NO_WALL = np.zeros(10)
PLAIN_ROUTE = Route()


class TendonPull(NamedTuple):
    """State of the tendons' drives, and friction of their route.

    Tensions (t,) N where `held` is false, else free lengths (t,) m; compliance (t,) m/N; friction coefficient and pre-sliding
    travel (m).
    """

    tension: np.ndarray
    held: np.ndarray
    free_length: np.ndarray
    stretch: np.ndarray
    mu: float
    presliding: float


class NodeLoad(NamedTuple):
    """Forces on the free nodes (n_free, 3) N, and a wall (10,) as in `Loads`."""

    force: np.ndarray
    wall: np.ndarray


@dataclass
class SoftShape:
    """State of a body: free nodes' displacements (n_free, 3) m, tensions (t,) N, slip states and lengths distal of each point.

    `inverse` (3 n_free, 3 n_free) m/N is that of a tangent near it, None before the first step and where it is not reliable.
    """

    u: np.ndarray
    tension: np.ndarray
    slip: np.ndarray
    distal: np.ndarray
    inverse: np.ndarray | None = None

    def copy(self) -> SoftShape:
        """Return a deep copy."""
        inverse = None if self.inverse is None else self.inverse.copy()
        return replace(
            self, u=self.u.copy(), tension=self.tension.copy(), slip=self.slip.copy(), distal=self.distal.copy(), inverse=inverse
        )  # fmt: skip


class SoftEquilibrium:
    """A body's arrays and work arrays. One instance serves one thread."""

    def __init__(self, arrays: BodyArrays) -> None:
        self.arrays, self._work, self._compiled = arrays, work_arrays(arrays, False), False

    @property
    def tendons(self) -> TendonForces:
        """The tendons at the last shape solved."""
        return self._work.tendons

    def undeformed(self) -> SoftShape:
        """Return the undeformed shape, without tension."""
        state = undeformed_state(self.arrays, np.empty((0, 0, 0, 6)))
        return SoftShape(state.u.reshape(-1, 3), state.tension, state.slip, state.distal)

    def solve(self, shape: SoftShape, pull: TendonPull, load: NodeLoad, *, close: float = NODE_TOLERANCE) -> bool:
        """Bring `shape` to equilibrium, to a last step of `close` (m). Return False, and leave `shape` as it was, on failure."""
        nq, one, nothing = shape.u.size, np.ones(1), np.empty(0)
        inverse = np.zeros((nq, nq), np.float32) if shape.inverse is None else shape.inverse.copy()
        state = SoftState(
            shape.u.ravel().copy(), shape.tension.copy(), shape.slip.copy(), shape.distal.copy(), np.empty((0, 0, 0, 6)), inverse,
            np.array([NO_TANGENT if shape.inverse is None else OWN_TANGENT]),
        )  # fmt: skip
        newton_problem = NewtonProblem(
            pull.tension[None].copy(), pull.free_length[None].copy(), _contiguous(pull.held), pull.stretch[None].copy(),
            _contiguous(load.force), _contiguous(load.wall), one, float(pull.mu), float(pull.presliding), np.zeros(1), nothing,
            nothing, close, False, True,
        )  # fmt: skip
        no_neighbour = SoftNeighbour(np.empty((0, nq)), np.empty((0, len(state.tension))), np.empty((0, nq, nq), np.float32))
        result = SoftResult(
            np.empty((1, nq)), np.empty((1, len(state.tension))), np.empty((1, len(state.tension))), no_neighbour.inverse,
            np.zeros(1, bool),
        )  # fmt: skip
        problem = self.arrays, newton_problem, no_neighbour, 0, state, result, self._work
        if not self._compiled:  # else numba may reuse code compiled for other array layouts, and the last bits depend on that
            solve_samples.compile(tuple(map(typeof, problem)))
            self._compiled = True
        if solve_samples(*problem) == 0:
            return False
        shape.u, shape.tension, shape.slip, shape.distal = state.u.reshape(-1, 3), state.tension, state.slip, state.distal
        shape.inverse = state.inverse if state.source[0] == OWN_TANGENT else None
        return True


def nodal_weight(body: SoftBody, gravity: np.ndarray) -> np.ndarray:
    """Return the nodes' weight, (n_free, 3) N."""
    return np.outer(body.lattice.volume, body.density * gravity)


def hang_at_rest(solid: SoftEquilibrium, shape: SoftShape, weight: np.ndarray) -> np.ndarray:
    """Bring `shape` to its hanging rest, with slack tendons. Return the tendons' path lengths (t,) m there."""
    nt = len(shape.tension)
    slack = TendonPull(np.zeros(nt), np.zeros(nt, bool), np.zeros(nt), np.zeros(nt), 0.0, 1.0)
    solid.solve(shape, slack, NodeLoad(weight, NO_WALL))
    return solid.tendons.path.copy()


DrivenState = tuple[np.ndarray, np.ndarray]  # tendon displacements (t,) m, forces on the free nodes (n_free, 3) N


def move_equilibrium(
    solid: SoftEquilibrium, shape: SoftShape, hanging: np.ndarray, start: DrivenState, goal: DrivenState,
    route: Route = PLAIN_ROUTE, close: float = MOVE_TOLERANCE,
) -> tuple[SoftShape, bool]:  # fmt: skip
    """Move from one state to another, in ever smaller parts where Newton's method fails.

    `hanging` (t,) m are the path lengths from which displacements count; `close` (m) is the last step. Returns the last shape
    found, and whether it is the goal's.
    """
    nt, done, part = len(hanging), 0.0, 1.0
    held, zero, stretch = np.ones(nt, bool), np.zeros(nt), np.full(nt, route.stretch)
    while done < 1.0:
        trial, to = shape.copy(), min(1.0, done + part)
        at, force = (a + to * (b - a) for a, b in zip(start, goal, strict=True))
        pull = TendonPull(zero, held, hanging - at, stretch, route.mu, route.presliding)
        if solid.solve(trial, pull, NodeLoad(force, NO_WALL), close=close):
            shape, done, part = trial, to, 2.0 * part
            continue
        part, shape.inverse = 0.5 * part, None
        if part < SMALLEST_MOVE_PART:
            return shape, False
    return shape, True


def _contiguous(array: np.ndarray) -> np.ndarray:
    """Return the array C-contiguous and writable, so that one compiled function serves all."""
    return np.require(array, requirements=["C", "W"])
