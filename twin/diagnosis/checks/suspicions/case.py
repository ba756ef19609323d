"""The case of every suspicion: the fitted trials, the twin as described, and the prediction of a changed file.

A suspicion is a change to the file under which the twin as described, nothing fitted, predicts the data far better. It is reported
and not applied.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from twin.body import Loads
from twin.diagnosis.thresholds import (
    LEAST_MOTION_SHARE,
    LEFT_BY_FILE_CHANGE,
    SAMPLES_TO_TRY_COMMANDS,
    TRIALS_TO_TRY_COMMANDS,
    UNMISSABLE_MOTION,
)
from twin.foundation.errors import TwinError
from twin.measurements import Channel
from twin.measurements.channels import pattern_of
from twin.prediction.evaluate import OUTPUT_GROUPS, headline_group
from twin.prediction.prepared import Inputs, PreparedRecording
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class Suspicion:
    """A possible mistake in a file, in the file's units, and the change that would remove it.

    `left`: the share of the error that the change would leave, 0 where the file alone shows the mistake. `group`: the group of
    outputs that shows it.
    """

    kind: str
    words: str
    change: str
    left: float = 0.0
    group: str = ""


@dataclass(frozen=True)
class Case:
    """A recording without held-out measurements, the twin as described and its prediction (n_k, n_output).

    `predicted` is None where there is no equilibrium.
    """

    prepared: PreparedRecording
    twin: Twin
    predicted: Sequence[np.ndarray] | None

    @property
    def trials(self) -> list[int]:
        """Trials with something measured."""
        return [k for k, y in enumerate(self.prepared.measured) if np.isfinite(y).any()]

    @property
    def group(self) -> str:
        """The headline group of outputs."""
        return headline_group(o.group for o in self.prepared.outputs)

    @property
    def unregistered(self) -> bool:
        """Whether the markers' frame is an uncertain parameter of the robot, so that no frame is a mistake."""
        return any(p.name.startswith("frame.") for p in self.twin.robot.nuisance)

    def columns(self, group: str) -> list[int]:
        return [j for j, o in enumerate(self.prepared.outputs) if o.group == group]

    def points(self) -> tuple[list[str], np.ndarray]:
        """Return the names of the markers with x, y and z, base to tip, and their columns (n_marker, 3)."""
        found: dict[int, dict[int, int]] = {}
        for j, o in enumerate(self.prepared.outputs):
            if o.group == "marker":
                found.setdefault(o.index, {})[o.axis] = j
        whole = [[axes[a] for a in range(3)] for _, axes in sorted(found.items()) if len(axes) == 3]
        names = [self.prepared.outputs[c[0]].channel.name.rpartition("_")[0] for c in whole]
        return names, np.array(whole, int).reshape(-1, 3)

    def dead(self) -> list[int]:
        """Return the columns of outputs that do not move, but for noise, where the robot as described moves."""
        if self.predicted is None:
            return []
        y, p = (np.concatenate([v[k] for k in self.trials]) for v in (self.prepared.measured, self.predicted))
        noise = np.array([o.channel.noise or OUTPUT_GROUPS[o.group].typical_noise for o in self.prepared.outputs])
        there = [np.isfinite(c) for c in y.T]
        spread, most = (np.array([np.std(c[t]) if t.any() else np.nan for c, t in zip(v.T, there, strict=True)]) for v in (y, p))
        still = np.sqrt(np.maximum(spread**2 - noise**2, 0.0)) < LEAST_MOTION_SHARE * most
        return np.flatnonzero(still & (most > UNMISSABLE_MOTION * noise)).tolist()

    def few(self) -> list[int]:
        """Return the fitted trials that pull each tendon most and that have the largest payload: enough to try a change on."""
        if not self.trials:
            return []
        pulled = np.array([np.abs(self.prepared.inputs[k].command).max(axis=0) for k in self.trials])
        heaviest = int(np.argmax([self.prepared.inputs[k].loads.payload for k in self.trials]))
        return sorted({self.trials[i] for i in (*pulled.argmax(axis=0)[:TRIALS_TO_TRY_COMMANDS].tolist(), heaviest)})

    def thinned(self) -> Case:
        """Return the case with a few samples of each trial: a mistake in a whole file shows in these too."""
        every = [max(1, -(-len(i.time) // SAMPLES_TO_TRY_COMMANDS)) for i in self.prepared.inputs]
        inputs = tuple(
            replace(i, time=i.time[::s], clock=i.clock[::s], command=i.command[::s], temperature=i.temperature[::s],
                    loads=_thinned(i.loads, s))
            for i, s in zip(self.prepared.inputs, every, strict=True)
        )  # fmt: skip
        measured = tuple(y[::s] for y, s in zip(self.prepared.measured, every, strict=True))
        predicted = None if self.predicted is None else tuple(p[::s] for p, s in zip(self.predicted, every, strict=True))
        return replace(self, prepared=replace(self.prepared, inputs=inputs, measured=measured), predicted=predicted)

    def floor(self, columns: Sequence[int]) -> float:
        """Return the RMS noise of the columns, SI: no change to a file leaves less."""
        of = [self.prepared.outputs[j] for j in columns]
        return float(np.sqrt(np.mean([(o.channel.noise or OUTPUT_GROUPS[o.group].typical_noise) ** 2 for o in of])))

    def again(self, change: Callable[[Inputs], Inputs], twin: Twin | None = None) -> dict[int, np.ndarray] | None:
        """Return the prediction of the `few` trials under changed inputs; None without an equilibrium."""
        few, twin = self.few(), twin or self.twin
        prepared = replace(self.prepared, inputs=tuple(change(i) for i in self.prepared.inputs))
        try:
            simulate(twin, beginnings(prepared), trials=few)
            traces = simulate(twin, prepared, trials=few)
            seen = [t.outputs(twin, prepared) for t in traces]
        except TwinError:
            return None
        return dict(zip(few, seen, strict=True)) if all(np.isfinite(y).all() for y in seen) else None

    def as_is(self) -> dict[int, np.ndarray] | None:
        return None if self.predicted is None else dict(enumerate(self.predicted))

    def error(self, columns: Sequence[int], predicted: dict[int, np.ndarray] | None, trials: Sequence[int] | None = None) -> float:
        """Return the RMS of measured - predicted over the columns and trials, SI; infinite where nothing is predicted."""
        if predicted is None:
            return float("inf")
        trials = self.trials if trials is None else trials
        measured = np.concatenate([self.prepared.measured[k] for k in trials])
        shown = np.concatenate([predicted[k] for k in trials])
        if self.unregistered:
            shown = self._registered(measured, shown)
        return rms((measured - shown)[:, columns])

    def motion(self, columns: Sequence[int]) -> float:
        """Return the RMS of the columns about their means over the fitted trials, SI."""
        y = np.concatenate([self.prepared.measured[k] for k in self.trials])[:, columns]
        return rms(y - np.nanmean(y, axis=0))

    def better(self, before: float, after: float, columns: Sequence[int]) -> float | None:
        """Return the share of an error that a change leaves, if the change removes most of it and little is left; else None."""
        if not np.isfinite(after) or after >= LEFT_BY_FILE_CHANGE * min(before, self.motion(columns)):
            return None
        return after / before if np.isfinite(before) else 0.5 * after / self.motion(columns)

    def _registered(self, measured: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """Return the predicted markers turned and shifted onto the measured ones."""
        _, columns = self.points()
        if not len(columns):
            return shown
        out, flat = shown.copy(), columns.ravel()
        turn, shift = registration(shown[:, flat].reshape(-1, 3), measured[:, flat].reshape(-1, 3))
        out[:, flat] = (shown[:, flat].reshape(-1, 3) @ turn.T + shift).reshape(len(shown), -1)
        return out


def beginnings(prepared: PreparedRecording) -> PreparedRecording:
    """Return the recording with the first row of each trial only, without clouds.

    Where that row has no equilibrium, neither has the trial; a row-by-row solver would take minutes to find out.
    """
    inputs = tuple(
        replace(i, time=i.time[:1], clock=i.clock[:1], command=i.command[:1], temperature=i.temperature[:1],
                loads=i.loads if len(i.loads.torque) == 1 else replace(i.loads, torque=i.loads.torque[:1]), clouds=None)
        for i in prepared.inputs
    )  # fmt: skip
    return replace(prepared, inputs=inputs, measured=tuple(y[:1] for y in prepared.measured))


def _thinned(loads: Loads, step: int) -> Loads:
    return loads if len(loads.torque) == 1 else replace(loads, torque=loads.torque[::step])


def rms(r: np.ndarray) -> float:
    """Return the root mean square of what is there; infinite where nothing is."""
    known = r[np.isfinite(r)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("inf")


def registration(points: np.ndarray, onto: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation (3, 3) and shift (3,) that bring points (n, 3) closest to `onto` (Kabsch, Acta Cryst. A32, 1976)."""
    known = np.isfinite(points).all(axis=1) & np.isfinite(onto).all(axis=1)
    if known.sum() < 3:
        return np.eye(3), np.zeros(3)
    a, b = points[known], onto[known]
    turn = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))[0].as_matrix()
    return turn, b.mean(axis=0) - turn @ a.mean(axis=0)


def called(channels: Sequence[Channel]) -> str:
    """Return the channels as a pattern: disk_*_*, tendon_*_tension."""
    patterns = dict.fromkeys(re.sub("[#@%&]|NAME", "*", pattern_of(c.kind)) for c in channels)
    return ", ".join(patterns)
