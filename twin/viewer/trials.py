"""The panel of recorded trials of a hand's tasks: trial, time, speed and outcome."""

import time
from pathlib import Path

import numpy as np
import viser

from twin.foundation.errors import DataError
from twin.robots import load
from twin.tasks.imitation.episode_store import episode_sets, read_info
from twin.viewer.drawing.drawn_trial import DrawnTrial, build_hand, performer, read_drawn_trial
from twin.viewer.drawing.scene import Scene, place_robots
from twin.viewer.drawing.solids import Solids
from twin.viewer.panel import Panel
from twin.viewer.scrubber import Clock, neighbours

TRIAL_TEXT_PERIOD = 0.1  # s between texts of a running replay
CAMERA_TARGET, CAMERA_OFFSET = (
    np.array([0.0, 0.0, 0.8]),
    np.array([1.0, -1.73, -0.95]),
)  # heights: seen between two fingers, from above


class TaskPanel(Panel):
    """Recorded trials of persons and of policies."""

    def __init__(self, server: viser.ViserServer, folder: Path, number: int | None = None) -> None:
        """Show a folder made by `twin demonstrate`, or one set in it, beginning with trial `number` of the first set.

        Raises DataError where there are no trials, or not that one.
        """
        super().__init__(server)
        found = {name: {read_info(file)[0].number: file for file in files} for name, files in episode_sets(folder).items()}
        self._sets = {performer(name): files for name, files in found.items()}
        first = next(iter(self._sets.values()))
        if number is not None and number not in first:
            raise DataError(f"{folder} has no trial {number}; it has {_list_numbers(sorted(first))}")
        one, _ = read_info(next(iter(first.values())))
        figure, gravity = build_hand(one.robot, one.hand)[0], load(one.robot).gravity
        (where,) = place_robots(server, gravity, [figure])
        camera = server.initial_camera
        camera.look_at, camera.position = tuple(CAMERA_TARGET), tuple(CAMERA_TARGET + CAMERA_OFFSET)
        self.scene, self._figure = Scene(server, figure, "", where), figure
        self.solids = Solids(server, self.scene.root, self.scene.scale)
        self._trial: DrawnTrial | None = None
        self._text_written = 0.0
        self._add_controls(f"**{load(one.robot).title}**", number)

    def _add_controls(self, title: str, number: int | None) -> None:
        gui = self.server.gui
        gui.configure_theme(control_width="medium", dark_mode=False)
        gui.add_markdown(title)
        self._add_heading(gui)
        self.success_words = gui.add_markdown("")
        self._add_colour_choice(gui, self._figure.colour_fields)
        self._add_picture_button(gui)
        self.set_choice = gui.add_dropdown("whose", tuple(self._sets), hint="trials of a person, or of a policy")
        self.set_choice.on_update(lambda _: self._pending.append(self._change_set))
        self.scrubber = Clock(gui, self._labels(), self._redraw_on_change)
        if number is not None:
            self.scrubber.trial.value = next(label for label in self.scrubber.labels if _number(label) == number)
        self._add_film_button(gui)

    def _labels(self) -> list[str]:
        """Return labels such as `3: success`."""
        return [f"{number}: {read_info(file)[1]}" for number, file in sorted(self._sets[self.set_choice.value].items())]

    def _change_set(self) -> None:
        labels = self._labels()
        self.scrubber.set_trials(labels, labels[0])

    @property
    def _trial_end(self) -> float:
        assert self._trial is not None
        return float(self._trial.episode.time[-1] - self._trial.episode.time[0])

    def _draw_now(self) -> None:
        self._show(0.0, True)

    def _draw_if_wanted(self, passed: float) -> bool:
        running = self.scrubber.play.value
        if not (self._redraw or running):
            return False
        asked, self._redraw = self._redraw, False
        self._show(passed if running else 0.0, asked)
        return True

    def _show(self, passed: float, asked: bool) -> None:
        if asked or self._trial is None:
            self._set_trial(read_drawn_trial(self._sets[self.set_choice.value][_number(self.scrubber.trial.value)]))
        now = self._trial
        assert now is not None
        t = self.scrubber.advance(passed, self._trial_end)
        i, share = neighbours(now.episode.time - now.episode.time[0], t)
        with self.server.atomic():
            self.scene.draw(now.frames.frame_at(i, share), self._colour_field, self._ranges)
            self.solids.move(*now.poses(i, share))
        if asked or time.monotonic() - self._text_written > TRIAL_TEXT_PERIOD:
            self._text_written, self.words.content = time.monotonic(), now.describe(i)

    def _set_trial(self, chosen: DrawnTrial) -> None:
        self._trial = chosen
        self.scrubber.set_end(self._trial_end)
        self.solids.show(chosen.episode.things)
        self.success_words.content = chosen.success
        most = float(np.ceil(10.0 * chosen.frames.tension.max()) / 10.0)
        self._set_ranges({shade: self._figure.colour_scale(shade, most) for shade in self._figure.colour_fields})


def _number(label: str) -> int:
    return int(label.partition(":")[0])


def _list_numbers(numbers: list[int]) -> str:
    """Return `0 to 49` for a full range, else all numbers."""
    whole = numbers == list(range(numbers[0], numbers[-1] + 1))
    return f"{numbers[0]} to {numbers[-1]}" if whole and len(numbers) > 1 else ", ".join(map(str, numbers))
