"""What is wanted of a finger, and what troubles it, without end; all of it by the seed and the time alone.

Wanted shapes are another finger's (other E, clamped alike), which goes from one drawn command to the next: MOVES s on the way,
RESTS s there. Commands are of the factory's free motion: a bend of up to BEND, and co-contraction of up to PRETENSION. Pushes are
patches on the skin as the factory draws them, one after the other. Each cord drifts at a rate of its own, and readings are noisy.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.control.held_finger import HeldFinger
from twin.foundation.errors import SolveError
from twin.mechanics.silicone.skin_loads import Pushes, push_surface
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.twin import Twin
from twin.shape.training_data.draw import LARGEST_BEND, LARGEST_PRETENSION, draw_pushes
from twin.tasks.imitation.demonstrate import RESISTANCE_NOISE, add_noise
from twin.tasks.imitation.hand_model import draw_built_hand
from twin.tasks.task import smooth_step

MOVES, RESTS = 2.0, 1.0  # s: a tendon goes 20 mm at most, and half of it mostly
ROW = 0.2  # s between two equilibria of the finger that shows; straight between them
EVERY, PUSHED, FADES = 20.0, 4.0, 0.5  # s: one push in each; how long it lasts; in which it comes and goes
DRIFT = 0.01  # of a resistance in TEN_HOURS, at most: of rubber 8.3 % in 14 h were seen (Yoo et al. 2025)
TEN_HOURS, MINUTE = 36_000.0, 60.0  # s
SHOWS = 1000  # added to the plant's seed: the finger that shows


class Course:
    """Of the plant that was built of a seed. One instance serves one thread."""

    def __init__(self, plant: Twin, seed: int) -> None:
        clamped = plant.values["mounting.angle"]
        values = {**draw_built_hand(plant.robot, seed + SHOWS), "mounting.angle": clamped}
        self.seed, self.finger = seed, HeldFinger(replace(plant, values=values, effects=()))
        body = self.finger.body
        self._skin, self._base = push_surface(body.cone, body.cells), rotation_about_z(clamped).T
        self._azimuth = np.arctan2(body.paths[:, 0, 1], body.paths[:, 0, 0])
        self._rates = self._drawn(0, 0).uniform(-DRIFT, DRIFT, len(body.cord_paths)) / TEN_HOURS
        self._rows: dict[int, np.ndarray] = {}
        self._noise, self._second = self._drawn(3, 0), 0
        self.unshown = 0  # rows at which the other finger had no equilibrium

    def _drawn(self, kind: int, k: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(5, kind, k)))

    def wanted(self, time: float) -> np.ndarray:
        """(P, 3) m of the base frame at `time` (s), which goes on."""
        row = int(time / ROW + 1e-9)
        for k in (row, row + 1):
            if k not in self._rows:
                self._rows[k] = self._row(k)
        for old in [k for k in self._rows if k < row]:
            del self._rows[old]
        share = time / ROW - row
        return (1.0 - share) * self._rows[row] + share * self._rows[row + 1]

    def _row(self, k: int) -> np.ndarray:
        """The other finger's points under its command, or where it last had an equilibrium."""
        try:
            self.finger.hold_at(self.command(k * ROW))
        except SolveError:
            self.unshown += 1
        return self.finger.points() @ self._base

    def command(self, time: float) -> np.ndarray:
        """(t,) m, of the finger that shows."""
        k = int(time / (MOVES + RESTS) + 1e-9)
        share = smooth_step((time - k * (MOVES + RESTS)) / MOVES)
        return (1.0 - share) * self._target(k - 1) + share * self._target(k)

    def _target(self, k: int) -> np.ndarray:
        if k < 0:
            return np.zeros(len(self._azimuth))
        rng = self._drawn(1, k)
        bend, towards = LARGEST_BEND * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
        return bend * np.cos(self._azimuth - towards) + np.tile(rng.uniform(0.0, LARGEST_PRETENSION, 2), len(self._azimuth) // 2)

    def push(self, time: float) -> np.ndarray | None:
        """(n_free, 3) N on the nodes, if something presses."""
        k = int(time / EVERY)
        rng = self._drawn(2, k)
        since = time - k * EVERY - rng.uniform(0.0, EVERY - PUSHED)
        if not 0.0 < since < PUSHED:
            return None
        drawn: Pushes = draw_pushes(rng, self.finger.body.cone, 1)
        return smooth_step(since / FADES) * smooth_step((PUSHED - since) / FADES) * self._skin.nodal_force(drawn)

    def read(self, true: np.ndarray, time: float) -> np.ndarray:
        """(s,) ohm as cords of `true` resistance read."""
        if (second := int(time + 1e-9)) != self._second:  # so that who goes on at a whole second reads the same
            self._noise, self._second = self._drawn(3, second), second
        return add_noise(true * (1.0 + self._rates * time), RESISTANCE_NOISE, self._noise)
