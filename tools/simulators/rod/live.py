"""The bench robot under commands that are decided when its last answer is seen: base tensions at equal intervals.

It starts each time as a trial does (bench.py): straight and unloaded; gravity and payload in 4 steps, slack tendons in 12 more,
RAMP_SECONDS seconds in all; nothing has crept before. Effects of mechanics, load cells and camera act; those of drives and weather
do not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tools.simulators.rod.bench import GAUSS_NODES, LARGEST_DRIVE_STEP, RAMP_SECONDS
from tools.simulators.rod.effects import Effect, Situation
from tools.simulators.rod.march import Creep, Standing
from tools.simulators.rod.rod import Conditions, Rod, solve, straight_lengths

STEPS_BEFORE_FIRST_ROW = 16  # steps before the first row
ELSEWHERE = ("deliver", "soften", "pull", "encode")  # where an effect may act that does not act here


class LiveRobot:
    """A built robot with its effects, led by base tensions. `gravity` (3,) m/s^2, as declared."""

    def __init__(self, rod: Rod, effects: Sequence[Effect], gravity: Sequence[float] = (0.0, 0.0, 9.81)) -> None:
        """Raises ValueError for an effect that acts in a drive or with the room's temperature."""
        for effect in effects:
            idle = [place for place in ELSEWHERE if getattr(type(effect), place) is not getattr(Effect, place)]
            if idle:
                raise ValueError(f"{effect.id} acts in {', '.join(idle)}, which a live robot has not; take an effect of mechanics")
        self.rod, self.effects, self._declared = rod, effects, np.array(gravity)
        self.rest()

    def rest(self) -> None:
        """As at the start of a trial: slack, under gravity, friction and creep without history."""
        s = self.situation = Situation(self.rod, self._declared, 0.0, 0.0)
        for effect in self.effects:
            effect.mount(s)
        given = Conditions(gravity=s.gravity, payload=s.payload, fields=s.fields, mu=s.mu, stroke=s.stroke, nodes=GAUSS_NODES)
        problem, T = given.problem(s.rod), s.rod.hole_radius.shape[1]
        creep = None if s.creep is None else Creep(*s.creep, np.zeros((len(s.creep[1]), *problem.body.rest.shape)))
        self._standing = Standing(problem, creep)
        self.time, self.tension = 0.0, np.zeros(T)
        for k in range(1, STEPS_BEFORE_FIRST_ROW + 1):
            self._standing.to(self.tension, min(k / 4, 1.0), 1.0, RAMP_SECONDS / STEPS_BEFORE_FIRST_ROW)

    def pull(self, tension: np.ndarray, seconds: float) -> None:
        """Straight to base tensions (T,) N, `seconds` long, in steps of at most LARGEST_DRIVE_STEP. Raises NoEquilibrium."""
        parts = max(1, int(np.ceil(np.abs(tension - self.tension).max() / LARGEST_DRIVE_STEP[False])))
        for k in range(1, parts + 1):
            self._standing.to(self.tension + k / parts * (tension - self.tension), 1.0, 1.0, seconds / parts)
        self.time, self.tension = self.time + seconds, np.array(tension, float)

    @property
    def disks(self) -> np.ndarray:
        """(N, 3) m, where they truly are; the tip is the last."""
        return self._standing.pose.disk_r[1:].copy()

    def markers(self) -> np.ndarray:
        """(N, 3) m as the camera reports them, without noise."""
        pose = self._standing.pose
        seen = (pose.disk_r[1:] + self.situation.rod.marker_offset[:, None] * pose.disk_R[1:, :, 2])[None]
        for effect in self.effects:
            seen = effect.observe(np.array([self.time]), np.array([23.0]), seen)
        return seen[0]

    def load_cells(self) -> np.ndarray:
        """(T,) N as they read, without noise."""
        seen = self.tension[None]
        for effect in self.effects:
            seen = effect.read(np.array([self.time]), seen)
        return seen[0]

    def displacement(self) -> np.ndarray:
        """(T,) m that the motors have pulled in."""
        return straight_lengths(self.situation.rod) - self._standing.pose.length.sum(axis=0)

    def rest_tip(self, tension: np.ndarray) -> np.ndarray:
        """(3,) m: where the tip would rest under base tensions (T,) N without friction and creep."""
        s = self.situation
        return solve(s.rod, tension, gravity=s.gravity, payload=s.payload, fields=s.fields, nodes=GAUSS_NODES).disks[-1]
