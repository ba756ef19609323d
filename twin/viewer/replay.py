"""The trials of a measurement set and a twin's predictions of them."""

from dataclasses import dataclass

import numpy as np

from twin.body import Drive
from twin.body.drawable import Frames
from twin.foundation.errors import DataError
from twin.measurements import Recording
from twin.prediction.prepared import prepare
from twin.prediction.simulate import is_dynamic, simulate
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class PredictedTrial:
    """One predicted trial.

    `time` (n,) s; `frames` to draw; `markers` (n, m, 3) m as reported, only those also measured; `error` (n,) m of each instant and
    `rms` (m) of the trial, root-mean-square over the markers.
    """

    time: np.ndarray
    frames: Frames
    markers: np.ndarray
    error: np.ndarray
    rms: float


MOST_PREDICTIONS = 16  # kept, of some megabytes each


class Replay:
    """The trials of a set. Predictions are made on demand; the last `MOST_PREDICTIONS` are kept."""

    def __init__(self, recording: Recording, twin: Twin) -> None:
        """Raise DataError for a set without markers, or one that does not drive the robot."""
        self._prepared = prepared = prepare(recording, twin.robot)
        self._dynamic = is_dynamic(prepared)
        self._columns = {
            m: [j for j, o in enumerate(prepared.outputs) if o.group == "marker" and o.index == m]
            for m in sorted({o.index for o in prepared.outputs if o.group == "marker"})
        }
        self._columns = {m: columns for m, columns in self._columns.items() if len(columns) == 3}
        if not self._columns:
            raise DataError("the set has no marker with x, y and z to show beside the robot")
        self.labels = [name.removesuffix(".csv") for name in (i.name for i in prepared.inputs)]
        self._predictions: dict[tuple[Twin, int], PredictedTrial] = {}

    def measured(self, trial: int) -> np.ndarray:
        """Return the measured markers, (n, m, 3) m, NaN where missing."""
        return np.stack([self._prepared.measured[trial][:, columns] for columns in self._columns.values()], axis=1)

    def strongest_pull(self, trial: int) -> tuple[str, np.ndarray]:
        """Return a label of the most moved tendon's pull, and the pull (n,) in the unit of the label."""
        command, drives = self._prepared.inputs[trial].command, self._prepared.drives
        t = int(np.argmax(np.ptp(command, axis=0) / self._prepared.reading))
        unit, factor = drives[t].display_unit
        return f"{drives[t]} of tendon {t + 1}, {unit}", factor * command[:, t]

    def predict(self, twin: Twin, trial: int) -> PredictedTrial:
        """Predict a trial. Raises SolveError where there is no solution."""
        if (twin, trial) not in self._predictions:
            inputs = self._prepared.inputs[trial]
            trace = simulate(twin, self._prepared, trials=[trial], dynamic=self._dynamic)[0]
            assert trace.solution is not None
            heating = twin.heating(inputs.temperature) if Drive.CURRENT in inputs.drives else None
            frames = twin.figure().frames(
                trace.solution, twin.effect_chain.surround(inputs.loads), twin.effect_chain.route, heating
            )
            markers = twin.effect_chain.sense(trace.true).markers[:, list(self._columns)]
            away = np.linalg.norm(self.measured(trial) - markers, axis=2)
            with np.errstate(invalid="ignore"):
                counted = np.isfinite(away).sum(axis=1)
                error = np.sqrt(np.nansum(away**2, axis=1) / np.where(counted, counted, np.nan))
            rms = float(np.sqrt(np.nanmean(away**2)))
            self._predictions[twin, trial] = PredictedTrial(inputs.time - inputs.time[0], frames, markers, error, rms)
        self._predictions[twin, trial] = track = self._predictions.pop((twin, trial))  # the last used is the last entry
        while len(self._predictions) > MOST_PREDICTIONS:
            del self._predictions[next(iter(self._predictions))]
        return track
