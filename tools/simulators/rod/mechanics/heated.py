"""March of a rod whose tendons SMA springs pull: rod and springs meet at a length and a tension, row by row.

The rod is solved with each spring replaced by its tangent, T = s + k (e - e_0), which is a tendon held at a length with a stretch
of 1/k; the tangent is taken again where the rod went until spring and tendon agree. Where they do not, the row comes in parts.
"""

from typing import NamedTuple

import numpy as np

from tools.simulators.rod.mechanics.march import SMALLEST_LOAD_PART, NoEquilibrium, Record, commit, start_pose
from tools.simulators.rod.mechanics.newton import equilibrium
from tools.simulators.rod.mechanics.springs import FIRST_ELONGATION, GF, Springs
from tools.simulators.rod.mechanics.statics import Problem

AGREED = 1e-4  # gf between spring and tendon
HEATED_TRIES = 12


class Heat(NamedTuple):
    """A sequence of rows; row 0 is reached cold from the unloaded straight robot."""

    current: np.ndarray  # (n, T) A, from this row to the next
    ambient: np.ndarray  # (n,) degC
    weight: np.ndarray  # (n,) factor on the dead loads
    softness: np.ndarray  # (n,) factor on the compliance
    dt: np.ndarray  # (n,) s taken to reach the row


class SpringRod:
    """A rod and its springs at rest together; `to` leads both on by a row."""

    def __init__(self, problem: Problem, springs: Springs, stretch: float) -> None:
        """Straight, unloaded and cold; `stretch` (m/N) of the tendons between spring and tip."""
        self._problem, self._stretch = problem, stretch
        self.u = problem.body.rest.copy()
        self.pose = start_pose(problem, self.u)
        self._straight = self.pose.length.sum(axis=0)
        self.springs, self.tension = springs, GF * springs.force
        self._elongation, self._weight = springs.elongation, 0.0  # mm, factor on the dead loads

    def to(self, hot: Springs, weight: float, softness: float) -> None:
        """To springs at other temperatures, in parts where that is too far at once. Raises NoEquilibrium."""
        problem = self._problem
        soft = problem.body._replace(compliance=problem.body.compliance * softness)
        done, part = 0.0, 1.0
        while done < 1.0:
            part = min(part, 1.0 - done)
            share = done + part
            now = self.springs.at(self.springs.temperature + share * (hot.temperature - self.springs.temperature))
            u_old, T_old = self.u.copy(), self.tension.copy()
            found = self._agreed(problem._replace(body=soft), now, self._weight + share * (weight - self._weight))
            if found is None:
                self.u[:], self.tension[:] = u_old, T_old
                part *= 0.5
                if part < SMALLEST_LOAD_PART:
                    raise NoEquilibrium(f"springs at {now.temperature} degC do not settle")
                continue
            commit(problem.friction, self.pose)
            self._elongation = found
            done += part
            part *= 2.0
        self.springs, self._weight = hot.rested(self._elongation), weight

    def _agreed(self, problem: Problem, springs: Springs, weight: float) -> np.ndarray | None:
        """Return the elongation (T,) mm at which springs and tendons pull alike; None where none is found."""
        e, load = self._elongation, problem.load
        for _ in range(HEATED_TRIES):
            s, k = springs.tangent(e)
            # e = 9 mm + length - straight - stretch T = e_now + (T - s) / k, all in m and N
            step = load._replace(
                disk_force=weight * load.disk_force,
                line_force=weight * load.line_force,
                free_length=self._straight + 1e-3 * (e - FIRST_ELONGATION - s / k),
                stretch=self._stretch + 1e-3 / (GF * k),
                driven_by_length=True,
            )
            if not equilibrium(self.u, self.tension, problem._replace(load=step), self.pose):
                return None
            e = FIRST_ELONGATION + 1e3 * (self.pose.length.sum(axis=0) - self._straight - self._stretch * self.tension)
            if np.abs(np.maximum(springs.pull(e), 0.0) - self.tension / GF).max() < AGREED:
                return e
        return None


def march_heated(problem: Problem, springs: Springs, heat: Heat, record: Record, stretch: float = 0.0) -> np.ndarray:
    """March, fill `record` and return the springs' temperatures (m, T) in degC at the rows it keeps. Raises NoEquilibrium."""
    rod, kept = SpringRod(problem, springs.at(heat.ambient[0]), stretch), []
    for row in range(len(heat.dt)):
        before = row - 1
        hot = rod.springs.stepped(heat.current[before], heat.ambient[before], heat.dt[row]) if row else rod.springs
        try:
            rod.to(hot, heat.weight[row], heat.softness[row])
        except NoEquilibrium as fault:
            raise NoEquilibrium(f"row {row} of {len(heat.dt)}: {fault}") from None
        if record.keep[row]:
            record.store(len(kept), rod.pose, rod.u, rod.tension)
            kept.append(rod.springs.temperature)
    return np.array(kept)
