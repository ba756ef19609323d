"""The panel beside the picture, and the loop that serves both.

Callbacks of the panel only note what is wanted: one loop solves and draws, since a solver serves one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import viser
import viser.uplot

from twin.effects import Drive, Loads
from twin.errors import TwinError
from twin.figure import Frames, Range
from twin.measurements import Recording
from twin.rollout import full_pull
from twin.twin import Twin
from twin.viewer.colours import bar
from twin.viewer.live import Live
from twin.viewer.replay import Replay, Track
from twin.viewer.scene import Scene

RATE = 60.0  # Hz, of the loop
MOST = 1.5  # full pulls at a slider's end
MOST_PUSH = 0.2  # N: bends the rod and the finger by centimetres
TELLING, PLOTTING = 0.1, 1.0  # s between words and between plots of a running replay: a reader needs no more
DESCRIBED, BETTER = "as described", "with effects"
REPLAY, BY_HAND = "replay", "by hand"
BY = {  # what is pulled by: name, unit, meaning, SI of one
    Drive.TENSION: ("tension", "N", "tension as its load cell reads it", 1.0),
    Drive.DISPLACEMENT: (
        "displacement",
        "mm",
        "taken up by its motor from the hanging rest, negative let out; the others hold",
        1e-3,
    ),
}
NOW = {"label": "now", "stroke": "#d62728"}


class App:
    """A twin in a browser, under sliders, or beside the trials of a set."""

    def __init__(self, server: viser.ViserServer, twin: Twin, recording: Recording | None = None) -> None:
        """`twin` is compared with its robot as described. Raises DataError for a robot that is not drawn, or a set that does not
        drive it."""
        self.server, self.twin = server, twin
        self._described = Twin.of(twin.robot)
        self._figure = twin.figure()
        self._replay = Replay(recording, twin) if recording is not None else None
        self._scene = Scene(server, self._figure, twin.robot.gravity)
        self._wanted, self._clock, self._told, self._plotted = True, time.monotonic(), 0.0, 0.0
        self._track: Track | None = None
        self._live: tuple[Twin, Live] | None = None
        self._range = self._figure.coloured(MOST)
        self._panel(recording)
        self.drawn = 0  # pictures sent

    # ---- the panel ------------------------------------------------------------------------------------------------------

    def _panel(self, recording: Recording | None) -> None:
        gui, robot = self.server.gui, self.twin.robot
        gui.configure_theme(control_width="medium", dark_mode=False)
        told = f"**{robot.title}**" + (f"\n\n{recording.title}  \n*{recording.source}*" if recording else "")
        gui.add_markdown(told)
        self._bar = gui.add_html(bar(self._range))
        self.words = gui.add_markdown("")
        self._mode = gui.add_dropdown("show", (REPLAY, BY_HAND) if self._replay else (BY_HAND,), hint="a trial, or your own pulls")
        self._noted(self._mode)
        self._twin_panel()
        self._replay_panel()
        self._drive_panel()

    def _twin_panel(self) -> None:
        gui, better = self.server.gui, bool(self.twin.effects or self.twin.values)
        with gui.add_folder("twin", visible=better):
            self.which = gui.add_button_group("predicted", (DESCRIBED, BETTER), hint="before and after a diagnosis")
            self.which.value = BETTER if better else DESCRIBED
            self._noted(self.which)
            self.effects = {
                e.id: gui.add_checkbox(e.id.replace("_", " "), True, hint=f"moves with {e.moves_with}") for e in self.twin.effects
            }
            for box in self.effects.values():
                self._noted(box)

    def _replay_panel(self) -> None:
        gui, replay = self.server.gui, self._replay
        self._replaying = gui.add_folder("replay", visible=replay is not None)
        with self._replaying:
            self.trial = gui.add_dropdown("trial", tuple(replay.labels) if replay else ("none",))
            self.play = gui.add_checkbox("play", False, hint="from here on, again and again")
            self.time = gui.add_slider("time, s", 0.0, 1.0, 0.01, 0.0)
            self.speed = gui.add_slider("speed", 0.1, 20.0, 0.1, 1.0, hint="trial seconds a second")
            self.arrows = gui.add_slider("residual x", 0.0, 20.0, 1.0, 5.0, hint="length of the arrows from predicted to measured")
            lines = ({}, {"label": DESCRIBED, "stroke": "#999"}, {"label": "as shown", "stroke": "#1f77b4"}, NOW)
            self.plot = gui.add_uplot(
                (np.zeros(2),) * 4, tuple(viser.uplot.Series(**line) for line in lines),  # type: ignore[typeddict-item]
                title="marker error, mm, over time, s", scales={"x": viser.uplot.Scale(time=False)}, height=200,
            )  # fmt: skip
        for handle in (self.trial, self.time, self.arrows):
            self._noted(handle)

    def _drive_panel(self) -> None:
        gui, robot = self.server.gui, self.twin.robot
        self._driving = gui.add_folder("by hand", visible=self._replay is None)
        full, ports = full_pull(self.twin), self.twin.robot.build().drives
        ways = [d for d in (Drive.TENSION, Drive.DISPLACEMENT) if all(any(p.drive is d for p in port) for port in ports)]
        most = {Drive.TENSION: round(MOST * full.tension, 1), Drive.DISPLACEMENT: round(MOST * 1e3 * full.displacement, 1)}
        # One motor can take up only what others let out.
        least = {Drive.TENSION: 0.0, Drive.DISPLACEMENT: -most[Drive.DISPLACEMENT]}
        with self._driving:
            self.by = gui.add_dropdown("pull by", tuple(BY[d][0] for d in ways), visible=len(ways) > 1, hint="what motors hold")
            self.sliders = {
                d: [
                    gui.add_slider(f"tendon {i}, {BY[d][1]}", least[d], most[d], 0.01, 0.0, hint=BY[d][2], visible=d is ways[0])
                    for i in range(1, robot.n_tendon + 1)
                ]
                for d in ways
            }
            self.payload = gui.add_slider("payload, g", 0.0, 30.0, 1.0, 0.0, hint="at the tip", visible=not len(self._figure.faces))
            self.tilt = gui.add_slider("gravity tilt, deg", 0, 180, 5, 0, hint="of its direction from that described")
            self.azimuth = gui.add_slider("gravity azimuth, deg", 0, 355, 5, 0, hint="about the robot's axis")
            self.push = gui.add_slider("push at the tip, N", 0.0, MOST_PUSH, 0.005, 0.0, hint="sideways, of a fixed direction")
            self.aside = gui.add_slider("push azimuth, deg", 0, 355, 5, 0, hint="its direction about the robot's axis")
            self.slack = gui.add_button("let go", hint="all tendons slack, friction's history forgotten")
        for handle in (
            *(s for of in self.sliders.values() for s in of),
            self.payload,
            self.tilt,
            self.azimuth,
            self.push,
            self.aside,
        ):
            self._noted(handle)
        self.by.on_update(lambda _: self._let_go())
        self.slack.on_click(lambda _: self._let_go())

    def _noted(self, handle: Any) -> None:
        def note(event: viser.GuiEvent) -> None:
            # What the loop itself moved needs no second picture.
            if event.client is not None:
                self._wanted = True

        (handle.on_click if isinstance(handle, viser.GuiButtonGroupHandle) else handle.on_update)(note)

    @property
    def drive(self) -> Drive:
        """What the sliders are."""
        return next(d for d, (name, *_) in BY.items() if name == self.by.value)

    @property
    def pulls(self) -> list[viser.GuiSliderHandle]:
        """The sliders in use."""
        return self.sliders[self.drive]

    def _let_go(self) -> None:
        for drive, sliders in self.sliders.items():
            for slider in sliders:
                slider.value, slider.visible = 0.0, drive is self.drive
        self._live, self._wanted = None, True

    # ---- the loop -------------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Serve until interrupted."""
        while True:
            started = time.monotonic()
            self.tick()
            time.sleep(max(0.001, 1.0 / RATE - (time.monotonic() - started)))

    def tick(self) -> None:
        """Draw what is wanted by now."""
        now = time.monotonic()
        passed, self._clock = now - self._clock, now
        replaying = self._mode.value == REPLAY
        running = replaying and self.play.value and self._track is not None
        if not (self._wanted or running):
            return
        asked, self._wanted = self._wanted, False
        try:
            if replaying:
                self._show_replay(passed if running else 0.0, asked)
            else:
                self._show_live()
        except TwinError as error:
            self.words.content = f"**{error}**"
            return
        self.drawn += 1

    def _chosen(self) -> Twin:
        if self.which.value == DESCRIBED:
            return self._described
        return replace(self.twin, effects=tuple(e for e in self.twin.effects if self.effects[e.id].value))

    def _show_replay(self, passed: float, asked: bool) -> None:
        replay = self._replay
        assert replay is not None
        k, twin = replay.labels.index(self.trial.value), self._chosen()
        if asked or self._track is None:
            self._track = replay.track(twin, k)
            self._replaying.visible, self._driving.visible = True, False
            self.time.max = max(round(float(self._track.time[-1]), 2), 0.01)
            self._coloured(self._figure.coloured(float(np.ceil(10 * self._track.frames.tension.max()) / 10)))
        track = self._track
        t = self.time.value + passed * self.speed.value
        t = t if t <= track.time[-1] else 0.0
        i = int(np.clip(np.searchsorted(track.time, t, "right") - 1, 0, len(track.time) - 1))
        j = min(i + 1, len(track.time) - 1)
        share = float(np.clip((t - track.time[i]) / max(track.time[j] - track.time[i], 1e-9), 0.0, 1.0))
        measured = replay.measured(k)
        self._scene.draw(track.frames.at(i, share), self._range)
        between = [(1.0 - share) * m[i] + share * m[j] for m in (track.markers, measured)]
        self._scene.mark(between[0], between[1], self.arrows.value)
        self._slide(t)
        now = time.monotonic()
        if asked or now - self._told > TELLING:
            self._told = now
            self._tell_replay(track, twin, k, i, asked)

    def _slide(self, t: float) -> None:
        if abs(t - self.time.value) > 1e-9:
            self.time.value = t

    def _tell_replay(self, track: Track, twin: Twin, k: int, i: int, asked: bool) -> None:
        assert self._replay is not None
        described = self._replay.track(self._described, k)
        if asked or time.monotonic() - self._plotted > PLOTTING:
            self._plotted = time.monotonic()
            present = np.where(np.arange(len(track.time)) == i, track.error, 0.0)  # a needle: the plot takes no missing numbers
            self.plot.data = (track.time, *(1e3 * np.nan_to_num(e) for e in (described.error, track.error, present)))
        named = ", ".join(e.id.replace("_", " ") for e in twin.effects) or "no effect"
        named = DESCRIBED if self.which.value == DESCRIBED else named
        now, whole, before = (1e3 * e for e in (track.error[i], track.rms, described.rms))
        self.words.content = (
            f"t = {track.time[i]:.2f} s: error **{now:.2f} mm**, over the trial **{whole:.2f} mm** ({named}); as described "
            f"{before:.2f} mm  \nblue: predicted markers, red: measured, arrows: residual"
        )

    def _show_live(self) -> None:
        self._replaying.visible, self._driving.visible = False, True
        twin = self._chosen()
        if self._live is None or self._live[0] != twin:
            self._live = twin, Live(twin, self.drive)
        self._coloured(self._figure.coloured(float(self.sliders[Drive.TENSION][0].max)))
        pull = np.array([p.value for p in self.pulls]) * BY[self.drive][3]
        shown = self._live[1].shape(pull, self._loads())
        self._scene.draw(shown, self._range)
        self._scene.mark(shown.markers[0], np.full_like(shown.markers[0], np.nan), 0.0)
        self.words.content = _standing(shown)

    def _loads(self) -> Loads:
        tilt, azimuth = np.deg2rad(self.tilt.value), np.deg2rad(self.azimuth.value)
        g = self.twin.robot.gravity
        axis = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        along = g * np.cos(tilt) + np.cross(axis, g) * np.sin(tilt) + axis * (axis @ g) * (1.0 - np.cos(tilt))  # Rodrigues
        aside = np.deg2rad(self.aside.value)
        return Loads(along, 1e-3 * self.payload.value, self.push.value * np.array([np.cos(aside), np.sin(aside), 0.0]))

    def _coloured(self, over: Range) -> None:
        if over != self._range:
            self._range, self._bar.content = over, bar(over)


def _standing(shown: Frames) -> str:
    x, y, z = 1e3 * shown.markers[0, -1]
    ends = f"; tension along the tendons {shown.tension.min():.2f} to {shown.tension.max():.2f} N"
    return f"tip at x **{x:.1f}**, y **{y:.1f}**, z **{z:.1f}** mm{ends}"


def serve(twin: Twin, recording: Recording | None, port: int, told: Callable[[str], None]) -> None:
    """Serve on 127.0.0.1, the first free port from `port` on, until interrupted; `told` the address once the picture stands."""
    server = viser.ViserServer(host="127.0.0.1", port=port, label=f"twin view {twin.robot.name}", verbose=False)
    try:
        app = App(server, twin, recording)
        app.tick()
        told(f"http://127.0.0.1:{server.get_port()}")
        app.run()
    finally:
        server.stop()
