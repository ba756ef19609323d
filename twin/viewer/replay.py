"""A measurement set's trials beside what a twin makes of their inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.bench import prepare
from twin.effects import Drive
from twin.errors import DataError
from twin.figure import Frames
from twin.measurements import Recording
from twin.twin import Twin, is_dynamic, report, simulate


@dataclass(frozen=True)
class Track:
    """One trial as predicted: time (n,) s; frames; markers (n, m, 3) m as reported, those that were measured too; the error of an
    instant, (n,) m, and of the trial, root-mean-square over their markers."""

    time: np.ndarray
    frames: Frames
    markers: np.ndarray
    error: np.ndarray
    rms: float


KEPT = 16  # predictions, of some megabytes each


class Replay:
    """The trials of a set. Predictions are made when asked for, and the last ones kept."""

    def __init__(self, recording: Recording, twin: Twin) -> None:
        """Raises DataError for a set without markers, or that does not drive the robot."""
        self._bench = bench = prepare(recording, twin.robot)
        self._dynamic = is_dynamic(bench)
        self._columns = {
            m: [j for j, o in enumerate(bench.outputs) if o.group == "marker" and o.index == m]
            for m in sorted({o.index for o in bench.outputs if o.group == "marker"})
        }
        self._columns = {m: columns for m, columns in self._columns.items() if len(columns) == 3}
        if not self._columns:
            raise DataError("the set has no marker with x, y and z to show beside the robot")
        self.labels = [name.removesuffix(".csv") for name in (i.name for i in bench.inputs)]
        self._kept: dict[tuple[Twin, int], Track] = {}

    def measured(self, trial: int) -> np.ndarray:
        """(n, m, 3) m, NaN where missing."""
        return np.stack([self._bench.measured[trial][:, columns] for columns in self._columns.values()], axis=1)

    def pull(self, trial: int) -> tuple[str, np.ndarray]:
        """What pulls the tendon that is moved furthest, in words, and how far (n,) in their unit."""
        command, drives = self._bench.inputs[trial].command, self._bench.drives
        t = int(np.argmax(np.ptp(command, axis=0) / self._bench.reading))
        unit, factor = drives[t].shown
        return f"{drives[t]} of tendon {t + 1}, {unit}", factor * command[:, t]

    def track(self, twin: Twin, trial: int) -> Track:
        """A trial as the twin predicts it. Raises SolveError where it has no answer."""
        if (twin, trial) not in self._kept:
            inputs = self._bench.inputs[trial]
            trace = simulate(twin, self._bench, trials=[trial], dynamic=self._dynamic)[0]
            assert trace.path is not None
            heating = twin.heating(inputs.temperature) if Drive.CURRENT in inputs.drives else None
            frames = twin.figure().frames(trace.path, twin.laws.surround(inputs.loads), twin.laws.route, heating)
            markers = report(twin.effects, trace.true).markers[:, list(self._columns)]
            away = np.linalg.norm(self.measured(trial) - markers, axis=2)
            with np.errstate(invalid="ignore"):
                counted = np.isfinite(away).sum(axis=1)
                error = np.sqrt(np.nansum(away**2, axis=1) / np.where(counted, counted, np.nan))
            rms = float(np.sqrt(np.nanmean(away**2)))
            self._kept[twin, trial] = Track(inputs.time - inputs.time[0], frames, markers, error, rms)
        self._kept[twin, trial] = track = self._kept.pop((twin, trial))  # the last used stands last
        while len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        return track
