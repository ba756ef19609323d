"""One equilibrium at a time, for those who walk on their own way through commands and forces: data factories and estimators."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import typeof

from twin.soft.cables import Pulled
from twin.soft.newton import NONE, OWN, Found, Kept, Parts, State, Way, along
from twin.soft.room import room_for, undeformed

CLOSE = 2e-8  # m: a step after which a shape counts as found; with it goes some 1e-6 N


class Pull(NamedTuple):
    """What holds the tendons: their tensions (t,) N where `held` is not, else free lengths (t,) m; stretch (t,) m/N; the friction
    and pre-sliding travel of their route."""

    tension: np.ndarray
    held: np.ndarray
    free: np.ndarray
    stretch: np.ndarray
    mu: float
    presliding: float


class Burden(NamedTuple):
    """Forces on the free nodes (n_free, 3) N, and a wall (10,) as in `Loads`."""

    force: np.ndarray
    wall: np.ndarray


@dataclass
class Shape:
    """Where a body is: free nodes' displacements (n_free, 3) m, tensions (t,) N, slip states and lengths beyond each point; and the
    inverse of a tangent near it (3 n_free, 3 n_free) m/N, None before the first step and where it is not trusted."""

    u: np.ndarray
    tension: np.ndarray
    slip: np.ndarray
    beyond: np.ndarray
    inverse: np.ndarray | None = None

    def copy(self) -> Shape:
        inverse = None if self.inverse is None else self.inverse.copy()
        return replace(
            self, u=self.u.copy(), tension=self.tension.copy(), slip=self.slip.copy(), beyond=self.beyond.copy(), inverse=inverse
        )  # fmt: skip


class Solid:
    """A body's parts, and room to work in. One instance serves one thread."""

    def __init__(self, parts: Parts) -> None:
        self.parts, self._room, self._compiled = parts, room_for(parts, False), False

    @property
    def pulled(self) -> Pulled:
        """What the tendons did at the last shape that was settled."""
        return self._room.pulled

    def rest(self) -> Shape:
        """Undeformed, without tension."""
        state = undeformed(self.parts, np.empty((0, 0, 0, 6)))
        return Shape(state.u.reshape(-1, 3), state.tension, state.slip, state.beyond)

    def settle(self, shape: Shape, pull: Pull, burden: Burden, *, close: float = CLOSE) -> bool:
        """Bring `shape` to equilibrium. False, and `shape` as it was, where it is lost."""
        nq, one, nothing = shape.u.size, np.ones(1), np.empty(0)
        inverse = np.zeros((nq, nq), np.float32) if shape.inverse is None else shape.inverse.copy()
        state = State(
            shape.u.ravel().copy(), shape.tension.copy(), shape.slip.copy(), shape.beyond.copy(), np.empty((0, 0, 0, 6)), inverse,
            np.array([NONE if shape.inverse is None else OWN]),
        )  # fmt: skip
        way = Way(
            pull.tension[None].copy(), pull.free[None].copy(), _plain(pull.held), pull.stretch[None].copy(), _plain(burden.force),
            _plain(burden.wall), one, float(pull.mu), float(pull.presliding), np.zeros(1), nothing, nothing, close, False, True,
        )  # fmt: skip
        nothing_kept = Kept(np.empty((0, nq)), np.empty((0, len(state.tension))), np.empty((0, nq, nq), np.float32))
        found = Found(
            np.empty((1, nq)), np.empty((1, len(state.tension))), np.empty((1, len(state.tension))), nothing_kept.inverse,
            np.zeros(1, bool),
        )  # fmt: skip
        problem = self.parts, way, nothing_kept, 0, state, found, self._room
        if not self._compiled:  # else numba takes what it compiled before for other arrays, and the last bits depend on that
            along.compile(tuple(map(typeof, problem)))
            self._compiled = True
        if along(*problem) == 0:
            return False
        shape.u, shape.tension, shape.slip, shape.beyond = state.u.reshape(-1, 3), state.tension, state.slip, state.beyond
        shape.inverse = state.inverse if state.has[0] == OWN else None
        return True


def _plain(array: np.ndarray) -> np.ndarray:
    """The array by rows and writable: one kind of array, one compiled function."""
    return np.require(array, requirements=["C", "W"])
