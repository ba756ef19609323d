"""A twin under given loads whose tendons are pulled by SMA springs, stepped in time: currents in, heat, tensions and shape out.

What a trial of a current-driven recording does sample by sample (`twin.equilibrium.held`), for those who decide the next current
only when they have seen the last tension: controllers and environments.
"""

from __future__ import annotations

import numpy as np

from twin.bench import ROOM
from twin.body import DIRECT, TOLERANCE, Problem
from twin.effects import Drive, Loads
from twin.equilibrium import ChainPath
from twin.equilibrium.chain import State
from twin.equilibrium.holder import Held, of_play, remember
from twin.equilibrium.lengths import Sought, reach
from twin.equilibrium.newton import no_factors, place
from twin.errors import SolveError
from twin.kinematics.robot import LoadedRobot
from twin.springs.heat import heated, loss
from twin.twin import Twin

BEYOND = 45.0  # K that the warmest spring may rest above its phase change without stress: its tension has had that then


def warmest_current(twin: Twin) -> tuple[float, float]:
    """The current (A) under which the robot's springs, as long as on the straight robot, rest as warm as they may (K), and that:
    h (T - T_a) = R I^2. Raises DataError for a robot without springs."""
    spring = twin.heating(np.full(1, ROOM)).spring
    warmest = float(spring.austenite_finish.min()) + BEYOND
    h = loss(spring.records, 0, warmest - ROOM, float(spring.initial_elongation[0]), ROOM)
    return float(np.sqrt(h * (warmest - ROOM) / spring.resistance[0])), warmest


class HeatedRobot(LoadedRobot):
    """Springs cold, robot at rest at first. `pull` is not for it: its tensions are what the springs make them."""

    def __init__(self, twin: Twin, loads: Loads | None = None, temperature: float = ROOM) -> None:
        """Raises DataError for a robot without springs, SolveError where cold springs and loads have no equilibrium."""
        self.heating = twin.heating(np.full(1, temperature))
        super().__init__(twin, loads, temperature)

    def rest(self) -> None:
        """As at the start of a trial: springs at the room's temperature, the straight robot, then its loads. Raises SolveError."""
        nt, c = self.n_tendon, self.solver
        sprung = np.ones(nt, bool)
        path = c.zero_path(self.route, sprung, self.heating.spring)
        start = c.solve(
            Problem(
                np.zeros(1), np.zeros((1, nt)), self.loads, self.route, (Drive.CURRENT,) * nt, heating=self.heating,
                stiffness=np.full(1, 1.0 / self.softness),
            )
        )  # fmt: skip
        if not start.status.all():
            raise SolveError(f"no shape with cold springs under the loads (payload {1e3 * self.loads.payload:.3g} g); check them")
        self.now = State(start.tension[0] * self.softness, start.q[0].copy(), start.slip.copy(), start.distal.copy())
        self.factors = no_factors(c.n_slow, nt)
        self.warm = np.full(nt, self.temperature)
        spring = self.heating.spring
        self.held = Held(
            sprung.copy(), sprung, path.copy(), np.empty(nt), path, self.route.stretch,
            np.full(1, self.softness), spring.records, self.warm.copy(), spring.initial_elongation.copy(),
            spring.initial_tension.copy(), self.route.bedding, self.route.bedding_tension, np.zeros(nt), np.inf,
            *of_play(self.route, path, sprung),
        )  # fmt: skip
        remember(self.held, self.now.s, self.now.T)

    def step(self, current: np.ndarray, dt: float) -> np.ndarray:
        """Heat the springs with currents (n_tendon,) A for dt seconds; returns the true base tensions (n_tendon,) N after it.

        Raises SolveError where springs and body find no equilibrium.
        """
        for t in range(self.n_tendon):
            self.warm[t] = heated(self.held.spring, t, self.warm[t], self.held.elongation[t], current[t], self.temperature, dt)
        sought = Sought(self.held.free.copy(), self.warm)
        post = bool(self.law.wall[9] > 0.0)
        found = reach(self.statics, self.now, self.factors, self.held, self.now.q.copy(), sought, TOLERANCE, post)
        if found == 0:
            raise SolveError("springs and body find no equilibrium; are the currents what was meant?")
        remember(self.held, self.now.s, self.now.T)
        return self.tension

    def bear(self, loads: Loads) -> None:
        """Other loads from now on, the springs as warm as they are. Raises SolveError, and keeps the loads, where that has no
        equilibrium."""
        before, moved = self.load, self.state()
        self.load = self.solver.load(self.twin.laws.surround(loads), self.softness)
        self.factors.fresh[0] = False
        try:
            self.step(np.zeros(self.n_tendon), 0.0)
        except SolveError:
            self.load = before
            self.restore(moved)
            raise

    def path(self) -> ChainPath:
        """As it stands, as a trial of one sample."""
        place(self.statics, self.now.q)
        chain = self.solver.chain
        return ChainPath(
            tension=self.tension[None], path=self.now.s[None, :, 0].copy(), markers=chain.site[chain.marker][None].copy(),
            status=np.full(1, DIRECT), q=self.now.q[None].copy(), others={"temperature": self.warm[None].copy()},
            slip=self.now.z.copy(), distal=self.now.s.copy(),
        )  # fmt: skip

    @property
    def elongation(self) -> np.ndarray:
        """Of the springs (n_tendon,) m."""
        return self.held.elongation.copy()
