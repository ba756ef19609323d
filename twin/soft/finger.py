"""A soft body ready to be solved: its lattice, silicone and tendons as arrays, and one equilibrium of it by Newton's method.

    f(u) + sum_t T_t pull_t(u) = F,       path_t - free_t - stretch_t T_t <= 0,  T_t >= 0,  one of them zero,

for tendons that motors hold at a length; for the others T_t is given. Steps are Newton's on shape and tensions at once, with a
tangent that is kept as long as it brings the residual down.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

from twin.soft.cables import Cables, Pulled, Slip, follow, geometric, sticking, unpulled
from twin.soft.neighbour import Room
from twin.soft.silicone import LEAST, Cells, Tangent, forces, stiffness
from twin.soft.wall import Skin, press

getrf, getrs, getri = get_lapack_funcs(("getrf", "getrs", "getri"), dtype=np.float64)
STEPS = 60
LONGEST = 6e-3  # m, of a step at any node
KEPT = 0.3  # a tangent is kept while a step leaves less than this share of the step before it
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
    """Forces on the free nodes (n_free, 3) N, a wall (5,) as in `Loads`, and relaxed stress (c, q, 6) Pa or (0, 0, 6)."""

    force: np.ndarray
    wall: np.ndarray
    relaxed: np.ndarray


@dataclass
class Shape:
    """Where a body is: free nodes' displacements (n_free, 3) m, tensions (t,) N, slip; and the factors of its tangent, if kept."""

    u: np.ndarray
    tension: np.ndarray
    slip: Slip
    LU: tuple[np.ndarray, np.ndarray] | None = None

    def copy(self) -> Shape:
        return Shape(self.u.copy(), self.tension.copy(), Slip(self.slip.state.copy(), self.slip.beyond.copy()), self.LU)


@dataclass
class Solid:
    """Arrays of one body, and room to work in. One instance serves one thread."""

    cells: Cells
    cables: Cables
    skin: Skin
    clamped: int  # nodes
    tangent: Tangent = field(init=False, repr=False)
    pulled: Pulled = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n, c = 3 * self.cables.weights.shape[2], len(self.cells.members)
        self.tangent = Tangent(np.empty((n, n)), np.zeros((c, 4, 81)), np.zeros((c, 4)))
        self.pulled = unpulled(self.cables)
        self._f, self._p = np.empty(n), np.zeros((c, 4))
        self._whole = np.zeros((self.clamped + n // 3, 3))

    def rest(self) -> Shape:
        """Undeformed, without tension."""
        u, nt = np.zeros((self.cables.weights.shape[2], 3)), len(self.cables.rest)
        shape = Shape(u, np.zeros(nt), self.pulled.slip)
        follow(
            self.cables,
            u,
            Slip(np.zeros_like(self.pulled.slip.state), np.full_like(self.pulled.slip.beyond, 1e9)),
            0.0,
            1.0,
            self.pulled,
        )
        shape.slip = Slip(np.zeros_like(self.pulled.slip.state), self.pulled.slip.beyond.copy())
        return shape

    def room(self) -> Room:
        """The same room, as compiled code takes it."""
        return Room(self._f, self._p, self._whole, np.empty((1, 1)), self.pulled)

    def settle(self, shape: Shape, pull: Pull, burden: Burden, *, close: float = CLOSE, once: bool = False) -> bool:
        """Bring `shape` to equilibrium; with `once` by the one step its factors give. False, and as it was, where it is lost."""
        u, T, LU = shape.u.copy(), np.where(pull.held, shape.tension, pull.tension), shape.LU
        foreseen: np.ndarray | None = None
        last = np.inf
        for _ in range(STEPS):
            r = self._residual(u, T, shape.slip, pull, burden)
            if r is None:
                return False
            if LU is None:
                LU = self._factors(u, T, pull, burden, foreseen)
            du, dT = self._step(r, T, pull, LU)
            length = float(np.abs(du).max())
            if not np.isfinite(length):
                return False
            share = min(1.0, LONGEST / length) if length > 0.0 else 1.0
            foreseen = self._foreseen(share * du)
            u, T = u + share * du, np.maximum(T + share * dT, 0.0)
            if once or length < close:
                self._commit(shape, u, T, pull, LU)
                return True
            if length > KEPT * last or share < 1.0:
                LU = None
            last = length
        return False

    def _residual(self, u: np.ndarray, T: np.ndarray, slip: Slip, pull: Pull, burden: Burden) -> np.ndarray | None:
        self._whole[self.clamped :] = u
        if forces(self._whole, self.cells, burden.relaxed, self._f, self._p) < LEAST:
            return None
        follow(self.cables, u, slip, pull.mu, pull.presliding, self.pulled)
        r = self._f + T @ self.pulled.pull - burden.force.ravel()
        if burden.wall[4] > 0.0:
            press(self.skin, u, burden.wall, r, self.tangent.K, False)
        return r

    def _factors(
        self, u: np.ndarray, T: np.ndarray, pull: Pull, burden: Burden, foreseen: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        K = self.tangent.K
        self.tangent.pressure[:] = self._p if foreseen is None else foreseen
        stiffness(self._whole, self.cells, burden.relaxed, self.tangent)
        geometric(self.cables, T, self.pulled, K)
        if pull.mu > 0.0:
            sticking(self.cables, T, self.pulled, pull.mu, pull.presliding, K)
        if burden.wall[4] > 0.0:
            press(self.skin, u, burden.wall, np.empty(len(K)), K, True)
        LU, pivots, _ = getrf(K)
        return LU, pivots

    def _step(self, r: np.ndarray, T: np.ndarray, pull: Pull, LU: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Changes of nodes (n_free, 3) and tensions (t,) that solve the linear problem, slack tendons found on the way."""
        p = self.pulled
        solved = getrs(*LU, np.column_stack([-r, p.pull.T]))[0]
        du, Z = solved[:, 0], solved[:, 1:]
        gap = p.length - pull.free - pull.stretch * T + p.gradient @ du
        C = p.gradient @ Z + np.diag(pull.stretch)
        dT = np.zeros_like(T)
        taut = pull.held & ((T > 0.0) | (gap > 0.0))
        for _ in range(2 * len(T) + 2):
            dT = np.where(pull.held, -T, 0.0)
            on, off = np.flatnonzero(taut), ~taut
            if len(on):
                dT[on] = np.linalg.solve(C[np.ix_(on, on)], gap[on] - C[np.ix_(on, np.flatnonzero(off))] @ dT[off])
            slack = taut & (T + dT < 0.0)
            short = pull.held & off & (gap - C @ dT > 1e-12)
            if not (slack.any() or short.any()):
                break
            taut = (taut & ~slack) | short
        return (du - Z @ dT).reshape(-1, 3), dT

    def _foreseen(self, du: np.ndarray) -> np.ndarray:
        """(c, 4) Pa: the pressures after a step."""
        step = np.append(du.ravel(), 0.0)[self.cells.unknowns]  # (c, 81), the last is of clamped nodes
        return self._p + np.einsum("cka,ca->ck", self.tangent.follow, step)

    def _commit(self, shape: Shape, u: np.ndarray, T: np.ndarray, pull: Pull, LU: tuple[np.ndarray, np.ndarray]) -> None:
        before = Slip(shape.slip.state.copy(), shape.slip.beyond.copy())
        follow(self.cables, u, before, pull.mu, pull.presliding, self.pulled)
        shape.u, shape.tension, shape.LU = u, T, LU
        shape.slip = Slip(self.pulled.slip.state.copy(), self.pulled.slip.beyond.copy())
