"""The controls of a replay: which trial, when, how fast; the error over time, and the loop of pulling and letting go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser
import viser.uplot

from twin.viewer.loop import Loop, svg
from twin.viewer.replay import Replay, Track

LINES = ("#999999", "#1f77b4", "#9467bd")
NOW = {"label": "now", "stroke": "#d62728"}


class Clock:
    """Which trial, when, and how fast. It goes round and round a trial."""

    def __init__(self, gui: viser.GuiApi, labels: Sequence[str], changed: Callable[[Any], None]) -> None:
        """Of trials with these `labels`."""
        self.labels = tuple(labels)
        self.trial = gui.add_dropdown("trial", self.labels or ("none",), hint="one file of the set")
        self.play = gui.add_checkbox("play", False, hint="from here on, again and again")
        self.time = gui.add_slider("time, s", 0.0, 1.0, 0.01, 0.0, hint="since the trial began")
        self.speed = gui.add_slider("speed x", 0.1, 20.0, 0.1, 1.0, hint="trial seconds in one of yours")
        for handle in (self.trial, self.time):
            changed(handle)

    @property
    def chosen(self) -> int:
        return self.labels.index(self.trial.value)

    def choose_from(self, labels: Sequence[str], first: str) -> None:
        """Other trials."""
        self.labels = tuple(labels)
        self.trial.options = self.labels
        self.trial.value = first

    def until(self, end: float) -> None:
        """A trial ends at `end` (s)."""
        self.time.max = max(round(end, 2), 0.01)

    def on(self, passed: float, end: float) -> float:
        """Where the clock is `passed` of a watcher's seconds later, s of a trial that ends at `end`."""
        t = self.time.value + passed * self.speed.value
        if t > end:  # who looks at the end stays there, though the slider's last hundredth may lie behind it
            t = 0.0 if passed > 0.0 else end
        if abs(t - self.time.value) > 1e-9:
            self.time.value = t
        return t


class Scrubber(Clock):
    """What stands in the panel's folder "replay", of trials that are predicted."""

    def __init__(self, gui: viser.GuiApi, labels: Sequence[str], lines: Sequence[str], changed: Callable[[Any], None]) -> None:
        """As `Clock`; `lines` name the errors of `plot`."""
        super().__init__(gui, labels, changed)
        self.arrows = gui.add_slider("residual x", 0.0, 20.0, 1.0, 5.0, hint="length of the arrows from predicted to measured")
        self._lines = tuple(lines)
        series = ({}, *({"label": n, "stroke": c} for n, c in zip(lines, LINES, strict=False)), NOW)
        self.plot = gui.add_uplot(
            (np.zeros(2),) * len(series), tuple(viser.uplot.Series(**line) for line in series),  # type: ignore[typeddict-item]
            title="marker error, mm, over time, s", scales={"x": viser.uplot.Scale(time=False)}, height=200,
        )  # fmt: skip
        self.loop = gui.add_html("")
        changed(self.arrows)

    def draw(self, replay: Replay, tracks: Sequence[Track], i: int) -> None:
        """The errors and loops of tracks on the same samples, of which i is the present one: a needle among the errors, as that
        plot takes no missing numbers."""
        tips = [t.markers[:, -1] for t in tracks]
        self.loop.content = svg(Loop(*replay.pull(self.chosen), replay.measured(self.chosen)[:, -1], tips), LINES, i)
        present = np.where(np.arange(len(tracks[-1].time)) == i, tracks[-1].error, 0.0)
        self.plot.data = (tracks[0].time, *(1e3 * np.nan_to_num(e) for e in (*(t.error for t in tracks), present)))


def between(time: np.ndarray, t: float) -> tuple[int, float]:
    """Of samples at `time` (n,) s the one before t, and the share of the way to the next."""
    i = int(np.clip(np.searchsorted(time, t, "right") - 1, 0, len(time) - 1))
    j = min(i + 1, len(time) - 1)
    return i, float(np.clip((t - time[i]) / max(time[j] - time[i], 1e-9), 0.0, 1.0))
