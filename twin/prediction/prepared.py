"""A recording prepared for prediction: driving inputs, loads and clocks per trial, measured outputs as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import make_smoothing_spline

from twin.body import Body, Drive, Drives, Loads, Port, Signals, Start, drive_mask
from twin.foundation.errors import DataError, short_repr
from twin.measurements import Channel, Recording, Trial
from twin.measurements.channels import parse_channel_name
from twin.measurements.conditions import PAYLOAD_AT
from twin.measurements.patches import N_PATCHES, SHARED_NOISE_SHARE, Patches, camera_direction, cut_patches, point_scatter
from twin.measurements.recording import EXTERNAL_CONTACT, START_POSE
from twin.prediction.first_pose import with_seen
from twin.prediction.orientations import Orientation, measured_columns, orientations
from twin.prediction.pushes import check_pushes
from twin.robots import Robot

FEWEST_SMOOTHED_ROWS = 20  # of a thermometer; cross-validation of fewer is unreliable
MOST_SPLINE_POINTS = 100  # enough to follow a room's temperature
CORNERS = 1e-3  # s, by which corners of a late command are rounded
CONTROL_RESOLUTION = 1e-3  # of a control's range, which stands for the resolution of what is known without noise
ORIENTED = frozenset({"turn", "angles", "imu rate", "imu force"})  # groups of signals that need orientations
ROOM_TEMPERATURE = 296.15  # K, default: the temperature at which stiffness is quoted


@dataclass(frozen=True)
class Inputs:
    """Inputs of one trial.

    Time and clock (n,) s; reported command (n, n_tendon), SI, of each tendon's drive in `drives`, a current constant from one time
    to the next; temperature (n,) K of the room; loads; `clouds`, patches of skin in point clouds, where these are compared. Between
    rows tensions and displacements are interpolated smoothly if `smooth`.
    """

    name: str
    time: np.ndarray
    clock: np.ndarray
    command: np.ndarray
    drives: Drives
    temperature: np.ndarray
    loads: Loads
    clouds: Patches | None = None
    smooth: bool = True
    start: Start = field(default_factory=Start)
    home: np.ndarray | None = None  # (n_tendon,) of controls, whose zero means nothing: where they begin
    reach: np.ndarray | None = None  # (n_tendon,) of controls: how far they go from there
    turned: bool = False  # whether orientations are compared
    damped: bool = False  # whether tensions are so fast that the body's damping shows
    swing: np.ndarray | None = None  # (n, n_output) SI, what steps add to outputs of static shapes

    @property
    def pull(self) -> np.ndarray:
        """(n, n_tendon) how much is pulled: the command; of controls their way from home, over the farthest."""
        return self.command if self.home is None or self.reach is None else (self.command - self.home) / self.reach

    @cached_property
    def signals(self) -> Signals:
        """The reported drive signals of the trial; markers and other predicted signals are empty."""
        n, nothing = len(self.time), np.zeros_like(self.command)
        of = {kind: np.where(drive_mask(self.drives, kind), self.command, nothing) for kind in Drive}
        return Signals(
            self.time, self.clock, of[Drive.TENSION], of[Drive.DISPLACEMENT], np.zeros((n, 0, 3)), self.temperature, self.drives,
            of[Drive.CURRENT], smooth=self.smooth, control=of[Drive.CONTROL],
        )  # fmt: skip

    @cached_property
    def between_rows(self) -> Signals:
        """The signals straight between rows, every `CORNERS` s."""
        return self.signals.between_rows(CORNERS)


@dataclass(frozen=True)
class Output:
    """An output channel that the robot can predict, and its position in a trial's signals."""

    channel: Channel
    group: str  # as in `Signals.group`
    index: int  # marker, tendon or joint, from 0
    axis: int  # 0, 1, 2 for x, y, z; 0 for a scalar


@dataclass(frozen=True)
class PreparedRecording:
    """A recording prepared for a robot. `measured[k]` is (n_k, n_output), NaN where missing; trials are in order of their clock.

    `drives` is the kind of drive of each tendon, `drivers` its channel, and `pull` (n_tendon,) the tendon's command per unit of
    that channel. `pushes`: whether the tendons are rods, which are never slack.
    """

    recording: Recording
    robot: Robot
    inputs: tuple[Inputs, ...]
    outputs: tuple[Output, ...]
    measured: tuple[np.ndarray, ...]
    notices: tuple[str, ...]
    drivers: tuple[Channel, ...]
    pull: np.ndarray
    orientations: tuple[Orientation, ...] = ()
    pushes: bool = False

    @property
    def n_tendon(self) -> int:
        """Number of tendons."""
        return self.robot.n_tendon

    @property
    def drives(self) -> Drives:
        """Drive of each tendon."""
        return self.inputs[0].drives

    def driven_by(self, kind: Drive) -> np.ndarray:
        """Return (n_tendon,) whether a tendon has this kind of drive."""
        return drive_mask(self.drives, kind)

    @property
    def silenced_below_zero(self) -> np.ndarray:
        """(n_tendon,) whether a tension drives a tendon that cannot push, so that readings below zero do not reach the body."""
        return self.driven_by(Drive.TENSION) & (not self.pushes)

    @property
    def reading(self) -> np.ndarray:
        """(n_tendon,) typical resolution of the driving channels, N, m or A; of a control a share of its range."""
        reach = self.inputs[0].reach
        if reach is not None:
            return CONTROL_RESOLUTION * reach
        return np.array([d.typical_noise for d in self.drives])

    @property
    def pull_resolution(self) -> np.ndarray:
        """(n_tendon,) the same of `Inputs.pull`."""
        reach = self.inputs[0].reach
        return self.reading if reach is None else self.reading / reach

    @property
    def n_sample(self) -> int:
        """Number of samples of all trials."""
        return sum(len(i.time) for i in self.inputs)


def prepare(recording: Recording, robot: Robot) -> PreparedRecording:
    """Prepare a recording for a robot.

    Raises DataError where the inputs do not determine the robot, tendons that only pull push, or no output is predictable.
    """
    recording, notices = _without_contact(recording)
    body = robot.build()
    _check_fingers(recording, robot, body)
    driven = _drives(recording, robot, body)
    names = [channel.name for channel, _ in driven]
    notices += [*check_pushes(recording, robot, body), *robot.notices]
    notices += [
        f"input {c.name} does not drive robot {robot.name!r} and is not used"
        for c in recording.inputs()
        if c.name not in names and c.means not in body.load_channels
    ]
    pull = np.array([port.tendon_gains for _, port in driven])  # (n_drive, n_tendon)
    through = np.argmax(np.abs(pull), axis=0)  # which of its drives pulls a tendon
    drives = tuple(driven[k][1].drive for k in through)
    if Drive.CURRENT in drives:
        robot.springs(body.n_tendon)  # described, or refused
    turned = orientations(recording, body)
    outputs, unknown = _outputs(recording, body, drives, turned)
    skin, camera, note = _skin(recording, body, outputs)
    turns = [Output(c, "turn", o.index, k) for o in turned for k, c in enumerate(o.turns)]
    read = outputs
    outputs, notices = (*read, *turns, *skin), [*notices, *note]
    if not outputs:
        raise DataError(f"{_source(recording)}: robot {robot.name!r} predicts none of the outputs ({', '.join(unknown)})")
    notices += [f"output {name} is not predicted by robot {robot.name!r} and is not compared" for name in unknown]
    clocks, note = _clocks(recording)
    notices += note
    inputs, measured, gaps = [], [], {}
    for k in np.argsort([c[0] for c in clocks], kind="stable"):
        trial = recording.trials[k]
        readings, bridged = _columns(trial, names)
        gaps |= {trial.name: bridged} if bridged else {}
        start, unknown_conditions = _start(trial, body)
        notices += [
            f"{trial.name}: condition {name!r} is not one the twin understands; it is not used" for name in unknown_conditions
        ]
        loads = _loads(recording, trial, robot, body)
        seen = cut_patches(trial.clouds, camera) if skin else None
        command = readings @ pull
        start = with_seen(start, trial, read, command, body)
        inputs.append(
            Inputs(
                trial.name, trial.time, clocks[k], command, drives, _temperature(recording, trial), loads, seen,
                smooth=Drive.CONTROL not in drives, start=start, turned=any(o.group in ORIENTED for o in outputs),
            )
        )  # fmt: skip
        columns = [trial.values[o.channel.name][:, None] for o in read] + measured_columns(turned, trial)
        measured.append(np.hstack([*columns, seen.at(trial.time)] if seen else columns))
    inputs = _from_home(inputs) if set(drives) == {Drive.CONTROL} else inputs
    notices += _bridged(gaps)
    if any(_outrun_damping(i, body) for i in inputs):
        inputs = [replace(i, damped=True) for i in inputs]
    drivers, each = tuple(driven[k][0] for k in through), pull[through, np.arange(body.n_tendon)]
    known = (recording, robot, tuple(inputs), outputs, tuple(measured), tuple(notices))
    return PreparedRecording(*known, drivers, each, turned, body.pushes)


def _from_home(inputs: Sequence[Inputs]) -> list[Inputs]:
    """Return the inputs of controls with where these begin and how far they go from there."""
    home = np.median([i.command[0] for i in inputs], axis=0)
    reach = np.max([np.abs(i.command - home).max(axis=0) for i in inputs], axis=0)
    reach = np.where(reach > 0.0, reach, np.maximum(np.abs(home), 1.0))
    return [replace(i, home=home, reach=reach) for i in inputs]


def _outrun_damping(inputs: Inputs, body: Body) -> bool:
    """Return whether a tension changes within the body's damping time by more than a reading resolves: the shape is late then."""
    of = drive_mask(inputs.drives, Drive.TENSION)
    if not of.any() or len(inputs.time) < 2:
        return False
    rates = np.abs(np.diff(inputs.command[:, of], axis=0)) / np.diff(inputs.time)[:, None]
    return bool(body.damping_time * rates.max() > Drive.TENSION.typical_noise)


def _check_fingers(recording: Recording, robot: Robot, body: Body) -> None:
    """Raise DataError for a channel of a finger that the robot does not have."""
    fingers = {parse_channel_name(name).finger for name in body.senses} - {None}
    stray = [c.name for c in recording.channels if fingers and c.finger not in (*fingers, None)]
    if stray:
        raise DataError(
            f"{_source(recording)}: robot {robot.name!r} has {len(fingers)} fingers, and {', '.join(stray[:3])}"
            f"{', ...' if len(stray) > 3 else ''} are of another; remove them, or name the right finger"
        )


def _without_contact(recording: Recording) -> tuple[Recording, list[str]]:
    """Return the recording without trials under unknown contact forces, and notices. Raises DataError where that is all of them."""
    free = tuple(t for t in recording.trials if EXTERNAL_CONTACT not in t.other)
    if not free:
        raise DataError(
            f"{_source(recording)}: every trial has the condition {EXTERNAL_CONTACT!r}; under an unknown force no shape can be "
            "predicted; record one without"
        )
    pushed = [t.name for t in recording.trials if EXTERNAL_CONTACT in t.other]
    notes = [f"{name}: {EXTERNAL_CONTACT}, an unknown force; its shape is not predicted" for name in pushed]
    return (replace(recording, trials=free) if pushed else recording), [*recording.notices, *notes]


def _source(recording: Recording) -> str:
    return str(recording.folder / "measurements.toml") if recording.folder else recording.title


def _drives(recording: Recording, robot: Robot, body: Body) -> list[tuple[Channel, Port]]:
    """Return the input channel of each of the body's drives, and its port. Raises DataError where one is missing or doubled."""
    inputs, drives = {c.means: c for c in recording.inputs()}, []
    for ports in body.ports:
        found = [(inputs[p.channel], p) for p in ports if p.channel in inputs]
        allowed = " or ".join(p.channel for p in ports)
        if not found:
            raise DataError(
                f"{_source(recording)}: the inputs do not determine robot {robot.name!r}: give {allowed} the role 'input'"
            )  # fmt: skip
        if len(found) > 1:
            raise DataError(
                f"{_source(recording)}: {found[0][0].name} and {found[1][0].name} drive the same tendon; make one an 'output'"
            )
        drives.append(found[0])
    return drives


def _outputs(
    recording: Recording, body: Body, drives: Drives, turned: Sequence[Orientation]
) -> tuple[tuple[Output, ...], list[str]]:
    """Return the outputs that are compared as they are read, and the names of those that the body does not show."""
    found, unknown, whole = [], [], {c.name for o in turned for c in o.channels}
    for channel in (c for c in recording.outputs() if c.name not in whole):
        sense = body.senses.get(channel.means)
        if sense is not None and sense.unit not in ("", channel.si_unit):
            raise DataError(f"output {channel.name} is in {channel.unit}; {channel.means} has the dimension of {sense.unit}")
        if sense is None or (sense.required_drive is not None and drives[sense.index] is not sense.required_drive):
            unknown.append(channel.name)
        else:
            found.append(Output(channel, sense.group, sense.index, sense.axis))
    return tuple(found), unknown


def _skin(recording: Recording, body: Body, outputs: Sequence[Output]) -> tuple[tuple[Output, ...], np.ndarray, list[str]]:
    """Return patches of skin as outputs, the direction (3,) to the camera, and notices.

    Patches are used where clouds show the skin and no markers are compared. Beside markers, clouds stay data that no fit uses.
    """
    clouds = [t.clouds for t in recording.trials if t.clouds is not None and len(t.clouds.points)]
    if not clouds or "skin" not in body.features or any(o.group == "marker" for o in outputs):
        return (), np.zeros(3), []
    camera, noise = camera_direction(clouds), SHARED_NOISE_SHARE * point_scatter(clouds)
    if not camera.any() or not noise > 0.0:
        why = "have too few points" if camera.any() else "do not show one side of the robot"
        return (), np.zeros(3), [f"the point clouds {why}; they are not compared"]
    named = [Channel(f"skin_{j}", "output", "mm", noise) for j in range(1, N_PATCHES + 1)]
    said = (
        f"no markers: the point clouds are compared, as {N_PATCHES} patches of skin, each taken to be known to {1e3 * noise:.2g} mm"
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
    """Return the drive columns of a trial, with gaps bridged linearly, and the names of those with gaps."""
    columns, bridged = [], []
    for name in names:
        values = trial.values[name]
        known = np.isfinite(values)
        if not known.any():
            raise DataError(f"{trial.name}: input {name} is empty in this trial; remove the trial or log the channel")
        if not known.all():
            bridged.append(name)
            values = np.interp(trial.time, trial.time[known], values[known])
        columns.append(values)
    return np.stack(columns, axis=1), bridged


def _bridged(gaps: dict[str, list[str]]) -> list[str]:
    """Return the notice of all bridged gaps; `gaps` is by trial."""
    if not gaps:
        return []
    names = ", ".join(dict.fromkeys(n for each in gaps.values() for n in each))
    where = next(iter(gaps)) if len(gaps) == 1 else f"{len(gaps)} trials"
    return [f"the twin is driven by straight lines where {names} has no value ({where})"]


def _temperature(recording: Recording, trial: Trial) -> np.ndarray:
    for channel in recording.channels:
        if channel.kind == "ambient_temperature":
            values = trial.values[channel.name]
            known = np.isfinite(values)
            if known.any():
                return np.interp(trial.time, trial.time[known], smoothed_room_temperature(trial.time[known], values[known]))
    return np.full(len(trial.time), float(trial.conditions.get("ambient_temperature", ROOM_TEMPERATURE)))


def smoothed_room_temperature(time: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Return a room's temperature (n,) K without its thermometer's noise, which no body follows.

    0.1 K from row to row would be 0.06 mm at the tip of a robot that softens by 1 % a kelvin. The smoothing spline is chosen by
    generalised cross-validation (Craven and Wahba, Numer. Math. 1979) through the means of at most `MOST_SPLINE_POINTS` parts, so
    that an opened door stays visible. Fewer than `FEWEST_SMOOTHED_ROWS` rows are returned as they are.
    """
    if len(time) < FEWEST_SMOOTHED_ROWS or np.ptp(reading) == 0.0:
        return reading
    parts = np.array_split(np.stack([time, reading]), min(len(time), MOST_SPLINE_POINTS), axis=1)
    at, mean = np.array([p.mean(axis=1) for p in parts]).T
    return make_smoothing_spline(at, mean)(time)


def _loads(recording: Recording, trial: Trial, robot: Robot, body: Body) -> Loads:
    measured: dict[str, Any] = {
        field: _columns(trial, [c.name])[0][:, 0]
        for c in recording.inputs()
        for name, field in body.load_channels.items()
        if c.means == name
    }
    gravity = trial.conditions.get("gravity", recording.gravity if recording.gravity is not None else robot.gravity)
    return Loads(
        gravity=np.asarray(gravity, float),
        payload=float(trial.conditions.get("tip_payload", 0.0)),
        force=np.asarray(trial.conditions.get("tip_force", np.zeros(3)), float),
        payloads=_payloads(trial, body),
        **measured,
    )


def _payloads(trial: Trial, body: Body) -> tuple[tuple[str, float], ...]:
    """Return the masses that hang at sites or bodies. Raises DataError for a place that the body does not have."""
    hung = {n.removeprefix(PAYLOAD_AT): float(m) for n, m in trial.conditions.items() if n.startswith(PAYLOAD_AT)}
    for name in hung:
        if name not in body.payload_places:
            there = ", ".join(sorted(body.payload_places)) or "no named places: write tip_payload"
            raise DataError(f"{trial.name}: payload at {short_repr(name)}: no such site or body; the robot has {there}")
    return tuple(sorted(hung.items()))


def _start(trial: Trial, body: Body) -> tuple[Start, list[str]]:
    """Return how a trial begins, and the names of conditions that the twin does not understand."""
    unknown = [name for name in trial.other if name != START_POSE or "start" not in body.features]
    if "start" not in body.features:
        return Start(), [*unknown, *(name for name in ("settle",) if name in trial.conditions)]
    pose = trial.other.get(START_POSE, "")
    if not isinstance(pose, str):
        raise DataError(f"{trial.name}: start_pose is {short_repr(pose)}; write the name of a keyframe")
    return Start(float(trial.conditions.get("settle", Start().settle)), pose), unknown
