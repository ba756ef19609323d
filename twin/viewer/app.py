"""The panel of twins: by hand, or replaying the trials of a set."""

import time
from collections.abc import Sequence

import numpy as np
import viser

from twin.body import Drive
from twin.body.drawable import Frames
from twin.foundation.errors import DataError
from twin.measurements import Recording
from twin.prediction.twin import Twin
from twin.viewer.controls import LARGEST_PUSH, HandControls, finger_name
from twin.viewer.drawing.scene import place_robots
from twin.viewer.panel import Panel
from twin.viewer.replay import PredictedTrial
from twin.viewer.scrubber import Scrubber, neighbours
from twin.viewer.shown_twin import DESCRIBED, ShownTwin

TEXT_PERIOD, PLOT_PERIOD = 0.1, 1.0  # s between texts and between plots of a running replay
LEAST_TENSION = 0.1  # N, the end of a colour bar where nothing pulls
REPLAY, BY_HAND = "replay", "by hand"


class TwinPanel(Panel):
    """One twin, or two side by side, under the same sliders or replaying the trials of a set."""

    scrubber: Scrubber

    def __init__(self, server: viser.ViserServer, twins: Sequence[tuple[str, Twin]], recording: Recording | None = None) -> None:
        """Show `twins` by name; the name appears where there are two. Each is compared with its robot as described.

        Raises DataError for a robot that is not drawn, a set that does not drive it, or two robots with different tendons.
        """
        super().__init__(server)
        places = place_robots(server, twins[0][1].robot.gravity, [twin.figure() for _, twin in twins])
        names = [f"{letter}: {name}" if len(twins) > 1 else "" for letter, (name, _) in zip("AB", twins, strict=False)]
        self.shown_twins = [
            ShownTwin(server, twin, name, where, recording) for name, (_, twin), where in zip(names, twins, places, strict=True)
        ]
        self._text_written, self._plots_drawn, self._to_rest = 0.0, 0.0, False
        self._predictions: list[PredictedTrial] = []
        self._add_controls(recording)

    # ---- the panel ------------------------------------------------------------------------------------------------------

    def _add_controls(self, recording: Recording | None) -> None:
        gui, first, replay = self.server.gui, self.shown_twins[0], self.shown_twins[0].replay
        gui.configure_theme(control_width="medium", dark_mode=False)
        told = "\n\n".join(f"{f'{s.name}, ' if s.name else ''}**{s.twin.robot.title}**" for s in self.shown_twins)
        gui.add_markdown(told + (f"\n\n{recording.title}  \n*{recording.source}*" if recording else ""))
        self._add_heading(gui)
        self._mode = gui.add_dropdown("show", (REPLAY, BY_HAND) if replay else (BY_HAND,), hint="a trial of the set, or sliders")
        self._redraw_on_change(self._mode)
        self._add_colour_choice(gui, first.figure.colour_fields)
        self._add_picture_button(gui)
        for side in self.shown_twins:
            side.add_switches(gui, self._redraw_on_change)
        self._replaying = gui.add_folder("replay", visible=replay is not None)
        lines = [s.name for s in self.shown_twins] if len(self.shown_twins) > 1 else [DESCRIBED, "as shown"]
        with self._replaying:
            what = f"{replay.compared.name} error, {replay.compared.unit}" if replay else ""
            self.scrubber = Scrubber(gui, replay.labels if replay else (), lines, self._redraw_on_change, what)
            self._add_film_button(gui)
        self._driving = gui.add_folder("by hand", visible=replay is None)
        with self._driving:
            self.controls = HandControls(gui, first.twin, first.figure, self._redraw_on_change)
        self._check_same_sliders()
        self.controls.drive_choice.on_update(lambda _: self._pending.append(self._release))
        self.controls.rest_button.on_click(lambda _: self._pending.append(self._run_to_rest))
        self.controls.release_button.on_click(lambda _: self._pending.append(self._release))
        self.server.scene.on_click()(lambda event: self._pending.append(lambda: self._push_where_clicked(event)))

    def _check_same_sliders(self) -> None:
        """Raise DataError where the same sliders cannot drive the two robots."""
        one, *others = (
            tuple(tuple(sorted({p.drive for p in port})) for port in s.twin.robot.build().ports) for s in self.shown_twins
        )
        if any(other != one for other in others):
            raise DataError(
                f"the same sliders do not drive {' and '.join(s.twin.robot.name for s in self.shown_twins)}: their tendons differ; "
                "look at one after the other"
            )

    def _release(self) -> None:
        self.controls.release()
        for side in self.shown_twins:
            side.forget_history()

    def _run_to_rest(self) -> None:
        self._to_rest = True

    def _push_where_clicked(self, event: viser.SceneClickEvent) -> None:
        """Push a robot by hand where it was clicked."""
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        for side in self.shown_twins if self._mode.value == BY_HAND else ():
            hold = None if side.frames is None else side.scene.point_on_ray(side.frames, origin, direction)
            if hold is not None:
                self.controls.push_at(hold)
                return

    @property
    def _trial_end(self) -> float:
        return float(self._predictions[0].time[-1])

    def _draw_now(self) -> None:
        self._show_replay(0.0, True)

    # ---- what is drawn --------------------------------------------------------------------------------------------------

    def _draw_if_wanted(self, passed: float) -> bool:
        """Draw if wanted or running; return whether anything was drawn."""
        replaying = self._mode.value == REPLAY
        running = self.scrubber.play.value and bool(self._predictions) if replaying else self._springs_changing
        if not (self._redraw or running):
            return False
        asked, self._redraw = self._redraw, False
        if replaying:
            self._show_replay(passed if running else 0.0, asked)
        else:
            self._show_live(passed if running else 0.0)
        return True

    @property
    def _springs_changing(self) -> bool:
        """Return whether springs warm or cool as the clock runs."""
        if self.controls.drive is not Drive.CURRENT or self.controls.clock.value == 0.0:
            return False
        return any(s.heated_robot is not None and s.heated_robot.changing for s in self.shown_twins)

    def _show_replay(self, passed: float, asked: bool) -> None:
        k = self.scrubber.trial_index
        if asked or not self._predictions:
            self._predictions = [side.predict(k) for side in self.shown_twins]
            self._replaying.visible, self._driving.visible = True, False
            self.scrubber.set_end(self._trial_end)
            self._fit_colour_ranges([t.frames for t in self._predictions])
        t = self.scrubber.advance(passed, self._trial_end)
        i, share = neighbours(self._predictions[0].time, t)
        for side, track in zip(self.shown_twins, self._predictions, strict=True):
            assert side.replay is not None
            measured, shown = side.replay.measured_markers(k), track.frames.frame_at(i, share)
            j = min(i + 1, len(measured) - 1)
            predicted, seen = ((1.0 - share) * m[i] + share * m[j] for m in (track.markers, measured))
            side.scene.draw(shown, self._colour_field, self._ranges)
            side.scene.draw_markers(predicted, seen, self.scrubber.arrows.value)
            side.scene.draw_ghost(None if track.measured_pose is None else track.measured_pose.frame_at(i, share))
            side.scene.draw_push(np.zeros(3), np.zeros(3))
        now = time.monotonic()
        if asked or now - self._text_written > TEXT_PERIOD:
            self._text_written = now
            self._write_replay_text(k, i, asked)

    def _write_replay_text(self, k: int, i: int, asked: bool) -> None:
        before = [side.predict_as_described(k) for side in self.shown_twins]
        if asked or time.monotonic() - self._plots_drawn > PLOT_PERIOD:
            self._plots_drawn = time.monotonic()
            replay = self.shown_twins[0].replay
            assert replay is not None
            self.scrubber.draw_plots(replay, self._predictions if len(self.shown_twins) > 1 else [*before, *self._predictions], i)
        lines = [f"t = {self._predictions[0].time[i]:.2f} s"]
        for side, track, described in zip(self.shown_twins, self._predictions, before, strict=True):
            assert side.replay is not None
            what = side.replay.compared
            now, whole, was = (f"{what.factor * e:.2f} {what.unit}" for e in (track.error[i], track.rms, described.rms))
            kind = "" if what.name == "marker" else f"{what.name} "
            words = f"{kind}error **{now}**, over the trial **{whole}** ({side.model_label}); as described {was}"
            lines.append(_name_prefix(side) + words)
        told = ["blue: predicted markers, red: measured, arrows: residual"] if self._predictions[0].markers.size else []
        told += ["red and see-through: its joints as measured"] if self._predictions[0].measured_pose is not None else []
        self.words.content = "  \n".join([*lines, *told])

    def _show_live(self, passed: float) -> None:
        self._replaying.visible, self._driving.visible = False, True
        hand, rest, lines = self.controls, self._to_rest, []
        self._to_rest = False
        for side in self.shown_twins:
            if hand.drive is Drive.CURRENT:
                shown = side.step_heating(hand.command, hand.loads, passed * hand.clock.value, rest)
            else:
                shown = side.solve_statics(hand.drive, hand.command, hand.loads)
            self._fit_colour_ranges([shown], hand.largest_tension, hand.warmest_spring)
            side.scene.draw(shown, self._colour_field, self._ranges)
            markers = shown.markers[0] if not side.figure.solids else shown.markers[0][side.figure.tip :][:1]  # others are guides
            side.scene.draw_markers(markers, np.full_like(markers, np.nan), 0.0)
            side.scene.draw_ghost(None)
            if len(side.figure.push_points):
                side.scene.draw_push(side.figure.push_positions(shown)[hand.pushed_point()], hand.force / LARGEST_PUSH)
            lines.append(_name_prefix(side) + _describe_pose(shown, side.figure.tip, hand.fingers) + _describe_heating(side))
        self.words.content = "  \n".join(lines)

    def _fit_colour_ranges(self, frames: Sequence[Frames], tension: float | None = None, warmest: float = 0.0) -> None:
        """Set colour ranges that hold `frames`, up to the given largest tension (N) and warmest spring (K)."""
        figure, pulled = self.shown_twins[0].figure, max(float(np.abs(f.tension).max(initial=0.0)) for f in frames)
        most = tension if tension is not None and tension > pulled else max(float(np.ceil(10.0 * pulled) / 10.0), LEAST_TENSION)
        ranges = {shade: figure.colour_scale(shade, most) for shade in figure.colour_fields}
        if any(f.temperature.size for f in frames):
            ranges["temperature"] = figure.colour_scale("temperature", max(warmest, *(f.temperature.max() for f in frames)))
        self._set_ranges(ranges)


def _name_prefix(side: ShownTwin) -> str:
    return f"{side.name}: " if side.name else ""


def _describe_pose(shown: Frames, tip: int, fingers: int) -> str:
    """Describe where each finger's tip is, or the marker `tip` of one body, and the tensions."""
    told = []
    if shown.markers.size:
        ends = shown.markers[0].reshape(fingers, -1, 3)[:, -1] if fingers > 1 else shown.markers[0, [tip]]
        for k, (x, y, z) in enumerate(1e3 * ends):
            told.append(f"{finger_name(k, fingers)}tip at x **{x:z.1f}**, y **{y:z.1f}**, z **{z:z.1f}** mm")
    if shown.tension.size:
        told.append(f"tension along the tendons {shown.tension.min():.2f} to {shown.tension.max():.2f} N")
    return ("  \n" if fingers > 1 else "; ").join(told)


def _describe_heating(side: ShownTwin) -> str:
    """Describe the temperatures of the springs, if currents pull."""
    if side.heated_robot is None:
        return ""
    springs = ", ".join(f"{T - 273.15:.0f}" for T in side.heated_robot.temperature)
    how = "still warming or cooling" if side.heated_robot.changing else "at rest: the clock waits"
    return f"; springs at {springs} degC, **{side.heated_robot.time:.0f} s** after they were cold, {how}"
