"""Run one trial of a task step by step: by a person's hand on slack fingers, or by tendons."""

from collections.abc import Mapping
from dataclasses import fields

import numpy as np

from twin.body import Route
from twin.foundation.errors import SolveError
from twin.mechanics.silicone import HandBody
from twin.mechanics.silicone.motion.scene import Scene, SceneState
from twin.mechanics.silicone.skin_loads import Pushes, push_surface
from twin.shape.training_data.draw import PAID_OUT_DISPLACEMENT
from twin.tasks.task import CONTROL_STEP, TABLE_NAME, Demonstrator, ObjectTrack, Outcome, Task

TABLE_SPEED = 0.05  # m/s, of a sinking table


class TaskTrial:
    """A hand and the task's things, from rest."""

    def __init__(
        self, task: Task, body: HandBody, gravity: np.ndarray, rng: np.random.Generator, route: Route | None = None
    ) -> None:
        """Draw the things; `route` gives the tendons' friction. Raises SolveError where the hand has no equilibrium."""
        self.task, self.things = task, task.draw_things(rng)
        self.scene = Scene(body, self.things, gravity, route)
        self.start = self.state = self.scene.observe()
        self._push_surfaces = [push_surface(finger.cone, finger.cells) for finger in body.fingers]
        self._states, self.lost, self._side_push = [self.state], "", 0.0
        self._table_drops = [0.0]

    @property
    def table_drop(self) -> float:
        """How far (m) the table has sunk."""
        return self._table_drops[-1]

    @property
    def is_over(self) -> bool:
        """Whether the time is up or the simulation has ended."""
        return bool(self.lost) or self.state.time > self.task.duration - 0.5 * CONTROL_STEP

    def pull(self, shortening: np.ndarray) -> None:
        """Step on by CONTROL_STEP, tendons shortened to (finger, tendon) m by its end. A lost simulation is an outcome, no
        error."""
        drop_time, drop = self.task.table_drop_time, self._table_drops[-1]
        if drop_time is not None and self.state.time > drop_time:
            self.scene.move_thing(TABLE_NAME, [0.0, 0.0, TABLE_SPEED * CONTROL_STEP])
            drop += TABLE_SPEED * CONTROL_STEP
        try:
            self.state = self.scene.step_tendons(shortening, CONTROL_STEP)
            self._states.append(self.state)
            self._table_drops.append(drop)
        except SolveError as fault:
            self.lost = str(fault)

    def push(self, demonstrator: Demonstrator) -> None:
        """Step on by CONTROL_STEP under a person's hand, all tendons paid out."""
        d, inwards = demonstrator, demonstrator.push_force(self.state.time)
        self._side_push = self.task.side_push(self._side_push, self.state, self.start)
        force = np.column_stack([inwards, self._side_push * (d.force > 0.0), np.zeros(len(inwards))])
        self.scene.set_node_forces(np.stack([
            skin.nodal_force(Pushes(d.height[k : k + 1], d.azimuth[k : k + 1], d.width[k : k + 1], force[k : k + 1]))
            for k, skin in enumerate(self._push_surfaces)
        ]))  # fmt: skip
        self.pull(np.full_like(self.state.shortening, PAID_OUT_DISPLACEMENT))

    def frames(self, every: int) -> list[tuple[SceneState, float]]:
        """Return the observations at every so many steps and the last one, with how far (m) the table had sunk then."""
        last = len(self._states) - 1
        return [(self._states[k], self._table_drops[k]) for k in sorted({*range(0, last + 1, every), last})]

    def get_past(self) -> dict[str, np.ndarray]:
        """Return the states so far as arrays by name, a row a state."""
        past = {f.name: np.array([getattr(state, f.name) for state in self._states]) for f in fields(SceneState)}
        return past | {"table_drop": np.array(self._table_drops), "lost": np.array(self.lost)}

    def set_past(self, past: Mapping[str, np.ndarray]) -> None:
        """Continue after what `get_past` returned; the scene's motion is restored apart."""
        columns = {f.name: past[f.name] for f in fields(SceneState)}
        rows = ({n: a[i].copy() if a.ndim > 1 else a[i].item() for n, a in columns.items()} for i in range(len(past["time"])))
        self._states = [SceneState(**row) for row in rows]
        self.scene.move_thing(TABLE_NAME, [0.0, 0.0, float(past["table_drop"][-1]) - self.table_drop])
        self.state, self._table_drops, self.lost = self._states[-1], past["table_drop"].tolist(), str(past["lost"])
        self.scene.restore_shortening(self.state.shortening)

    def track(self) -> ObjectTrack:
        """Return the object's track so far."""
        states: list[SceneState] = self._states
        return ObjectTrack(
            np.array([s.time for s in states]), np.stack([s.place[0] for s in states]), np.stack([s.turn[0] for s in states]),
            np.array([s.touching for s in states]), np.stack([s.place[1:] for s in states]),
        )  # fmt: skip

    def outcome(self) -> Outcome:
        """Return how the trial ended."""
        return Outcome.ENDED if self.lost else self.task.judge(self.track())
