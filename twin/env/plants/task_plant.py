"""A hand among the things of one of its tasks, whose tendons are each driven by a motor."""

from collections.abc import Mapping

import numpy as np

from twin.env.episodes.validation import select_arrays
from twin.env.plants.soft_plant import get_motion_state, hand_among_things, set_motion_state
from twin.mechanics.silicone.motion.scene import SceneState
from twin.prediction.twin import Twin
from twin.tasks import CONTROL_STEP, Task, TaskTrial


class TaskPlant:
    """One trial of a task that can be saved and continued. One instance serves one thread."""

    def __init__(self, twin: Twin, task: Task, seed: int, interval: float) -> None:
        """Draw the things by `seed`; `interval` (s) is rounded to whole steps of control.

        Raises DataError for a robot that is no hand and for effects that do not act here, SolveError where it has no equilibrium.
        """
        body, gravity, route = hand_among_things(twin)
        self.trial = TaskTrial(task, body, gravity, np.random.default_rng(seed), route)
        self._steps = max(1, round(interval / CONTROL_STEP))
        self.interval = self._steps * CONTROL_STEP
        self.rest = np.stack([finger.cords.rest for finger in body.fingers])

    @property
    def state(self) -> SceneState:
        """The scene now."""
        return self.trial.state

    def step(self, shortening: np.ndarray) -> None:
        """Step one interval on, or to the trial's end, the tendons (finger, tendon) m going straight to their command."""
        start = self.state.shortening
        for k in range(self._steps):
            if not self.trial.is_over:
                self.trial.pull(start + (shortening - start) * ((k + 1) / self._steps))

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the state as arrays by name."""
        arrays = {f"motion.{name}": a for name, a in get_motion_state(self.trial.scene.motion).items()}
        return arrays | {f"past.{name}": a for name, a in self.trial.get_past().items()}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a saved state of the same twin, task, seed and interval."""
        set_motion_state(self.trial.scene.motion, select_arrays(state, "motion"))
        self.trial.set_past(select_arrays(state, "past"))
