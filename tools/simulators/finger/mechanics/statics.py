"""Newton's method for the finger at rest: silicone, weight, cables that pull only, pads, given forces; mm, N, MPa, s.

Driven by displacement, a tendon of base tension T and length L obeys T >= 0, L <= limit, T (L - limit) = 0: every Newton
step solves this for its linearised lengths. Driven by tension, T is given. Steps that do not converge are halved.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import LinAlgError, block_diag, solve_banded, solveh_banded

from tools.simulators.finger.mechanics.body import DENSITY, Body, Element, assemble
from tools.simulators.finger.mechanics.cables import Cables, Cords
from tools.simulators.finger.mechanics.mesh import cone
from tools.simulators.finger.mechanics.skin import Pad, Skin

ITERATIONS = 25
LOAD_HALVINGS = 8
FORCE_LEFT, LENGTH_LEFT = 2e-5, 1e-4  # N and mm: what is left of forces, and of steps and lengths; noise is 0.2 mm


class NotConverged(RuntimeError):
    """No equilibrium was found, even in halved steps."""


@dataclass(frozen=True)
class Load:
    """What acts at one moment."""

    limit: np.ndarray  # (4,) mm, the longest free path of each tendon; inf where tension is given
    tension: np.ndarray = field(default_factory=lambda: np.zeros(4))  # (4,) N, used where limit is inf
    gravity: tuple[float, float, float] = (0.0, 0.0, 9.81)  # m/s^2
    force: np.ndarray | None = None  # (n, 3) N on nodes
    swelling: float = 1.0  # volume of the unstressed silicone over the first one

    def between(self, other: Load, part: float) -> Load:
        """The load at `part` of the way to `other`."""

        def mix(a: np.ndarray | float | None, b: np.ndarray | float | None) -> np.ndarray | float:
            return (1 - part) * (0.0 if a is None else a) + part * (0.0 if b is None else b)

        driven = np.isfinite(self.limit) & np.isfinite(other.limit)
        limit = other.limit.copy()
        limit[driven] = mix(self.limit[driven], other.limit[driven])
        gravity = tuple(map(mix, self.gravity, other.gravity))
        force = None if self.force is None and other.force is None else mix(self.force, other.force)
        return Load(limit, mix(self.tension, other.tension), gravity, force, mix(self.swelling, other.swelling))


@dataclass(frozen=True)
class State:
    """An equilibrium and its memory."""

    u: np.ndarray  # (n, 3) mm
    pressure: np.ndarray  # (m, 4) MPa
    tension: np.ndarray  # (4,) N at the base
    load: Load
    length: np.ndarray  # (4, 20) mm
    contacts: np.ndarray  # (4, 19) psi of the capstan law
    stress: np.ndarray | None = None  # (m, q, 3, 3) MPa, elastic distortion
    overstress: np.ndarray | None = None  # (m, q, 3, 3) MPa, of the Maxwell branch


@dataclass
class Finger:
    """A built finger, in its own frame: tendon 1 at +x."""

    body: Body
    cables: Cables
    cords: Cords
    skin: Skin
    pads: tuple[Pad, ...] = ()
    creep: tuple[float, float] | None = None  # share of the shear modulus that relaxes, its time (s)

    @classmethod
    def of(cls, modulus: float = 0.125, poisson: float = 0.49, core: int = 1, finer: int = 1) -> Finger:
        """Homogeneous finger of Young's `modulus` (MPa)."""
        body = Body.of(cone(core, finer), modulus, poisson)
        return cls(body, Cables.of(body), Cords.of(body), Skin.of(body.mesh))

    def __post_init__(self) -> None:
        mesh = self.body.mesh
        self._mass = DENSITY * self.body.weights()
        dof = (3 * mesh.cells[..., None] + np.arange(3)).reshape(len(mesh.cells), 81) - 3 * mesh.held
        self._free = 3 * (len(mesh.nodes) - mesh.held)
        row, column = np.broadcast_arrays(dof[:, :, None], dof[:, None, :])
        self._lower = (row >= column) & (column >= 0)
        self._dof = dof
        self._place = ((row - column) * self._free + column)[self._lower]
        steps = np.diff(self.cables.weights, axis=1)
        self._stretch = np.ascontiguousarray(steps[:, :, mesh.held :])
        self._support = [[np.flatnonzero(np.abs(d) > 1e-12) for d in tendon] for tendon in steps]
        spans = [3 * (int(np.ptp(on)) + 1) for tendon in self._support for on in tendon if len(on)]
        self._band = max(int((row - column)[self._lower].max()) + 1, *spans)

    def still(self) -> State:
        """Undeformed, unloaded."""
        mesh = self.body.mesh
        u = np.zeros_like(mesh.nodes)
        load = Load(np.full(4, np.inf), gravity=(0.0, 0.0, 0.0))
        return State(u, np.zeros((len(mesh.cells), 4)), np.zeros(4), load, self.cables.pieces(u)[0], np.zeros((4, 19)))

    def hanging(self, gravity: tuple[float, float, float] = (0.0, 0.0, 9.81)) -> State:
        """At rest under its weight, all tendons slack, long enough for every delayed strain to have come."""
        state = self.step(self.still(), Load(np.full(4, np.inf), gravity=gravity), dt=np.inf)
        if self.creep is None:
            return state
        return replace(state, overstress=np.zeros((*self.body.volume.shape, 3, 3)))

    def rest_lengths(self) -> np.ndarray:
        """Path length (4,) mm of each tendon, just taut in the hanging rest state."""
        return self.hanging().length.sum(axis=1)

    def step(self, state: State, load: Load, dt: float = 0.0, ahead: State | None = None) -> State:
        """The equilibrium that follows `state` when the load goes to `load` in `dt` seconds; `ahead`: a first guess."""
        found = self._newton(state, load, dt, ahead) or self._newton(state, load, dt, None)
        if found is not None:
            return found
        now, done, part = state, 0.0, 0.5
        for _ in range(2**LOAD_HALVINGS):
            goal = min(done + part, 1.0)
            found = self._newton(now, state.load.between(load, goal), dt * (goal - done), None)
            if found is None:
                part /= 2
                if part < 2.0**-LOAD_HALVINGS:
                    break
                continue
            now, done = found, goal
            if done == 1.0:
                return replace(now, load=load)
        raise NotConverged(f"no equilibrium at {done:.3f} of a step; tensions {np.round(now.tension, 3)} N")

    def _delayed(self, state: State, dt: float) -> tuple[float, np.ndarray | None]:
        """Share of the elastic distortion that acts now and the overstress left from before (Simo's recursion)."""
        if self.creep is None:
            return 1.0, None
        share, time = self.creep
        if state.overstress is None or not np.isfinite(dt):
            return 1.0 - share, None
        half = np.exp(-dt / 2 / time)
        return 1.0 - share + share * half, half * (half * state.overstress - share * state.stress)

    def _newton(self, state: State, load: Load, dt: float, ahead: State | None) -> State | None:
        share, left = self._delayed(state, dt)
        guess = ahead or state
        u, pressure = guess.u.copy(), guess.pressure.copy()
        driven = np.isfinite(load.limit)
        tension = np.where(driven, guess.tension, load.tension)
        outside = self._mass[:, None] * np.array(load.gravity)
        if load.force is not None:
            outside = outside + load.force
        step = np.inf
        for _ in range(ITERATIONS):
            element = assemble(self.body, u, pressure, load.swelling, share, left)
            if element is None:
                return None
            length, direction = self.cables.pieces(u)
            over = np.where(driven, length.sum(axis=1) - np.where(driven, load.limit, 0.0), 0.0)
            pulls = tension > 0
            psi = self.cables.contacts(state.length, state.contacts, length, pulls)
            shares = self.cables.shares(direction, psi)
            gap, plain, K = self._gather(element, u, outside, tension[:, None] * shares, length, direction)
            off = max(over.max(initial=0.0), np.abs(over[driven & pulls]).max(initial=0.0))
            if step < 50 * LENGTH_LEFT and np.abs(plain).max() < FORCE_LEFT and off < LENGTH_LEFT and _quiet(element, self.body):
                return self._kept(State(u, pressure, tension, load, length, psi), share, left)
            grip = None
            if self.cables.mu and pulls.any():
                grip = tension[:, None, None] * self.cables.grip((state.length, state.contacts), length, direction)
            found = self._direction(K, gap, direction, shares, grip, (driven, tension, over))
            if found is None:
                return None
            du, change = found
            step = np.abs(du).max()
            if not np.isfinite(step) or step > 60.0:
                return None
            part = min(1.0, 8.0 / max(step, 1e-12))
            full = np.concatenate([np.zeros(3 * self.body.mesh.held), du])
            pressure = pressure + part * element.pressure_step(full[self._dof + 3 * self.body.mesh.held])
            u, tension = u + part * full.reshape(-1, 3), np.maximum(tension + part * change, 0.0)
        return None

    def _direction(
        self, K: np.ndarray, gap: np.ndarray, direction: np.ndarray, shares: np.ndarray, grip: np.ndarray | None, drives: tuple
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Newton's step of the free unknowns and the base tensions; `drives`: who is driven, tensions, lengths over the limit.

        Lengths y and tensions t of all pieces answer as y = y0 - C t with C = G' K^-1 G, t = shares dT + grip y. Without friction
        a tendon's pieces are alike and stand together.
        """
        driven, tension, over = drives
        G = np.einsum("tkn,tki->nitk", self._stretch, direction).reshape(len(gap), 4, 20)
        G = G.sum(axis=2) if grip is None else G.reshape(len(gap), 80)
        solved = _solve(K, np.column_stack([gap, G]))
        if solved is None:
            return None
        y0, C = -G.T @ solved[:, 0], G.T @ solved[:, 1:]
        pull, held = np.eye(4), np.zeros((4, 4))
        if grip is not None:
            pull, held = block_diag(*shares[:, :, None]), block_diag(*grip)
        answer = np.linalg.solve(np.eye(len(y0)) + C @ held, np.column_stack([y0, C @ pull]))
        total = answer.reshape(4, -1, 5).sum(axis=1)
        give = total[:, 1:][np.ix_(driven, driven)]
        change = np.zeros(4)
        change[driven] = _pulling(give, (over + total[:, 0])[driven] + give @ tension[driven]) - tension[driven]
        moved = pull @ change + held @ (answer[:, 0] - answer[:, 1:] @ change)
        return -solved[:, 0] - solved[:, 1:] @ moved, change

    def _gather(
        self, element: Element, u: np.ndarray, outside: np.ndarray, pull: np.ndarray, length: np.ndarray, direction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force residuals of the free unknowns, condensed and plain, and the stiffness as a lower band."""
        n, held = len(u), self.body.mesh.held
        around = -outside
        places, entries = [self._place], [element.stiffness[self._lower]]
        for pad in self.pads:
            traction, stiffness = pad.press(self.skin, u)
            around = around - self.skin.load(traction, n)
            on = np.flatnonzero(stiffness)
            normal = np.array(pad.normal)
            shape = np.einsum("sa,i->sai", self.skin.values[on], normal).reshape(len(on), 27)
            dof = (3 * self.skin.nodes[on][..., None] + np.arange(3)).reshape(len(on), 27) - 3 * held
            block = (stiffness * self.skin.area)[on][:, None, None] * shape[:, :, None] * shape[:, None, :]
            self._add(places, entries, dof, block)
        for t in np.flatnonzero(pull.any(axis=1)):
            turn = (np.eye(3) - direction[t][:, :, None] * direction[t][:, None, :]) * (pull[t] / length[t])[:, None, None]
            for k, d in enumerate(np.diff(self.cables.weights[t], axis=0)):
                on = self._support[t][k]
                if not len(on):
                    continue
                block = np.einsum("a,b,ij->aibj", d[on], d[on], turn[k]).reshape(3 * len(on), -1)
                self._add(places, entries, (3 * on[:, None] + np.arange(3)).reshape(1, -1) - 3 * held, block[None])
        K = np.bincount(np.concatenate(places), np.concatenate(entries), self._band * self._free).reshape(self._band, self._free)
        rest = around.reshape(-1)[3 * held :] + self._along(direction, pull)
        condensed, plain = (
            np.bincount(self._dof[self._dof >= 0], f[self._dof >= 0], self._free) + rest for f in (element.force, element.plain)
        )
        return condensed, plain, K

    def _add(self, places: list, entries: list, dof: np.ndarray, block: np.ndarray) -> None:
        row, column = np.broadcast_arrays(dof[:, :, None], dof[:, None, :])
        lower = (row >= column) & (column >= 0)
        places.append(((row - column) * self._free + column)[lower])
        entries.append(block[lower])

    def _along(self, direction: np.ndarray, pull: np.ndarray) -> np.ndarray:
        """Generalised force (free,) with which pieces of tension `pull` (4, 20) resist stretching."""
        return np.einsum("tkn,tki->ni", self._stretch, pull[..., None] * direction).reshape(-1)

    def _kept(self, state: State, share: float, left: np.ndarray | None) -> State:
        if self.creep is None:
            return state
        stress = self.body.isochoric(self.body.gradient(state.u))
        own = (share - 1.0 + self.creep[0]) * stress
        return replace(state, stress=stress, overstress=own if left is None else own + left)


def _pulling(give: np.ndarray, over: np.ndarray) -> np.ndarray:
    """Tensions T >= 0 with over - give T <= 0 and T (over - give T) = 0: which of the few cables pull, by trying all sets."""
    count = len(over)
    best, least = np.zeros(count), np.inf
    for chosen in range(2**count):
        on = np.array([chosen >> n & 1 for n in range(count)], bool)
        T = np.zeros(count)
        T[on] = np.linalg.solve(give[np.ix_(on, on)], over[on])
        wrong = max((over - give @ T).max(initial=0.0), (-T).max(initial=0.0))
        if wrong < least:
            best, least = np.maximum(T, 0.0), wrong
    return best


def _quiet(element: Element, body: Body) -> bool:
    """Whether the volume's law holds to a millionth of a cell."""
    return bool(np.abs(element.residual).max() < 1e-6 * body.volume.sum(axis=1).mean())


def _solve(K: np.ndarray, rhs: np.ndarray) -> np.ndarray | None:
    """Banded solve, by Cholesky where the stiffness is positive definite."""
    try:
        return solveh_banded(K, rhs, lower=True, check_finite=False)
    except LinAlgError:
        band = len(K) - 1
        upper = np.zeros_like(K)
        for d in range(1, band + 1):
            upper[band - d, d:] = K[d, : K.shape[1] - d]
        try:
            return solve_banded((band, band), np.vstack([upper[:-1], K]), rhs, check_finite=False)
        except LinAlgError:
            return None
