"""One of the twins that are shown: its switches, its place in the scene, and what it makes of pulls or of a trial."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import viser

from twin.effects import Drive, Loads
from twin.figure import Frames
from twin.measurements import Recording
from twin.twin import Twin
from twin.viewer.live import Heated, Live
from twin.viewer.replay import Replay, Track
from twin.viewer.scene import Scene
from twin.wording import in_words

DESCRIBED, BETTER = "as described", "with effects"


class Side:
    """A twin beside its robot as described, of which one is shown."""

    def __init__(self, server: viser.ViserServer, twin: Twin, name: str, where: np.ndarray, recording: Recording | None) -> None:
        """`name` is empty where only one twin is shown. Raises DataError for a robot that is not drawn, or a set that does not
        drive it."""
        self.twin, self.name, self.described, self.figure = twin, name, Twin.of(twin.robot), twin.figure()
        self.replay = Replay(recording, twin) if recording is not None else None
        self.scene = Scene(server, self.figure, name, where)
        self.shown: Frames | None = None
        self.heated: Heated | None = None
        self._live: tuple[Twin, Drive, Live] | None = None
        self._hot: Twin | None = None

    def panel(self, gui: viser.GuiApi, changed: Callable[[Any], None]) -> None:
        """The switches; `changed` is told of every handle that a person may move."""
        better = bool(self.twin.effects or self.twin.values)
        with gui.add_folder(f"twin {self.name}".strip(), visible=better):
            first = BETTER if better else DESCRIBED
            names = (DESCRIBED, BETTER)
            self.which = gui.add_dropdown("predicted", names, initial_value=first, hint="before and after a diagnosis")
            self.effects = {
                e.id: gui.add_checkbox(in_words(e.id), True, hint=f"moves with {e.moves_with}") for e in self.twin.effects
            }
        for handle in (self.which, *self.effects.values()):
            changed(handle)

    def chosen(self) -> Twin:
        if self.which.value == DESCRIBED:
            return self.described
        return replace(self.twin, effects=tuple(e for e in self.twin.effects if self.effects[e.id].value))

    def forget(self) -> None:
        """Friction's history and the springs' heat."""
        self._live = self.heated = self._hot = None

    def stand(self, drive: Drive, pull: np.ndarray, loads: Loads) -> Frames:
        """Under pulls (n_tendon,), N or m. Raises SolveError."""
        twin = self.chosen()
        if self._live is None or self._live[:2] != (twin, drive):
            self._live = twin, drive, Live(twin, drive)
        self.shown = self._live[2].shape(pull, loads)
        return self.shown

    def heat(self, current: np.ndarray, loads: Loads, passed: float, rest: bool) -> Frames:
        """`passed` (s) on under currents (n_tendon,) A, or until the springs `rest`. Raises SolveError."""
        twin = self.chosen()
        if self.heated is None or self._hot != twin:
            self.heated, self._hot = Heated(twin), twin
        self.shown = self.heated.rest(current, loads) if rest else self.heated.shape(current, loads, passed)
        return self.shown

    def track(self, trial: int) -> Track:
        """A trial as the chosen twin predicts it. Raises SolveError."""
        assert self.replay is not None
        return self.replay.track(self.chosen(), trial)

    def before(self, trial: int) -> Track:
        """As described."""
        assert self.replay is not None
        return self.replay.track(self.described, trial)

    @property
    def told(self) -> str:
        """What is shown, in words."""
        if self.which.value == DESCRIBED:
            return DESCRIBED
        return ", ".join(in_words(e.id) for e in self.chosen().effects) or "no effect"
