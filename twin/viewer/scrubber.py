"""The controls of a replay: trial, time, speed; plots of the error over time and over the pull."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser
import viser.uplot

from twin.viewer.drawing.tip_loop import TipLoop, draw_svg
from twin.viewer.replay import PredictedTrial, Replay

LINE_COLOURS = ("#999999", "#1f77b4", "#9467bd")
PRESENT_SERIES = {"label": "now", "stroke": "#d62728"}


class Clock:
    """Trial, time and speed of a replay. At the end of a trial it starts again."""

    def __init__(self, gui: viser.GuiApi, labels: Sequence[str], changed: Callable[[Any], None]) -> None:
        """Offer trials with these `labels`."""
        self.labels = tuple(labels)
        self.trial = gui.add_dropdown("trial", self.labels or ("none",), hint="one file of the set")
        self.play = gui.add_checkbox("play", False, hint="from here on, in a loop")
        self.time = gui.add_slider("time, s", 0.0, 1.0, 0.01, 0.0, hint="since the start of the trial")
        self.speed = gui.add_slider("speed x", 0.1, 20.0, 0.1, 1.0, hint="times real time")
        for handle in (self.trial, self.time):
            changed(handle)

    @property
    def trial_index(self) -> int:
        return self.labels.index(self.trial.value)

    def set_trials(self, labels: Sequence[str], first: str) -> None:
        """Offer other trials."""
        self.labels = tuple(labels)
        self.trial.options = self.labels
        self.trial.value = first

    def set_end(self, end: float) -> None:
        """Set the end of the trial, s."""
        self.time.max = max(round(end, 2), 0.01)

    def advance(self, passed: float, end: float) -> float:
        """Advance by `passed` seconds of real time; return the time (s) in a trial that ends at `end`."""
        t = self.time.value + passed * self.speed.value
        if t > end:  # the slider's last hundredth may lie after the end
            t = 0.0 if passed > 0.0 else end
        if abs(t - self.time.value) > 1e-9:
            self.time.value = t
        return t


class Scrubber(Clock):
    """The controls in the panel's folder "replay", of predicted trials."""

    def __init__(
        self, gui: viser.GuiApi, labels: Sequence[str], lines: Sequence[str], changed: Callable[[Any], None], what: str
    ) -> None:
        """Offer trials with these `labels`; `lines` name the errors in `plot`, of `what`."""
        super().__init__(gui, labels, changed)
        self.arrows = gui.add_slider("residual x", 0.0, 20.0, 1.0, 5.0, hint="length of the arrows from predicted to measured")
        self._lines = tuple(lines)
        series = ({}, *({"label": n, "stroke": c} for n, c in zip(lines, LINE_COLOURS, strict=False)), PRESENT_SERIES)
        self.plot = gui.add_uplot(
            (np.zeros(2),) * len(series), tuple(viser.uplot.Series(**line) for line in series),  # type: ignore[typeddict-item]
            title=f"{what}, over time, s", scales={"x": viser.uplot.Scale(time=False)}, height=200,
        )  # fmt: skip
        self.loop = gui.add_html("")
        changed(self.arrows)

    def draw_plots(self, replay: Replay, tracks: Sequence[PredictedTrial], i: int) -> None:
        """Draw errors and loops of predictions on the same samples; i is the present one.

        It is marked as a spike among the errors, since that plot takes no missing numbers.
        """
        tips, what = [t.compared[:, -1] for t in tracks], replay.compared
        pull, measured = replay.strongest_pull(self.trial_index), replay.measured(self.trial_index)[:, -1]
        self.loop.content = draw_svg(TipLoop(*pull, measured, tips, what.last, what.unit, what.factor), LINE_COLOURS, i)
        present = np.where(np.arange(len(tracks[-1].time)) == i, tracks[-1].error, 0.0)
        self.plot.data = (tracks[0].time, *(what.factor * np.nan_to_num(e) for e in (*(t.error for t in tracks), present)))


def neighbours(time: np.ndarray, t: float) -> tuple[int, float]:
    """Return the sample before t among `time` (n,) s, and the fraction of the interval to the next."""
    i = int(np.clip(np.searchsorted(time, t, "right") - 1, 0, len(time) - 1))
    j = min(i + 1, len(time) - 1)
    return i, float(np.clip((t - time[i]) / max(time[j] - time[i], 1e-9), 0.0, 1.0))
