"""A twin under given loads as it stands: which tensions pull it, what shape it has, and how far its tendons have slipped.

Forward kinematics is `pull`: the shape under new tensions, reached from the present ones, since friction remembers the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from twin.bench import ROOM
from twin.body import TOLERANCE, Problem
from twin.effects import Drive, Loads, Signals
from twin.equilibrium import Equilibrium
from twin.equilibrium.chain import Law, State, Statics, become, copied
from twin.equilibrium.move import STRIDE, answer, pull
from twin.equilibrium.newton import no_factors, place
from twin.errors import SolveError
from twin.twin import Twin


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
        """`loads` on the robot, its own gravity alone by default; `temperature` (K) of the room.

        Raises DataError for a robot without a backbone that tensions bend.
        """
        self.twin, laws, body = twin, twin.laws, twin.robot.chain(twin.body())
        self.solver, self.length = Equilibrium(body), body.length
        loads = laws.surround(loads or Loads(twin.robot.gravity))
        self.softness = 1.0 / float(laws.stiffness(np.full(1, temperature), np.zeros(1))[0])
        self.loads, self.temperature, self.route = loads, temperature, laws.route
        wall = np.array(loads.wall, float)
        wall[4] *= self.softness
        self.law = Law(float(self.route.mu), float(self.route.presliding), wall)
        self.load = self.solver.load(loads, self.softness)
        self.n_tendon = twin.robot.n_tendon
        self._reads = any(e.acts_in("command", "sense") for e in twin.effects)
        self.rest()

    def rest(self) -> None:
        """Slack again and all history forgotten: straight, then the loads, as at the start of a trial. Raises SolveError."""
        nt = self.n_tendon
        stiffness = np.full(1, 1.0 / self.softness)
        start = self.solver.solve(Problem(np.zeros(1), np.zeros((1, nt)), self.loads, self.route, stiffness=stiffness))
        if not start.status.all():
            raise SolveError(f"no shape under the loads alone (payload {1e3 * self.loads.payload:.3g} g); check them")
        self.now = State(np.zeros(nt), start.q[0].copy(), start.slip.copy(), start.distal.copy())
        self.factors = no_factors(self.solver.n_slow, nt)

    @property
    def statics(self) -> Statics:
        """What is in balance, for the functions of `twin.equilibrium.move`."""
        c = self.solver
        return Statics(c.model._address, c.data._address, c.chain, c.spring, self.law, self.load)

    @property
    def tension(self) -> np.ndarray:
        """True base tensions (n_tendon,) N as it stands."""
        return self.now.T / self.softness

    def pull(self, tension: np.ndarray) -> Shape:
        """The shape under load-cell readings `tension` (n_tendon,) N, the robot moved there from where it stands.

        Raises SolveError where no equilibrium is found; the robot then stays where it was.
        """
        goal = np.maximum(self.true(np.asarray(tension, float)), 0.0) * self.softness
        moved = self.state()
        if not pull(self.statics, moved, self.factors, goal, STRIDE, TOLERANCE):
            raise SolveError(f"no equilibrium on the way to tensions {np.round(tension, 3).tolist()} N; are they what was meant?")
        self.now = moved
        return self.shape()

    def state(self) -> State:
        """A copy of where it stands: what `twin.equilibrium.move.pull` advances."""
        return copied(self.now)

    def restore(self, state: State) -> None:
        """Back to an earlier `state`: a pull that was only tried."""
        become(self.now, state)
        self.factors.fresh[0] = False

    def shape(self) -> Shape:
        """As it stands after the last `pull` or `rest`."""
        chain = self.solver.chain
        place(self.statics, self.now.q)
        markers = chain.site[chain.marker]
        path = self.solver.straight_path - self.now.s[:, 0] + self.route.elongation(self.tension)
        seen = self.twin.laws.sense(self._signals(self.tension, markers).with_(displacement=path[None]))
        return Shape(seen.tension[0], seen.displacement[0], seen.markers[0], chain.site[chain.disk[-1]].copy())

    def gradient(self) -> np.ndarray:
        """dmarkers/dT (n_tendon, n_marker, 3) m/N as it stands, T the true tensions. Raises SolveError at an unstable shape."""
        c = self.solver
        out = np.empty((self.n_tendon, c.chain.marker.size, 3))
        body = c.model.site_bodyid[c.chain.marker]
        below = (c.model.body_dofadr[body] + c.model.body_dofnum[body]).astype(np.int64)
        if not answer(self.statics, self.state(), np.empty_like(self.factors.LU), c.chain.marker, below, out):
            raise SolveError("the shape is not stable: its markers have no derivative")
        return out * self.softness

    @cached_property
    def levers(self) -> tuple[np.ndarray, np.ndarray]:
        """Lever arms (n_tendon, 2) m towards x and y: by which a bend that is the same all along the robot shortens each tendon,
        int r ds / L, and by which each tendon's pull moves the tip, 2 int (L - s) r ds / L^2, r(s) its place on the straight robot.

        Those of a straight tendon that runs to the tip are its hole's place; those of a helical one are not.
        """
        c, L = self.solver, self.length
        data = mujoco.MjData(c.model)
        mujoco.mj_kinematics(c.model, data)
        holes = data.site_xpos[c.chain.hole]  # (n_tendon, n_hole, 3); a shorter tendon's last one stands again: pieces of no length
        s, r = holes[..., 2], holes[..., :2]
        ds, middle = np.diff(s)[..., None], 0.5 * (s[:, 1:] + s[:, :-1])[..., None]
        mean, bent = 0.5 * (r[:, 1:] + r[:, :-1]), (r[:, 1:] - r[:, :-1]) * np.diff(s)[..., None] / 12.0
        shortens = (mean * ds).sum(axis=1) / L
        moves = 2.0 * ((mean * (L - middle) - bent) * ds).sum(axis=1) / L**2
        return shortens, moves

    @cached_property
    def directions(self) -> np.ndarray:
        """Where each tendon moves the tip (n_tendon,), rad from +x towards +y in [0, 2 pi)."""
        moves = self.levers[1]
        return np.mod(np.arctan2(moves[:, 1], moves[:, 0]) + 1e-9, 2 * np.pi)

    @cached_property
    def pull_per_bend(self) -> float:
        """The tension (N/rad) one tendon needs for a bend of constant curvature: EI / (length * lever arm)."""
        chain = self.solver.chain
        lever = float(np.linalg.norm(self.levers[1], axis=1).mean())
        # Two hinges a joint set, K = EI / h; the sets are springs in a row.
        bends = chain.stiffness[(chain.hinge > 0.0) & ~chain.twists]
        return 1.0 / float((1.0 / bends[::2]).sum()) / lever

    def burden(self, payload: float) -> None:
        """Another mass (kg) at the tip from now on, the tensions kept. Raises SolveError where that has no equilibrium."""
        self.load = self.load._replace(payload=float(payload))
        self.factors.fresh[0] = False
        moved = self.state()
        if not pull(self.statics, moved, self.factors, self.now.T, STRIDE, TOLERANCE):
            raise SolveError(f"no shape with {1e3 * payload:.3g} g at the tip")
        self.now = moved

    def true(self, reported: np.ndarray) -> np.ndarray:
        """Tensions (n_tendon,) N at the base that the load cells report as `reported`."""
        if not self._reads:
            return reported
        return self.twin.laws.command(self._signals(reported, np.zeros((0, 3)))).tension[0]

    def reported(self, true: np.ndarray) -> np.ndarray:
        """What the load cells report of tensions (n_tendon,) N."""
        return self.twin.laws.sense(self._signals(true, np.zeros((0, 3)))).tension[0]

    def _signals(self, tension: np.ndarray, markers: np.ndarray) -> Signals:
        now, nothing = np.zeros(1), np.zeros((1, self.n_tendon))
        return Signals(
            now, now, tension[None], nothing, markers[None], np.full(1, self.temperature), (Drive.TENSION,) * self.n_tendon
        )
