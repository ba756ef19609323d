"""A twin under given loads as it stands: which tensions pull it, what shape it has, and how far its tendons have slipped.

Forward kinematics is `pull`: the shape under new tensions, reached from the present ones, since friction remembers the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from twin.effects import Loads, Signals
from twin.equilibrium import TOLERANCE, Equilibrium
from twin.equilibrium.chain import Law, Load
from twin.equilibrium.move import STRIDE, answer, pull
from twin.equilibrium.newton import place
from twin.errors import SolveError
from twin.twin import Twin, merged_route

ROOM = 296.15  # K
State = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # (T, q, z, s), see twin.equilibrium.move


@dataclass(frozen=True)
class Shape:
    """Base tensions (n_tendon,) N as the load cells report them, tendon displacements (n_tendon,) m; markers (n_marker, 3) and
    tip (3,) m in the base frame."""

    tension: np.ndarray
    displacement: np.ndarray
    markers: np.ndarray
    tip: np.ndarray


class LoadedRobot:
    """A twin under given loads, with its tendons' history; slack and at rest at first. One instance serves one thread.

    Effects act as in a prediction, but for slow ones: the body has not crept, and the clock stands at zero.
    """

    def __init__(self, twin: Twin, loads: Loads | None = None, temperature: float = ROOM) -> None:
        """`loads` on the robot, its own gravity alone by default; `temperature` (K) of the room."""
        self.twin = twin
        body = twin.robot.build(twin.values)
        for effect in twin.effects:
            effect.edit(body)
        self.solver = Equilibrium(body)
        loads = loads or Loads(twin.robot.gravity)
        self.softness = 1.0
        for effect in twin.effects:
            loads = effect.surround(loads)
            self.softness /= float(np.ravel(effect.soften(np.full(1, temperature), np.zeros(1)))[0])
        self.loads, self.temperature = loads, temperature
        route = merged_route(twin.effects)
        self.stretch = float(route.stretch)
        wall = np.array(loads.wall, float) * np.array([1, 1, 1, 1, self.softness])
        self.law = Law(float(route.mu), float(route.presliding), wall)
        f = self.softness
        self.load = Load(np.array(loads.gravity, float) * f, float(loads.payload), np.array(loads.force, float) * f)
        self.n_tendon = len(self.solver.chain.hole)
        self._reads = any(e.acts_in("command", "sense") for e in twin.effects)
        self.rest()

    def rest(self) -> None:
        """Slack again and all history forgotten: straight, then the loads, as at the start of a trial. Raises SolveError."""
        nt = self.n_tendon
        start = self.solver.solve(
            np.zeros(1), np.zeros((1, nt)), self.loads, merged_route(self.twin.effects), stiffness=np.full(1, 1.0 / self.softness)
        )
        if not start.status.all():
            raise SolveError(f"no shape under the loads alone (payload {1e3 * self.loads.payload:.3g} g); check them")
        self.tension, self.q, self.slip, self.distal = np.zeros(nt), start.q[0].copy(), start.slip.copy(), start.distal.copy()
        self.LU, self.fresh = np.empty((self.q.size, self.q.size)), np.zeros(1, bool)

    @property
    def statics(self) -> tuple[Any, ...]:
        """What the functions of `twin.equilibrium.move` need first: MuJoCo's model and data, the chain, its rest, law and load."""
        c = self.solver
        return c.model._address, c.data._address, c.chain, c.spring, self.law, self.load

    def pull(self, tension: np.ndarray) -> Shape:
        """The shape under load-cell readings `tension` (n_tendon,) N, the robot moved there from where it stands.

        Raises SolveError where no equilibrium is found; the robot then stays where it was.
        """
        goal = np.maximum(self.true(np.asarray(tension, float)), 0.0) * self.softness
        T, q, z, s = self.state()
        ok = pull(
            *self.statics, goal, STRIDE, TOLERANCE, T, q, z, s, self.LU,
            self.fresh,
        )  # fmt: skip
        if not ok:
            raise SolveError(f"no equilibrium on the way to tensions {np.round(tension, 3).tolist()} N; are they what was meant?")
        self.tension, self.q, self.slip, self.distal = T, q, z, s
        return self.shape()

    def state(self) -> State:
        """Copies of (T, q, z, s): what `twin.equilibrium.move.pull` advances."""
        return self.tension.copy(), self.q.copy(), self.slip.copy(), self.distal.copy()

    def restore(self, state: State) -> None:
        """Back to an earlier `state`: a pull that was only tried."""
        self.tension, self.q, self.slip, self.distal = (x.copy() for x in state)
        self.fresh[0] = False

    def shape(self) -> Shape:
        """As it stands after the last `pull` or `rest`."""
        chain = self.solver.chain
        c = self.solver
        place(c.model._address, c.data._address, chain, self.q)
        markers = chain.site[chain.marker]
        seen = self._signals(self.tension / self.softness, markers)
        seen = seen.with_(displacement=(self.solver.straight_path - self.distal[:, 0] + self.stretch * seen.tension[0])[None])
        for effect in self.twin.effects:
            seen = effect.sense(seen)
        return Shape(seen.tension[0], seen.displacement[0], seen.markers[0], chain.site[chain.disk[-1]].copy())

    def gradient(self) -> np.ndarray:
        """dmarkers/dT (n_tendon, n_marker, 3) m/N as it stands, T the true tensions. Raises SolveError at an unstable shape."""
        c = self.solver
        out = np.empty((self.n_tendon, c.chain.marker.size, 3))
        body = c.model.site_bodyid[c.chain.marker]
        below = (c.model.body_dofadr[body] + c.model.body_dofnum[body]).astype(np.int64)
        T, q, z, s = self.state()
        if not answer(
            *self.statics, T, q, z, s, np.empty_like(self.LU),
            c.chain.marker, below, out,
        ):  # fmt: skip
            raise SolveError("the shape is not stable: its markers have no derivative")
        return out * self.softness

    @cached_property
    def directions(self) -> np.ndarray:
        """Where each tendon's hole lies at the base (n_tendon,), rad from +x towards +y in [0, 2 pi): it bends the robot there."""
        holes = self.solver.chain.site[self.solver.chain.hole[:, 0]]
        return np.mod(np.arctan2(holes[:, 1], holes[:, 0]) + 1e-9, 2 * np.pi)

    @cached_property
    def pull_per_bend(self) -> float:
        """The tension (N/rad) one tendon needs for a bend of constant curvature: EI / (length * lever arm)."""
        chain = self.solver.chain
        lever = float(np.linalg.norm(chain.site[chain.hole[0, 0], :2]))
        # Two hinges a joint set, K = EI / h; the sets are springs in a row.
        bends = chain.stiffness[(chain.hinge > 0.0) & ~chain.twists]
        return 1.0 / float((1.0 / bends[::2]).sum()) / lever

    def burden(self, payload: float) -> None:
        """Another mass (kg) at the tip from now on, the tensions kept. Raises SolveError where that has no equilibrium."""
        self.load = self.load._replace(payload=float(payload))
        self.fresh[0] = False
        T, q, z, s = self.state()
        if not pull(
            *self.statics, T.copy(), STRIDE, TOLERANCE, T, q, z, s, self.LU,
            self.fresh,
        ):  # fmt: skip
            raise SolveError(f"no shape with {1e3 * payload:.3g} g at the tip")
        self.q, self.slip, self.distal = q, z, s

    def true(self, reported: np.ndarray) -> np.ndarray:
        """Tensions (n_tendon,) N at the base that the load cells report as `reported`."""
        if not self._reads:
            return reported
        seen = self._signals(reported, np.zeros((0, 3)))
        for effect in reversed(self.twin.effects):
            seen = effect.command(seen)
        return seen.tension[0]

    def reported(self, true: np.ndarray) -> np.ndarray:
        """What the load cells report of tensions (n_tendon,) N."""
        seen = self._signals(true, np.zeros((0, 3)))
        for effect in self.twin.effects:
            seen = effect.sense(seen)
        return seen.tension[0]

    def _signals(self, tension: np.ndarray, markers: np.ndarray) -> Signals:
        now, nothing = np.zeros(1), np.zeros((1, self.n_tendon))
        return Signals(now, now, tension[None], nothing, markers[None], np.full(1, self.temperature), np.zeros(self.n_tendon, bool))
