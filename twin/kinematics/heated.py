"""A twin under given loads whose tendons are pulled by SMA springs, stepped in time: currents in, heat, tensions and shape out.

What a trial of a current-driven recording does sample by sample (`twin.equilibrium.trial`), for those who decide the next current
only when they have seen the last tension: controllers and environments.
"""

from __future__ import annotations

import numpy as np

from twin.effects import Loads
from twin.equilibrium import TOLERANCE, Heating
from twin.equilibrium.lengths import Held, reach, remember
from twin.errors import SolveError
from twin.kinematics.robot import ROOM, LoadedRobot
from twin.springs.heat import heated
from twin.twin import Twin, heating_of, merged_route


class HeatedRobot(LoadedRobot):
    """Springs cold, robot at rest at first. `pull` is not for it: its tensions are what the springs make them."""

    def __init__(self, twin: Twin, loads: Loads | None = None, temperature: float = ROOM) -> None:
        """Raises DataError for a robot without springs, SolveError where cold springs and loads have no equilibrium."""
        n = twin.robot.n_tendon
        self.heating: Heating = heating_of(twin, np.full(1, temperature), np.ones(n, bool))
        super().__init__(twin, loads, temperature)

    def rest(self) -> None:
        """As at the start of a trial: springs at the room's temperature, the straight robot, then its loads. Raises SolveError."""
        nt, c = self.n_tendon, self.solver
        route, stiffness = merged_route(self.twin.effects), np.full(1, 1.0 / self.softness)
        start = c.solve(np.zeros(1), np.zeros((1, nt)), self.loads, route, stiffness=stiffness, heating=self.heating)
        if not start.status.all():
            raise SolveError(f"no shape with cold springs under the loads (payload {1e3 * self.loads.payload:.3g} g); check them")
        self.tension = start.tension[0] * self.softness
        self.q, self.slip, self.distal = start.q[0].copy(), start.slip.copy(), start.distal.copy()
        self.LU, self.fresh, self.held_by = np.empty((self.q.size, self.q.size)), np.zeros(1, bool), np.zeros(nt, bool)
        self.warm = np.full(nt, self.temperature)
        spring = self.heating.spring
        self.held = Held(
            np.ones(nt, bool), np.ones(nt, bool), c.straight_path.copy(), np.empty(nt), c.straight_path, self.stretch,
            np.full(1, self.softness), spring, self.warm.copy(), spring.initial_elongation.copy(), spring.initial_tension.copy(),
        )  # fmt: skip
        remember(self.held, self.distal, self.tension)

    def step(self, current: np.ndarray, dt: float) -> np.ndarray:
        """Heat the springs with currents (n_tendon,) A for dt seconds; returns the true base tensions (n_tendon,) N after it.

        Raises SolveError where springs and body find no equilibrium.
        """
        for t in range(self.n_tendon):
            self.warm[t] = heated(self.held.spring, t, self.warm[t], self.held.elongation[t], current[t], self.temperature, dt)
        model, data, chain, rest, law, load = self.statics
        last = self.q.copy()
        found = reach(
            model, data, chain, rest, law, load, self.slip, self.distal, self.q, self.LU, self.held_by, self.fresh, TOLERANCE,
            self.tension, self.held, last, self.held.free.copy(), self.warm,
        )  # fmt: skip
        if found == 0:
            raise SolveError("springs and body find no equilibrium; are the currents what was meant?")
        remember(self.held, self.distal, self.tension)
        return self.tension / self.softness

    @property
    def elongation(self) -> np.ndarray:
        """Of the springs (n_tendon,) m."""
        return self.held.elongation.copy()
