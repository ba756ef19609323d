"""The panel of trials of a hand's tasks: which one, when, how fast, and what became of it."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import viser

from twin.errors import DataError
from twin.learn.kept import sets, told
from twin.robots import load
from twin.viewer.panel import Panel
from twin.viewer.scene import Scene, set_up
from twin.viewer.scrubber import Clock, between
from twin.viewer.solids import Solids
from twin.viewer.stage import Stage, hand, stage, who

TELLING = 0.1  # s between words of a running replay
LOOKED_AT, FROM = np.array([0.0, 0.0, 0.8]), np.array([1.0, -1.73, -0.95])  # heights: from between two fingers, and from above


class Trials(Panel):
    """Trials that were kept, of persons and of policies."""

    def __init__(self, server: viser.ViserServer, folder: Path, number: int | None = None) -> None:
        """Of a folder that `twin demonstrate` made, or of one set in it; `number`: which is shown first, of the first set. Raises
        DataError where no trials are there, or not that one."""
        super().__init__(server)
        found = {name: {told(file)[0].number: file for file in files} for name, files in sets(folder).items()}
        self._sets = {who(name): files for name, files in found.items()}
        first = next(iter(self._sets.values()))
        if number is not None and number not in first:
            raise DataError(f"{folder} has no trial {number}; it has {_ranges(sorted(first))}")
        one, _ = told(next(iter(first.values())))
        figure, gravity = hand(one.robot, one.hand)[0], load(one.robot).gravity
        (where,) = set_up(server, gravity, [figure])
        camera = server.initial_camera
        camera.look_at, camera.position = tuple(LOOKED_AT), tuple(LOOKED_AT + FROM)
        self.scene, self._figure = Scene(server, figure, "", where), figure
        self.solids = Solids(server, self.scene.root, self.scene.scale)
        self._stage: Stage | None = None
        self._told = 0.0
        self._panel(f"**{load(one.robot).title}**", number)

    def _panel(self, title: str, number: int | None) -> None:
        gui = self.server.gui
        gui.configure_theme(control_width="medium", dark_mode=False)
        gui.add_markdown(title)
        self._heading(gui)
        self.wanted = gui.add_markdown("")
        self._colours(gui, self._figure.shades)
        self._picture_button(gui)
        self.who = gui.add_dropdown("whose", tuple(self._sets), hint="trials of a person's hand, or of a policy")
        self.who.on_update(lambda _: self._asked.append(self._other))
        self.scrubber = Clock(gui, self._labels(), self._changed)
        if number is not None:
            self.scrubber.trial.value = next(label for label in self.scrubber.labels if _number(label) == number)
        self._film_button(gui)

    def _labels(self) -> list[str]:
        """`3: success`."""
        return [f"{number}: {told(file)[1]}" for number, file in sorted(self._sets[self.who.value].items())]

    def _other(self) -> None:
        labels = self._labels()
        self.scrubber.choose_from(labels, labels[0])

    @property
    def _end(self) -> float:
        assert self._stage is not None
        return float(self._stage.kept.time[-1] - self._stage.kept.time[0])

    def _stand(self) -> None:
        self._show(0.0, True)

    def _shown(self, passed: float) -> bool:
        running = self.scrubber.play.value
        if not (self._wanted or running):
            return False
        asked, self._wanted = self._wanted, False
        self._show(passed if running else 0.0, asked)
        return True

    def _show(self, passed: float, asked: bool) -> None:
        if asked or self._stage is None:
            self._take_stage(stage(self._sets[self.who.value][_number(self.scrubber.trial.value)]))
        now = self._stage
        assert now is not None
        t = self.scrubber.on(passed, self._end)
        i, share = between(now.kept.time - now.kept.time[0], t)
        with self.server.atomic():
            self.scene.draw(now.frames.at(i, share), self._shade, self._ranges)
            self.solids.draw(*now.poses(i, share))
        if asked or time.monotonic() - self._told > TELLING:
            self._told, self.words.content = time.monotonic(), now.words(i)

    def _take_stage(self, chosen: Stage) -> None:
        self._stage = chosen
        self.scrubber.until(self._end)
        self.solids.put(chosen.kept.things)
        self.wanted.content = chosen.wanted
        most = float(np.ceil(10.0 * chosen.frames.tension.max()) / 10.0)
        self._range({shade: self._figure.coloured(shade, most) for shade in self._figure.shades})


def _number(label: str) -> int:
    return int(label.partition(":")[0])


def _ranges(numbers: list[int]) -> str:
    """`0 to 49`, or all that there are."""
    whole = numbers == list(range(numbers[0], numbers[-1] + 1))
    return f"{numbers[0]} to {numbers[-1]}" if whole and len(numbers) > 1 else ", ".join(map(str, numbers))
