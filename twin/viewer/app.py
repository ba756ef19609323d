"""The panel of twins beside the picture: by hand, or beside the trials of a set."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
import viser

from twin.effects import Drive
from twin.errors import DataError
from twin.figure import Frames
from twin.measurements import Recording
from twin.twin import Twin
from twin.viewer.controls import MOST_PUSH, Controls
from twin.viewer.panel import Panel
from twin.viewer.replay import Track
from twin.viewer.scene import set_up
from twin.viewer.scrubber import Scrubber, between
from twin.viewer.side import DESCRIBED, Side

TELLING, PLOTTING = 0.1, 1.0  # s between words and between plots of a running replay: a reader needs no more
REPLAY, BY_HAND = "replay", "by hand"


class App(Panel):
    """One twin in a browser or two beside each other, under the same sliders or beside the trials of a set."""

    scrubber: Scrubber

    def __init__(self, server: viser.ViserServer, twins: Sequence[tuple[str, Twin]], recording: Recording | None = None) -> None:
        """`twins` by name, which is shown where there are two. Each is compared with its robot as described. Raises DataError for a
        robot that is not drawn, a set that does not drive it, or two robots that the same sliders do not drive."""
        super().__init__(server)
        places = set_up(server, twins[0][1].robot.gravity, [twin.figure() for _, twin in twins])
        names = [f"{letter}: {name}" if len(twins) > 1 else "" for letter, (name, _) in zip("AB", twins, strict=False)]
        self.sides = [
            Side(server, twin, name, where, recording) for name, (_, twin), where in zip(names, twins, places, strict=True)
        ]
        self._told, self._plotted, self._resting = 0.0, 0.0, False
        self._tracks: list[Track] = []
        self._panel(recording)

    # ---- the panel ------------------------------------------------------------------------------------------------------

    def _panel(self, recording: Recording | None) -> None:
        gui, first, replay = self.server.gui, self.sides[0], self.sides[0].replay
        gui.configure_theme(control_width="medium", dark_mode=False)
        told = "\n\n".join(f"{f'{s.name}, ' if s.name else ''}**{s.twin.robot.title}**" for s in self.sides)
        gui.add_markdown(told + (f"\n\n{recording.title}  \n*{recording.source}*" if recording else ""))
        self._heading(gui)
        self._mode = gui.add_dropdown("show", (REPLAY, BY_HAND) if replay else (BY_HAND,), hint="a trial, or your own pulls")
        self._changed(self._mode)
        self._colours(gui, first.figure.shades)
        self._picture_button(gui)
        for side in self.sides:
            side.panel(gui, self._changed)
        self._replaying = gui.add_folder("replay", visible=replay is not None)
        lines = [s.name for s in self.sides] if len(self.sides) > 1 else [DESCRIBED, "as shown"]
        with self._replaying:
            self.scrubber = Scrubber(gui, replay.labels if replay else (), lines, self._changed)
            self._film_button(gui)
        self._driving = gui.add_folder("by hand", visible=replay is None)
        with self._driving:
            self.hand = Controls(gui, first.twin, first.figure, self._changed)
        self._alike()
        self.hand.by.on_update(lambda _: self._asked.append(self._let_go))
        self.hand.rest.on_click(lambda _: self._asked.append(self._rest))
        self.hand.slack.on_click(lambda _: self._asked.append(self._let_go))
        self.server.scene.on_click()(lambda event: self._asked.append(lambda: self._touched(event)))

    def _alike(self) -> None:
        """Raises DataError where two robots are not driven by the same sliders."""
        one, *others = (tuple(tuple(sorted({p.drive for p in port})) for port in s.twin.robot.build().drives) for s in self.sides)
        if any(other != one for other in others):
            raise DataError(
                f"the same sliders do not drive {' and '.join(s.twin.robot.name for s in self.sides)}: they have other tendons; "
                "look at one after the other"
            )

    def _let_go(self) -> None:
        self.hand.let_go()
        for side in self.sides:
            side.forget()

    def _rest(self) -> None:
        self._resting = True

    def _touched(self, event: viser.SceneClickEvent) -> None:
        """A push where a robot by hand was clicked."""
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        for side in self.sides if self._mode.value == BY_HAND else ():
            hold = None if side.shown is None else side.scene.touched(side.shown, origin, direction)
            if hold is not None:
                self.hand.take(hold)
                return

    @property
    def _end(self) -> float:
        return float(self._tracks[0].time[-1])

    def _stand(self) -> None:
        self._show_replay(0.0, True)

    # ---- what is drawn --------------------------------------------------------------------------------------------------

    def _shown(self, passed: float) -> bool:
        """Whether anything was drawn."""
        replaying = self._mode.value == REPLAY
        running = self.scrubber.play.value and bool(self._tracks) if replaying else self._heating
        if not (self._wanted or running):
            return False
        asked, self._wanted = self._wanted, False
        if replaying:
            self._show_replay(passed if running else 0.0, asked)
        else:
            self._show_live(passed if running else 0.0)
        return True

    @property
    def _heating(self) -> bool:
        """Whether springs are warming or cooling as the clock goes on."""
        if self.hand.drive is not Drive.CURRENT or self.hand.clock.value == 0.0:
            return False
        return any(s.heated is not None and s.heated.changing for s in self.sides)

    def _show_replay(self, passed: float, asked: bool) -> None:
        k = self.scrubber.chosen
        if asked or not self._tracks:
            self._tracks = [side.track(k) for side in self.sides]
            self._replaying.visible, self._driving.visible = True, False
            self.scrubber.until(self._end)
            self._coloured([t.frames for t in self._tracks])
        t = self.scrubber.on(passed, self._end)
        i, share = between(self._tracks[0].time, t)
        for side, track in zip(self.sides, self._tracks, strict=True):
            assert side.replay is not None
            measured, shown = side.replay.measured(k), track.frames.at(i, share)
            j = min(i + 1, len(measured) - 1)
            predicted, seen = ((1.0 - share) * m[i] + share * m[j] for m in (track.markers, measured))
            side.scene.draw(shown, self._shade, self._ranges)
            side.scene.mark(predicted, seen, self.scrubber.arrows.value)
            side.scene.pushed(predicted[0], np.zeros(3))
        now = time.monotonic()
        if asked or now - self._told > TELLING:
            self._told = now
            self._tell_replay(k, i, asked)

    def _tell_replay(self, k: int, i: int, asked: bool) -> None:
        before = [side.before(k) for side in self.sides]
        if asked or time.monotonic() - self._plotted > PLOTTING:
            self._plotted = time.monotonic()
            replay = self.sides[0].replay
            assert replay is not None
            self.scrubber.draw(replay, self._tracks if len(self.sides) > 1 else [*before, *self._tracks], i)
        lines = [f"t = {self._tracks[0].time[i]:.2f} s"]
        for side, track, described in zip(self.sides, self._tracks, before, strict=True):
            now, whole, was = (1e3 * e for e in (track.error[i], track.rms, described.rms))
            words = f"error **{now:.2f} mm**, over the trial **{whole:.2f} mm** ({side.told}); as described {was:.2f} mm"
            lines.append(_named(side) + words)
        self.words.content = "  \n".join([*lines, "blue: predicted markers, red: measured, arrows: residual"])

    def _show_live(self, passed: float) -> None:
        self._replaying.visible, self._driving.visible = False, True
        hand, rest, lines = self.hand, self._resting, []
        self._resting = False
        for side in self.sides:
            if hand.drive is Drive.CURRENT:
                shown = side.heat(hand.command, hand.loads, passed * hand.clock.value, rest)
            else:
                shown = side.stand(hand.drive, hand.command, hand.loads)
            self._coloured([shown], hand.most, hand.warmest)
            side.scene.draw(shown, self._shade, self._ranges)
            side.scene.mark(shown.markers[0], np.full_like(shown.markers[0], np.nan), 0.0)
            side.scene.pushed(side.figure.grips(shown)[hand.point()], hand.force / MOST_PUSH)
            lines.append(_named(side) + _standing(shown) + _warm(side))
        self.words.content = "  \n".join(lines)

    def _coloured(self, frames: Sequence[Frames], tension: float | None = None, warmest: float = 0.0) -> None:
        """Ranges that hold all of `frames`, or up to the largest tension (N) and warmest spring (K) there may be."""
        figure, pulled = self.sides[0].figure, max(float(f.tension.max()) for f in frames)
        most = tension if tension is not None and tension > pulled else float(np.ceil(10.0 * pulled) / 10.0)
        ranges = {shade: figure.coloured(shade, most) for shade in figure.shades}
        if any(f.temperature.size for f in frames):
            ranges["temperature"] = figure.coloured("temperature", max(warmest, *(f.temperature.max() for f in frames)))
        self._range(ranges)


def _named(side: Side) -> str:
    return f"{side.name}: " if side.name else ""


def _standing(shown: Frames) -> str:
    x, y, z = 1e3 * shown.markers[0, -1]
    ends = f"; tension along the tendons {shown.tension.min():.2f} to {shown.tension.max():.2f} N"
    return f"tip at x **{x:z.1f}**, y **{y:z.1f}**, z **{z:z.1f}** mm{ends}"


def _warm(side: Side) -> str:
    """The springs' heat in words, if currents pull."""
    if side.heated is None:
        return ""
    springs = ", ".join(f"{T - 273.15:.0f}" for T in side.heated.temperature)
    how = "still warming or cooling" if side.heated.changing else "at rest: the clock waits"
    return f"; springs at {springs} degC, **{side.heated.time:.0f} s** after they were cold, {how}"
