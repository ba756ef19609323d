"""One trial of a task, a step at a time: by a person's hand on slack fingers, or by tendons."""

from __future__ import annotations

import numpy as np

from twin.errors import SolveError
from twin.factory.draw import Pushes
from twin.factory.solve import surface
from twin.soft import HandBody
from twin.soft.scene import Scene, Sight
from twin.tasks.task import STEP, TABLE, Outcome, Person, Task, Track

SINKS = 0.05  # m/s
PAID_OUT = -15e-3  # m: slack


class Trial:
    """A hand and the task's things, from rest."""

    def __init__(self, task: Task, body: HandBody, gravity: np.ndarray, rng: np.random.Generator) -> None:
        """The things are drawn. Raises SolveError where the hand has no equilibrium."""
        self.task, self.things = task, task.things(rng)
        self.scene = Scene(body, self.things, gravity)
        self.start = self.seen = self.scene.see()
        self._skins = [surface(finger.cone, finger.cells) for finger in body.fingers]
        self._looks, self._lost, self._aside = [self.seen], False, 0.0
        self._sunk = [0.0]

    @property
    def over(self) -> bool:
        return self._lost or self.seen.time > self.task.seconds - 0.5 * STEP

    def pull(self, shortening: np.ndarray) -> None:
        """STEP s on, tendons shortened to (finger, tendon) m by its end; a simulation that ends is an outcome, no error."""
        leaves, sunk = self.task.leaves, self._sunk[-1]
        if leaves is not None and self.seen.time > leaves:
            self.scene.shift(TABLE, [0.0, 0.0, SINKS * STEP])
            sunk += SINKS * STEP
        try:
            self.seen = self.scene.pull(shortening, STEP)
            self._looks.append(self.seen)
            self._sunk.append(sunk)
        except SolveError:
            self._lost = True

    def push(self, person: Person) -> None:
        """STEP s on under a person's hand, all tendons paid out."""
        inwards = person.squeeze(self.seen.time)
        self._aside = self.task.sideways(self._aside, self.seen, self.start)
        force = np.column_stack([inwards, self._aside * (person.force > 0.0), np.zeros(len(inwards))])
        self.scene.press(np.stack([
            skin.force(Pushes(person.height[k : k + 1], person.azimuth[k : k + 1], person.width[k : k + 1], force[k : k + 1]))
            for k, skin in enumerate(self._skins)
        ]))  # fmt: skip
        self.pull(np.full_like(self.seen.shortening, PAID_OUT))

    def frames(self, every: int) -> list[tuple[Sight, float]]:
        """What was seen, at every so many steps and last, and by how many m the table had sunk then."""
        last = len(self._looks) - 1
        return [(self._looks[k], self._sunk[k]) for k in sorted({*range(0, last + 1, every), last})]

    def track(self) -> Track:
        looks: list[Sight] = self._looks
        return Track(
            np.array([s.time for s in looks]), np.stack([s.place[0] for s in looks]), np.stack([s.turn[0] for s in looks]),
            np.array([s.touching for s in looks]), np.stack([s.place[1:] for s in looks]),
        )  # fmt: skip

    def outcome(self) -> Outcome:
        return Outcome.ENDED if self._lost else self.task.judge(self.track())
