"""A twin under given loads whose tendons are pulled by SMA springs, stepped in time: currents in, heat, tensions and shape out.

It does what a trial of a current-driven recording does (`twin.mechanics.rod.held_trials`), one sample at a time, for controllers
and environments that choose the next current from the last tension.
"""

import numpy as np

from twin.body import DIRECT, SOLVE_TOLERANCE, Drive, Loads, Problem
from twin.foundation.errors import SolveError
from twin.mechanics.rod import ChainSolution
from twin.mechanics.rod.balance.chain import ChainState
from twin.mechanics.rod.balance.lengths import HeldTarget, reach_target
from twin.mechanics.rod.balance.newton import empty_factors, update_kinematics
from twin.mechanics.rod.balance.tendon_actuation import Actuation, commit_springs, initial_backlash
from twin.mechanics.springs.heat import heat_loss, heated_temperature
from twin.prediction.kinematics.loaded_robot import LoadedRobot
from twin.prediction.prepared import ROOM_TEMPERATURE
from twin.prediction.twin import Twin

MOST_REST_EXCESS = 45.0  # K above the stress-free phase change; a warmer spring gains no tension


def warmest_current(twin: Twin) -> tuple[float, float]:
    """Return the largest steady current (A) of the robot's springs, and their temperature (K) under it.

    h (T - T_a) = R I^2, with the springs as long as on the straight robot. Raises DataError for a robot without springs.
    """
    spring = twin.heating(np.full(1, ROOM_TEMPERATURE)).spring
    warmest = float(spring.austenite_finish.min()) + MOST_REST_EXCESS
    h = heat_loss(spring.records, 0, warmest - ROOM_TEMPERATURE, float(spring.initial_elongation[0]), ROOM_TEMPERATURE)
    return float(np.sqrt(h * (warmest - ROOM_TEMPERATURE) / spring.resistance[0])), warmest


class HeatedRobot(LoadedRobot):
    """A `LoadedRobot` with SMA springs, cold and at rest at first. `pull` does not apply: the springs determine the tensions."""

    def __init__(self, twin: Twin, loads: Loads | None = None, temperature: float = ROOM_TEMPERATURE) -> None:
        """Raises DataError for a robot without springs, SolveError where cold springs and loads have no equilibrium."""
        self.heating = twin.heating(np.full(1, temperature))
        super().__init__(twin, loads, temperature)

    def rest(self) -> None:
        """Return to the start of a trial: springs at room temperature, the straight robot, then its loads. Raises SolveError."""
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
        self.chain_state = ChainState(start.tension[0] * self.softness, start.q[0].copy(), start.slip.copy(), start.distal.copy())
        self.factors = empty_factors(c.n_delayed, nt)
        self.spring_temperature = np.full(nt, self.temperature)
        spring = self.heating.spring
        self.actuation = Actuation(
            sprung.copy(), sprung, path.copy(), np.empty(nt), path, self.route.stretch,
            np.full(1, self.softness), spring.records, self.spring_temperature.copy(), spring.initial_elongation.copy(),
            spring.initial_tension.copy(), self.route.bedding, self.route.bedding_tension, np.zeros(nt), np.inf,
            *initial_backlash(self.route, path, sprung), False,
        )  # fmt: skip
        commit_springs(self.actuation, self.chain_state.s, self.chain_state.T)

    def step(self, current: np.ndarray, dt: float) -> np.ndarray:
        """Heat the springs with currents (n_tendon,) A for dt seconds; return the true base tensions (n_tendon,) N after it.

        Raises SolveError where springs and body have no equilibrium.
        """
        springs, warm = self.actuation, self.spring_temperature
        for t in range(self.n_tendon):
            warm[t] = heated_temperature(springs.spring, t, warm[t], springs.elongation[t], current[t], self.temperature, dt)
        target = HeldTarget(self.chain_state.q.copy(), self.actuation.free_length.copy(), self.spring_temperature)
        near_post = bool(self.law.wall[9] > 0.0)
        if reach_target(self.statics, self.chain_state, self.factors, self.actuation, target, SOLVE_TOLERANCE, near_post) == 0:
            raise SolveError("springs and body have no equilibrium; check the currents (A) and the time step (s)")
        commit_springs(self.actuation, self.chain_state.s, self.chain_state.T)
        return self.tension

    def set_loads(self, loads: Loads) -> None:
        """Set other loads, at the present spring temperatures.

        Raises SolveError, and keeps the loads, where there is no equilibrium.
        """
        before, moved = self.load, self.state()
        self.load = self.solver.static_load(self.twin.effect_chain.surround(loads), self.softness)
        self.factors.usable[0] = False
        try:
            self.step(np.zeros(self.n_tendon), 0.0)
        except SolveError:
            self.load = before
            self.restore(moved)
            raise

    def solution(self) -> ChainSolution:
        """Return the present state as a trial of one sample."""
        update_kinematics(self.statics, self.chain_state.q)
        chain = self.solver.chain
        return ChainSolution(
            tension=self.tension[None], path=self.chain_state.s[None, :, 0].copy(), markers=chain.site[chain.marker][None].copy(),
            status=np.full(1, DIRECT), q=self.chain_state.q[None].copy(),
            others={"temperature": self.spring_temperature[None].copy()}, slip=self.chain_state.z.copy(),
            distal=self.chain_state.s.copy(),
        )  # fmt: skip

    @property
    def elongation(self) -> np.ndarray:
        """Elongation (n_tendon,) m of the springs."""
        return self.actuation.elongation.copy()
