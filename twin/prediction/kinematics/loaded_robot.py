"""A twin under given loads at one instant: its tensions, its shape, and the slip of its tendons.

Forward kinematics is `pull`: the shape under new tensions, reached from the present ones, since friction depends on the path.
"""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from twin.body import SOLVE_TOLERANCE, Drive, Loads, Problem, Signals
from twin.foundation.errors import SolveError
from twin.mechanics.rod import Equilibrium
from twin.mechanics.rod.balance.chain import ChainState, ContactLaw, StaticSystem, copy_state, set_state
from twin.mechanics.rod.balance.newton import empty_factors, update_kinematics
from twin.mechanics.rod.continuation import TENSION_PART, move_to_tensions, site_gradient
from twin.prediction.prepared import ROOM_TEMPERATURE
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class Shape:
    """Shape of a robot.

    Base tensions (n_tendon,) N as the load cells report them, tendon displacements (n_tendon,) m; markers (n_marker, 3) and tip
    (3,) m in the base frame.
    """

    tension: np.ndarray
    displacement: np.ndarray
    markers: np.ndarray
    tip: np.ndarray


class LoadedRobot:
    """A twin under given loads, with its tendons' history; slack and at rest at first. One instance serves one thread.

    Effects act as in a prediction, except slow ones: the body has not crept, and the clock is at zero.
    """

    def __init__(self, twin: Twin, loads: Loads | None = None, temperature: float = ROOM_TEMPERATURE) -> None:
        """`loads` on the robot, by default its own gravity alone; `temperature` (K) of the room.

        Raises DataError for a robot without a backbone that tensions bend.
        """
        self.twin, laws, body = twin, twin.effect_chain, twin.robot.chain(twin.body())
        self.solver, self.length = Equilibrium(body), body.length
        loads = laws.surround(loads or Loads(twin.robot.gravity))
        self.softness = 1.0 / float(laws.stiffness(np.full(1, temperature), np.zeros(1))[0])
        self.loads, self.temperature, self.route = loads, temperature, laws.route
        wall = np.array(loads.wall, float)
        wall[4] *= self.softness
        self.law = ContactLaw(float(self.route.mu), float(self.route.presliding), wall)
        self.load = self.solver.static_load(loads, self.softness)
        self.n_tendon = twin.robot.n_tendon
        self._has_sensor_effects = any(e.acts_in("command", "sense") for e in twin.effects)
        self.rest()

    def rest(self) -> None:
        """Return to slack tendons without history: straight, then the loads, as at the start of a trial. Raises SolveError."""
        nt = self.n_tendon
        stiffness = np.full(1, 1.0 / self.softness)
        start = self.solver.solve(Problem(np.zeros(1), np.zeros((1, nt)), self.loads, self.route, stiffness=stiffness))
        if not start.status.all():
            raise SolveError(f"no shape under the loads alone (payload {1e3 * self.loads.payload:.3g} g); check them")
        self.chain_state = ChainState(np.zeros(nt), start.q[0].copy(), start.slip.copy(), start.distal.copy())
        self.factors = empty_factors(self.solver.n_delayed, nt)

    @property
    def statics(self) -> StaticSystem:
        """The system in balance, for the functions of `twin.mechanics.rod.continuation`."""
        c = self.solver
        return StaticSystem(c.model._address, c.data._address, c.chain, c.spring, self.law, self.load)

    @property
    def tension(self) -> np.ndarray:
        """True base tensions (n_tendon,) N."""
        return self.chain_state.T / self.softness

    def pull(self, tension: np.ndarray) -> Shape:
        """Move the robot from its present state to load-cell readings `tension` (n_tendon,) N, and return its shape.

        Raises SolveError where no equilibrium is found; the robot then stays where it was.
        """
        goal = self.solver.borne(self.true_tension(np.asarray(tension, float))) * self.softness
        moved = self.state()
        if not move_to_tensions(self.statics, moved, self.factors, goal, TENSION_PART, SOLVE_TOLERANCE):
            raise SolveError(f"no equilibrium on the way to tensions {np.round(tension, 3).tolist()} N; are they what was meant?")
        self.chain_state = moved
        return self.shape()

    def state(self) -> ChainState:
        """Return a copy of the present state, as `twin.mechanics.rod.continuation.move_to_tensions` advances it."""
        return copy_state(self.chain_state)

    def restore(self, state: ChainState) -> None:
        """Return to an earlier `state`."""
        set_state(self.chain_state, state)
        self.factors.usable[0] = False

    def shape(self) -> Shape:
        """Return the present shape."""
        chain = self.solver.chain
        update_kinematics(self.statics, self.chain_state.q)
        markers = chain.site[chain.marker]
        path = self.solver.straight_path - self.chain_state.s[:, 0] + self.route.elongation(self.tension)
        seen = self.twin.effect_chain.sense(self._signals(self.tension, markers).with_changes(displacement=path[None]))
        return Shape(seen.tension[0], seen.displacement[0], seen.markers[0], chain.site[chain.disk[-1]].copy())

    def gradient(self) -> np.ndarray:
        """Return dmarkers/dT (n_tendon, n_marker, 3) m/N at the present shape, T the true tensions. Raises SolveError if it is
        unstable."""
        c = self.solver
        out = np.empty((self.n_tendon, c.chain.marker.size, 3))
        body = c.model.site_bodyid[c.chain.marker]
        below = (c.model.body_dofadr[body] + c.model.body_dofnum[body]).astype(np.int64)
        if not site_gradient(self.statics, self.state(), np.empty_like(self.factors.LU), c.chain.marker, below, out):
            raise SolveError("the shape is not stable: its markers have no derivative")
        return out * self.softness

    @cached_property
    def lever_arms(self) -> tuple[np.ndarray, np.ndarray]:
        """Lever arms (n_tendon, 2) m towards x and y: for shortening in a uniform bend, and for moving the tip.

        The first is int r ds / L, the second 2 int (L - s) r ds / L^2, r(s) the tendon's place on the straight robot. Both are the
        hole's place for a straight tendon that runs to the tip, not for a helical one.
        """
        c, L = self.solver, self.length
        data = mujoco.MjData(c.model)
        mujoco.mj_kinematics(c.model, data)
        holes = data.site_xpos[c.chain.hole]  # (n_tendon, n_hole, 3); shorter tendons repeat their last one: pieces of no length
        s, r = holes[..., 2], holes[..., :2]
        ds, middle = np.diff(s)[..., None], 0.5 * (s[:, 1:] + s[:, :-1])[..., None]
        mean, bent = 0.5 * (r[:, 1:] + r[:, :-1]), (r[:, 1:] - r[:, :-1]) * np.diff(s)[..., None] / 12.0
        shortens = (mean * ds).sum(axis=1) / L
        moves = 2.0 * ((mean * (L - middle) - bent) * ds).sum(axis=1) / L**2
        return shortens, moves

    @cached_property
    def directions(self) -> np.ndarray:
        """Direction in which each tendon moves the tip (n_tendon,), rad from +x towards +y in [0, 2 pi)."""
        moves = self.lever_arms[1]
        return np.mod(np.arctan2(moves[:, 1], moves[:, 0]) + 1e-9, 2 * np.pi)

    @cached_property
    def pull_per_bend(self) -> float:
        """The tension (N/rad) of one tendon for a bend of constant curvature: EI / (length * lever arm)."""
        chain = self.solver.chain
        lever = float(np.linalg.norm(self.lever_arms[1], axis=1).mean())
        # Two hinges a joint set, K = EI / h; the sets are springs in series.
        bends = chain.stiffness[(chain.is_hinge > 0.0) & ~chain.is_twist]
        return 1.0 / float((1.0 / bends[::2]).sum()) / lever

    def set_payload(self, payload: float) -> None:
        """Set the mass (kg) at the tip, at the same tensions. Raises SolveError where that has no equilibrium."""
        self.load = self.load._replace(payload=float(payload))
        self.factors.usable[0] = False
        moved = self.state()
        if not move_to_tensions(self.statics, moved, self.factors, self.chain_state.T, TENSION_PART, SOLVE_TOLERANCE):
            raise SolveError(f"no shape with {1e3 * payload:.3g} g at the tip")
        self.chain_state = moved

    def true_tension(self, reported: np.ndarray) -> np.ndarray:
        """Return the base tensions (n_tendon,) N that the load cells report as `reported`."""
        if not self._has_sensor_effects:
            return reported
        return self.twin.effect_chain.command(self._signals(reported, np.zeros((0, 3)))).tension[0]

    def reported_tension(self, true: np.ndarray) -> np.ndarray:
        """Return the load cells' readings of base tensions (n_tendon,) N."""
        return self.twin.effect_chain.sense(self._signals(true, np.zeros((0, 3)))).tension[0]

    def _signals(self, tension: np.ndarray, markers: np.ndarray) -> Signals:
        now, nothing = np.zeros(1), np.zeros((1, self.n_tendon))
        return Signals(
            now, now, tension[None], nothing, markers[None], np.full(1, self.temperature), (Drive.TENSION,) * self.n_tendon
        )
