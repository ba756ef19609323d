"""What prediction needs of a recording, taken out once: driving inputs, loads and clocks per trial, measured outputs as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import make_smoothing_spline

from twin.body import Body, Port
from twin.effects import Drive, Drives, Loads, Signals, driven_by
from twin.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.measurements.channels import meaning
from twin.measurements.patches import PATCHES, SHARED, Patches, cut, scatter, side
from twin.measurements.recording import CONTACT
from twin.robots import Robot

LOGGED, ROOMY = 20, 100  # rows of a thermometer: of fewer a cross-validation says little; as many tell how a room warms
ROOM = 296.15  # K, where nothing else is said: the temperature stiffness is quoted at


@dataclass(frozen=True)
class Inputs:
    """One trial as the twin is driven: time and clock (n,) s, reported command (n, n_tendon), SI, of what drives each tendon
    (`drives`), a current constant from one time to the next; temperature (n,) K of the room, its loads; `seen`, patches of skin
    that clouds show, where these are compared. Between rows, of which no log tells, tensions and displacements are `smooth`."""

    name: str
    time: np.ndarray
    clock: np.ndarray
    command: np.ndarray
    drives: Drives
    temperature: np.ndarray
    loads: Loads
    seen: Patches | None = None
    smooth: bool = True

    @property
    def signals(self) -> Signals:
        """What was reported to drive the trial; markers and all else that only a prediction shows are empty."""
        n, nothing = len(self.time), np.zeros_like(self.command)
        of = {kind: np.where(driven_by(self.drives, kind), self.command, nothing) for kind in Drive}
        return Signals(
            self.time, self.clock, of[Drive.TENSION], of[Drive.DISPLACEMENT], np.zeros((n, 0, 3)), self.temperature, self.drives,
            of[Drive.CURRENT], smooth=self.smooth,
        )  # fmt: skip


@dataclass(frozen=True)
class Output:
    """One output channel the robot can predict: where it stands in a trial's signals."""

    channel: Channel
    group: str  # as in `Signals.group`
    index: int  # marker, tendon or joint, from 0
    axis: int  # 0, 1, 2 for x, y, z; 0 for a scalar


@dataclass(frozen=True)
class Bench:
    """A recording prepared for a robot. `measured[k]` is (n_k, n_output), NaN where missing; trials are in order of their clock.

    `drives` says what drives each tendon, `drivers` through which channel, and `pull` (n_tendon,) what one unit of that is to it.
    """

    recording: Recording
    robot: Robot
    inputs: tuple[Inputs, ...]
    outputs: tuple[Output, ...]
    measured: tuple[np.ndarray, ...]
    notices: tuple[str, ...]
    drivers: tuple[Channel, ...]
    pull: np.ndarray

    @property
    def n_tendon(self) -> int:
        return len(self.drives)

    @property
    def drives(self) -> Drives:
        return self.inputs[0].drives

    def driven_by(self, kind: Drive) -> np.ndarray:
        """(n_tendon,) whether a tendon is driven in this way."""
        return driven_by(self.drives, kind)

    @property
    def reading(self) -> np.ndarray:
        """(n_tendon,) what one reading of the driving channels is typically good for, N, m or A."""
        return np.array([d.reading for d in self.drives])

    @property
    def n_sample(self) -> int:
        return sum(len(i.time) for i in self.inputs)


def prepare(recording: Recording, robot: Robot) -> Bench:
    """The bench of a recording. Raises DataError where the inputs do not determine the robot, or no output is predictable."""
    recording, notices = _undisturbed(recording)
    body = robot.build()
    _check_fingers(recording, robot, body)
    driven = _drives(recording, robot, body)
    names = [channel.name for channel, _ in driven]
    notices += [
        f"input {c.name} does not drive robot {robot.name!r} and is not used"
        for c in recording.inputs()
        if c.name not in {*names, *body.loads}
    ]
    pull = np.array([port.pull for _, port in driven])  # (n_drive, n_tendon)
    through = np.argmax(np.abs(pull), axis=0)  # which of its drives pulls a tendon
    drives = tuple(driven[k][1].drive for k in through)
    if Drive.CURRENT in drives:
        robot.springs(body.n_tendon)  # described, or refused
    outputs, unknown = _outputs(recording, body, drives)
    skin, camera, note = _skin(recording, body, outputs)
    outputs, notices = (*outputs, *skin), [*notices, *note]
    if not outputs:
        raise DataError(f"{_where(recording)}: robot {robot.name!r} predicts none of the outputs ({', '.join(unknown)})")
    notices += [f"output {name} is not predicted by robot {robot.name!r} and is not compared" for name in unknown]
    clocks, note = _clocks(recording)
    notices += note
    inputs, measured = [], []
    for k in np.argsort([c[0] for c in clocks], kind="stable"):
        trial = recording.trials[k]
        readings, note = _columns(trial, names)
        notices += note
        notices += [f"{trial.name}: condition {name!r} is not one the twin understands; it is not used" for name in trial.other]
        loads = _loads(recording, trial, robot, body)
        seen = cut(trial.clouds, camera) if skin else None
        inputs.append(
            Inputs(trial.name, trial.time, clocks[k], readings @ pull, drives, _temperature(recording, trial), loads, seen)
        )  # fmt: skip
        columns = [trial.values[o.channel.name][:, None] for o in outputs if o not in skin]
        measured.append(np.hstack([*columns, seen.at(trial.time)] if seen else columns))
    drivers, each = tuple(driven[k][0] for k in through), pull[through, np.arange(body.n_tendon)]
    return Bench(recording, robot, tuple(inputs), outputs, tuple(measured), tuple(notices), drivers, each)


def _check_fingers(recording: Recording, robot: Robot, body: Body) -> None:
    """Raises DataError for a channel of a finger that a hand has not."""
    fingers = {meaning(name).finger for name in body.senses} - {None}
    stray = [c.name for c in recording.channels if fingers and c.finger not in (*fingers, None)]
    if stray:
        raise DataError(
            f"{_where(recording)}: robot {robot.name!r} has {len(fingers)} fingers, and {', '.join(stray[:3])}"
            f"{', ...' if len(stray) > 3 else ''} are of another; remove them, or name the right finger"
        )


def _undisturbed(recording: Recording) -> tuple[Recording, list[str]]:
    """The recording without trials in which something pushed the robot with a force nobody knows. Raises DataError where that is
    all of them."""
    free = tuple(t for t in recording.trials if CONTACT not in t.other)
    if not free:
        raise DataError(
            f"{_where(recording)}: every trial has the condition {CONTACT!r}; under a force nobody knows no shape can be "
            "predicted: record one without"
        )
    pushed = [t.name for t in recording.trials if CONTACT in t.other]
    notes = [f"{name}: {CONTACT}, a force nobody knows; its shape is not predicted" for name in pushed]
    return (replace(recording, trials=free) if pushed else recording), [*recording.notices, *notes]


def _where(recording: Recording) -> str:
    return str(recording.folder / "measurements.toml") if recording.folder else recording.title


def _drives(recording: Recording, robot: Robot, body: Body) -> list[tuple[Channel, Port]]:
    """The input channel that drives each of the body's drives, and the port it comes through. Raises DataError where one is missing
    or doubled."""
    inputs, drives = {c.name: c for c in recording.inputs()}, []
    for ports in body.drives:
        found = [(inputs[p.channel], p) for p in ports if p.channel in inputs]
        allowed = " or ".join(p.channel for p in ports)
        if not found:
            raise DataError(
                f"{_where(recording)}: the inputs do not determine robot {robot.name!r}: give {allowed} the role 'input'"
            )  # fmt: skip
        if len(found) > 1:
            raise DataError(
                f"{_where(recording)}: {found[0][0].name} and {found[1][0].name} drive the same tendon; make one an 'output'"
            )
        drives.append(found[0])
    return drives


def _outputs(recording: Recording, body: Body, drives: Drives) -> tuple[tuple[Output, ...], list[str]]:
    found, unknown = [], []
    for channel in recording.outputs():
        sense = body.senses.get(channel.name)
        if sense is None or (sense.only is not None and drives[sense.index] is not sense.only):
            unknown.append(channel.name)
        else:
            found.append(Output(channel, sense.group, sense.index, sense.axis))
    return tuple(found), unknown


def _skin(recording: Recording, body: Body, outputs: Sequence[Output]) -> tuple[tuple[Output, ...], np.ndarray, list[str]]:
    """Patches of skin as outputs, where a body has skin that clouds show and no markers are compared: beside these clouds stay what
    no fit has seen. With them the direction (3,) to the camera, and what a reader should know."""
    clouds = [t.clouds for t in recording.trials if t.clouds is not None and len(t.clouds.points)]
    if not clouds or "skin" not in body.parts or any(o.group == "marker" for o in outputs):
        return (), np.zeros(3), []
    camera, noise = side(clouds), SHARED * scatter(clouds)
    if not camera.any() or not noise > 0.0:
        why = "have too few points" if camera.any() else "do not show one side of the robot"
        return (), np.zeros(3), [f"the point clouds {why}; they are not compared"]
    named = [Channel(f"skin_{j}", "output", "mm", noise) for j in range(1, PATCHES + 1)]
    said = (
        f"no markers: the point clouds are compared, as {PATCHES} patches of skin, each taken to be known to {1e3 * noise:.2g} mm"
    )
    return tuple(Output(c, "skin", j, 0) for j, c in enumerate(named)), camera, [said]


def _clocks(recording: Recording) -> tuple[list[np.ndarray], list[str]]:
    starts = [t.start for t in recording.trials]
    if all(s is not None for s in starts):
        return [s + t.time - t.time[0] for s, t in zip(starts, recording.trials, strict=True) if s is not None], []
    clocks, now = [], 0.0
    for trial in recording.trials:
        now = trial.start if trial.start is not None else now
        clocks.append(now + trial.time - trial.time[0])
        now = float(clocks[-1][-1])
    return clocks, ["some trials have no `start`: they are taken to follow each other without a pause, which blurs drift and creep"]


def _columns(trial: Trial, names: list[str]) -> tuple[np.ndarray, list[str]]:
    """What drives the tendons; a gap is bridged linearly, because the robot was pulled there too, and said so."""
    columns, notes = [], []
    for name in names:
        values = trial.values[name]
        known = np.isfinite(values)
        if not known.any():
            raise DataError(f"{trial.name}: input {name} is empty in this trial; remove the trial or log the channel")
        if not known.all():
            notes.append(
                f"{trial.name}: {int((~known).sum())} missing values of input {name}; the twin is driven by a straight line there"
            )
            values = np.interp(trial.time, trial.time[known], values[known])
        columns.append(values)
    return np.stack(columns, axis=1), notes


def _temperature(recording: Recording, trial: Trial) -> np.ndarray:
    for channel in recording.channels:
        if channel.kind == "ambient_temperature":
            values = trial.values[channel.name]
            known = np.isfinite(values)
            if known.any():
                return np.interp(trial.time, trial.time[known], of_the_room(trial.time[known], values[known]))
    return np.full(len(trial.time), float(trial.conditions.get("ambient_temperature", ROOM)))


def of_the_room(time: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """A room's temperature (n,) K behind its thermometer's noise, which no body follows: 0.1 K from row to row are 0.06 mm at the
    tip of a robot that softens by 1 % a kelvin. The smoothing spline that generalised cross-validation picks (Craven and Wahba,
    Numer. Math. 1979) through the means of at most `ROOMY` parts, so that a door that opens stays one; of fewer than `LOGGED` rows
    the reading."""
    if len(time) < LOGGED or np.ptp(reading) == 0.0:
        return reading
    parts = np.array_split(np.stack([time, reading]), min(len(time), ROOMY), axis=1)
    at, mean = np.array([p.mean(axis=1) for p in parts]).T
    return make_smoothing_spline(at, mean)(time)


def _loads(recording: Recording, trial: Trial, robot: Robot, body: Body) -> Loads:
    measured: dict[str, Any] = {
        field: _columns(trial, [c.name])[0][:, 0]
        for c in recording.inputs()
        for name, field in body.loads.items()
        if c.name == name
    }
    gravity = trial.conditions.get("gravity", recording.gravity if recording.gravity is not None else robot.gravity)
    return Loads(
        gravity=np.asarray(gravity, float),
        payload=float(trial.conditions.get("tip_payload", 0.0)),
        force=np.asarray(trial.conditions.get("tip_force", np.zeros(3)), float),
        **measured,
    )
