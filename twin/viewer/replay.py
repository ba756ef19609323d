"""The trials of a measurement set and a twin's predictions of them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from twin.body import Drive
from twin.body.drawable import Frames, Jointed
from twin.foundation.errors import DataError
from twin.measurements import Recording
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import is_dynamic, simulate
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class PredictedTrial:
    """One predicted trial.

    `time` (n,) s; `frames` to draw; `markers` (n, m, 3) m as reported, only those also measured; `compared` (n, m, k) SI, what is
    compared with what was measured, the markers where there are any; `error` (n,) SI of each instant and `rms` of the trial,
    root-mean-square over these; `measured_pose` to draw beside it, where joints were measured.
    """

    time: np.ndarray
    frames: Frames
    markers: np.ndarray
    compared: np.ndarray
    error: np.ndarray
    rms: float
    measured_pose: Frames | None = None


class Compared(NamedTuple):
    """What is compared: its name, the unit shown and its factor from SI, what the last of it is called, and the outputs' columns.

    `columns` are by element, three of a marker.
    """

    name: str
    unit: str
    factor: float
    last: str
    columns: dict[int, list[int]]


# Groups of signals that are compared, the first that was measured: name, unit, factor, name of the last.
GROUPS = {
    "marker": ("marker", "mm", 1e3, "tip along its path"), "joint angle": ("joint", "deg", 180.0 / np.pi, "last joint"),
    "joint shift": ("joint", "mm", 1e3, "last joint"), "tendon length": ("tendon", "mm", 1e3, "last tendon"),
    "actuator angle": ("drive", "deg", 180.0 / np.pi, "last drive"), "actuator length": ("drive", "mm", 1e3, "last drive"),
}  # fmt: skip
JOINTS = ("joint angle", "joint shift")
MOST_PREDICTIONS = 16  # kept, of some megabytes each


class Replay:
    """The trials of a set. Predictions are made on demand; the last `MOST_PREDICTIONS` are kept."""

    def __init__(self, recording: Recording, twin: Twin) -> None:
        """Raise DataError for a set with nothing to compare, or one that does not drive the robot."""
        self._prepared = prepared = prepare(recording, twin.robot)
        self._dynamic = is_dynamic(prepared)
        found = [Compared(*told, columns) for group, told in GROUPS.items() if (columns := _columns(prepared, group))]
        if not found:
            raise DataError("the set has no marker with x, y and z, and no joint's or tendon's position, to show beside the robot")
        self.compared = found[0]
        self._markers = list(_columns(prepared, "marker"))
        self._joints = {m: column for group in JOINTS for m, (column,) in _columns(prepared, group).items()}
        self.labels = [name.removesuffix(".csv") for name in (i.name for i in prepared.inputs)]
        self._predictions: dict[tuple[Twin, int], PredictedTrial] = {}

    def measured(self, trial: int) -> np.ndarray:
        """Return what is compared as measured, (n, m, k) SI, NaN where missing."""
        return self._of(self._prepared.measured[trial])

    def measured_markers(self, trial: int) -> np.ndarray:
        """Return the measured markers, (n, m, 3) m, NaN where missing."""
        return self.measured(trial) if self._markers else np.zeros((len(self._prepared.measured[trial]), 0, 3))

    def _of(self, outputs: np.ndarray) -> np.ndarray:
        return np.stack([outputs[:, columns] for columns in self.compared.columns.values()], axis=1)

    def strongest_pull(self, trial: int) -> tuple[str, np.ndarray]:
        """Return a label of the most moved tendon's pull, and the pull (n,) in the unit of the label."""
        command, drives = self._prepared.inputs[trial].command, self._prepared.drives
        t = int(np.argmax(np.ptp(command, axis=0) / self._prepared.reading))
        unit, factor = drives[t].display_unit
        if drives[t] is Drive.CONTROL:
            driver = self._prepared.drivers[t]
            return f"{driver.name}, {driver.si_unit}", command[:, t]
        return f"{drives[t]} of tendon {t + 1}, {unit}", factor * command[:, t]

    def predict(self, twin: Twin, trial: int) -> PredictedTrial:
        """Predict a trial. Raises SolveError where there is no solution."""
        if (twin, trial) not in self._predictions:
            inputs = self._prepared.inputs[trial]
            trace = simulate(twin, self._prepared, trials=[trial], dynamic=self._dynamic)[0]
            assert trace.solution is not None
            heating = twin.heating(inputs.temperature) if Drive.CURRENT in inputs.drives else None
            figure, chain = twin.figure(), twin.effect_chain
            frames = figure.frames(trace.solution, chain.surround(inputs.loads), chain.route, heating)
            shown = self._of(trace.outputs(twin, self._prepared))
            markers = shown if self._markers else np.zeros((len(shown), 0, 3))
            away = np.linalg.norm(self.measured(trial) - shown, axis=2)
            pose = None
            if self._joints and isinstance(figure, Jointed):
                seen = self._prepared.measured[trial]
                pose = figure.turned(trace.solution, {joint: seen[:, column] for joint, column in self._joints.items()})
            with np.errstate(invalid="ignore"):
                counted = np.isfinite(away).sum(axis=1)
                error = np.sqrt(np.nansum(away**2, axis=1) / np.where(counted, counted, np.nan))
            rms = float(np.sqrt(np.nanmean(away**2)))
            self._predictions[twin, trial] = PredictedTrial(inputs.time - inputs.time[0], frames, markers, shown, error, rms, pose)
        self._predictions[twin, trial] = track = self._predictions.pop((twin, trial))  # the last used is the last entry
        while len(self._predictions) > MOST_PREDICTIONS:
            del self._predictions[next(iter(self._predictions))]
        return track


def _columns(prepared: PreparedRecording, group: str) -> dict[int, list[int]]:
    """Return the outputs of a group by element; of markers only those with x, y and z."""
    found = {
        m: [j for j, o in enumerate(prepared.outputs) if o.group == group and o.index == m]
        for m in sorted({o.index for o in prepared.outputs if o.group == group})
    }
    return {m: columns for m, columns in found.items() if group != "marker" or len(columns) == 3}
