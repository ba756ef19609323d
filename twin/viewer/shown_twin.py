"""One of the shown twins: its switches, its place in the scene, its shape by hand or in a trial."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import viser

from twin.body import Drive, Loads
from twin.body.drawable import Frames
from twin.foundation.display_names import display_name
from twin.measurements import Recording
from twin.prediction.twin import Twin
from twin.viewer.drawing.scene import Scene
from twin.viewer.live import LiveHeatedRobot, LiveRobot
from twin.viewer.replay import PredictedTrial, Replay

DESCRIBED, WITH_EFFECTS = "as described", "with effects"


class ShownTwin:
    """A twin and its robot as described; a switch chooses which is shown."""

    def __init__(self, server: viser.ViserServer, twin: Twin, name: str, where: np.ndarray, recording: Recording | None) -> None:
        """Draw the twin at `where` (3,); `name` is empty where only one twin is shown.

        Raises DataError for a robot that is not drawn, or a set that does not drive it.
        """
        self.twin, self.name, self.described, self.figure = twin, name, Twin.of(twin.robot), twin.figure()
        self.replay = Replay(recording, twin) if recording is not None else None
        self.scene = Scene(server, self.figure, name, where)
        self.frames: Frames | None = None
        self.heated_robot: LiveHeatedRobot | None = None
        self._live: tuple[Twin, Drive, LiveRobot] | None = None
        self._heated_twin: Twin | None = None

    def add_switches(self, gui: viser.GuiApi, changed: Callable[[Any], None]) -> None:
        """Add the switches and call `changed` with every handle that a user may move."""
        better = bool(self.twin.effects or self.twin.values)
        with gui.add_folder(f"twin {self.name}".strip(), visible=better):
            first = WITH_EFFECTS if better else DESCRIBED
            names = (DESCRIBED, WITH_EFFECTS)
            self.model_choice = gui.add_dropdown("predicted", names, initial_value=first, hint="before and after a diagnosis")
            self.effect_switches = {
                e.id: gui.add_checkbox(display_name(e.id), True, hint=f"varies with {e.moves_with}") for e in self.twin.effects
            }
        for handle in (self.model_choice, *self.effect_switches.values()):
            changed(handle)

    def chosen_twin(self) -> Twin:
        if self.model_choice.value == DESCRIBED:
            return self.described
        return replace(self.twin, effects=tuple(e for e in self.twin.effects if self.effect_switches[e.id].value))

    def forget_history(self) -> None:
        """Clear the history of friction and the heat of the springs."""
        self._live = self.heated_robot = self._heated_twin = None

    def solve_statics(self, drive: Drive, pull: np.ndarray, loads: Loads) -> Frames:
        """Return the shape under pulls (n_tendon,), N or m. Raises SolveError."""
        twin = self.chosen_twin()
        if self._live is None or self._live[:2] != (twin, drive):
            self._live = twin, drive, LiveRobot(twin, drive)
        self.frames = self._live[2].shape(pull, loads)
        return self.frames

    def step_heating(self, current: np.ndarray, loads: Loads, passed: float, rest: bool) -> Frames:
        """Return the shape after `passed` (s) under currents (n_tendon,) A, or once springs `rest`. Raises SolveError."""
        twin = self.chosen_twin()
        if self.heated_robot is None or self._heated_twin != twin:
            self.heated_robot, self._heated_twin = LiveHeatedRobot(twin), twin
        self.frames = self.heated_robot.rest(current, loads) if rest else self.heated_robot.shape(current, loads, passed)
        return self.frames

    def predict(self, trial: int) -> PredictedTrial:
        """Predict a trial with the chosen twin. Raises SolveError."""
        assert self.replay is not None
        return self.replay.predict(self.chosen_twin(), trial)

    def predict_as_described(self, trial: int) -> PredictedTrial:
        """Predict a trial with the robot as described."""
        assert self.replay is not None
        return self.replay.predict(self.described, trial)

    @property
    def model_label(self) -> str:
        """Return what is shown, in words."""
        if self.model_choice.value == DESCRIBED:
            return DESCRIBED
        return ", ".join(display_name(e.id) for e in self.chosen_twin().effects) or "no effect"
