"""What prediction needs of a recording, taken out once: driving inputs, loads and clocks per trial, measured outputs as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from twin.effects import Loads
from twin.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.robots import Body, Jaw, Robot

ROOM = 296.15  # K, where nothing else is said: the temperature stiffness is quoted at
# What a reading that drives a tendon is typically good for: N, m, A, V
READING = {"tendon_tension": 0.01, "tendon_displacement": 2e-5, "sma_current": 3e-3, "sma_voltage": 1.5e-3}
HEATING = ("sma_current", "sma_voltage")  # what drives a tendon through an SMA spring
SCALARS = {  # kind of an output channel -> group
    "tendon_tension": "tension", "tendon_displacement": "displacement", "sma_temperature": "temperature",
    "sma_resistance": "resistance", "joint_angle": "angle", "joint_torque": "torque",
}  # fmt: skip
DRUM, LOAD = "joint_1_angle", "joint_2_torque"  # what drives a transmission, and what may load it


@dataclass(frozen=True)
class Inputs:
    """One trial as the twin is driven: time and clock (n,) s, reported command (n, n_tendon) in N or, for tendons
    `by_length` (n_tendon,), displacement in m, or for those `by_current` the current of their SMA spring in A, constant from one
    time to the next; temperature (n,) K of the room, its loads."""

    name: str
    time: np.ndarray
    clock: np.ndarray
    command: np.ndarray
    by_length: np.ndarray
    temperature: np.ndarray
    loads: Loads
    by_current: np.ndarray = field(default_factory=lambda: np.zeros(1, bool))


@dataclass(frozen=True)
class Output:
    """One output channel the robot can predict: where it stands in a trial's signals."""

    channel: Channel
    group: str  # "marker" or a value of SCALARS
    index: int  # marker, tendon or joint, from 0
    axis: int  # 0, 1, 2 for x, y, z; 0 for a scalar


@dataclass(frozen=True)
class Bench:
    """A recording prepared for a robot. `measured[k]` is (n_k, n_output), NaN where missing; trials are in order of their clock."""

    recording: Recording
    robot: Robot
    inputs: tuple[Inputs, ...]
    outputs: tuple[Output, ...]
    measured: tuple[np.ndarray, ...]
    notices: tuple[str, ...]

    @property
    def n_tendon(self) -> int:
        return int(self.robot.structure["tendons"])  # type: ignore[call-overload]

    @property
    def by_length(self) -> np.ndarray:
        """(n_tendon,) whether a tendon is driven by its displacement."""
        return self.inputs[0].by_length

    @property
    def by_current(self) -> np.ndarray:
        """(n_tendon,) whether a tendon is pulled by an SMA spring that a current heats."""
        return np.broadcast_to(self.inputs[0].by_current, self.by_length.shape)

    @property
    def reading(self) -> np.ndarray:
        """(n_tendon,) what one reading of the driving channels is typically good for, N, m or A."""
        held = np.where(self.by_length, READING["tendon_displacement"], READING["tendon_tension"])
        return np.where(self.by_current, READING["sma_current"], held)

    @property
    def n_sample(self) -> int:
        return sum(len(i.time) for i in self.inputs)


def prepare(recording: Recording, robot: Robot) -> Bench:
    """The bench of a recording. Raises DataError where the inputs do not determine the robot, or no output is predictable."""
    notices = list(recording.notices)
    n_tendon, body = int(robot.structure["tendons"]), robot.build()  # type: ignore[call-overload]
    driven = _drives(recording, robot, n_tendon)
    driving = {c.name for c in driven} | ({LOAD} if isinstance(body, Jaw) else set())
    notices += [
        f"input {c.name} does not drive robot {robot.name!r} and is not used" for c in recording.inputs() if c.name not in driving
    ]
    by_length = np.array([c.kind in ("tendon_displacement", "joint_angle") for c in driven])
    by_current = np.array([c.kind in HEATING for c in driven])
    effect = _amperes(robot, driven) * lead(body, n_tendon)
    outputs, unknown = _outputs(recording, body, by_current)
    if not outputs:
        raise DataError(f"{_where(recording)}: robot {robot.name!r} predicts none of the outputs ({', '.join(unknown)})")
    notices += [f"output {name} is not predicted by robot {robot.name!r} and is not compared" for name in unknown]
    clocks, note = _clocks(recording)
    notices += note
    order = np.argsort([c[0] for c in clocks], kind="stable")
    inputs, measured = [], []
    for k in order:
        trial = recording.trials[k]
        command, note = _commands(trial, [c.name for c in driven])
        notices += note
        notices += [f"{trial.name}: condition {name!r} is not one the twin understands; it is not used" for name in trial.other]
        inputs.append(
            Inputs(
                trial.name,
                trial.time,
                clocks[k],
                command * effect,
                by_length,
                _temperature(recording, trial),
                _loads(recording, trial, robot, body),
                by_current,
            )
        )
        measured.append(np.stack([trial.values[o.channel.name] for o in outputs], axis=1))
    return Bench(recording, robot, tuple(inputs), outputs, tuple(measured), tuple(notices))


def lead(body: Body, n_tendon: int) -> np.ndarray:
    """(n_tendon,) what one unit of the driving channel is to each tendon: of a drum's angle, m/rad."""
    return np.array([body.drum, -body.drum]) if isinstance(body, Jaw) else np.ones(n_tendon)


def drives(bench: Bench) -> list[Channel]:
    """The channel that drives each tendon."""
    return _drives(bench.recording, bench.robot, bench.n_tendon)


def _where(recording: Recording) -> str:
    return str(recording.folder / "measurements.toml") if recording.folder else recording.title


def _drives(recording: Recording, robot: Robot, n_tendon: int) -> list[Channel]:
    """The channel that drives each tendon: its tension, its displacement, or current or voltage of its SMA spring. Raises DataError
    where one is missing or doubled. A drum drives both tendons of a transmission."""
    if isinstance(robot.build(), Jaw):
        found = [c for c in recording.inputs() if c.name == DRUM]
        if not found:
            raise DataError(f"{_where(recording)}: the inputs do not determine robot {robot.name!r}: give {DRUM} the role 'input'")
        return found * n_tendon
    drives = []
    for i in range(1, n_tendon + 1):
        found = [c for c in recording.inputs() if c.kind in READING and c.index == i]
        if not found:
            raise DataError(
                f"{_where(recording)}: the inputs do not determine robot {robot.name!r}: tendon {i} is not driven; give "
                f"tendon_{i}_tension, tendon_{i}_displacement or sma_{i}_current the role 'input'"
            )
        if len(found) > 1:
            raise DataError(
                f"{_where(recording)}: tendon {i} is driven twice, by {found[0].name} and {found[1].name}; make one an 'output'"
            )
        drives.append(found[0])
    return drives


def _amperes(robot: Robot, driven: list[Channel]) -> np.ndarray:
    """(n_tendon,) factor from each driving reading to what it does: volts drive currents I = U / R.

    Raises DataError for a robot without springs.
    """
    if not any(c.kind in HEATING for c in driven):
        return np.ones(len(driven))
    resistance = robot.springs(len(driven)).resistance
    return np.array([1.0 / R if c.kind == "sma_voltage" else 1.0 for c, R in zip(driven, resistance, strict=True)])


def _outputs(recording: Recording, body: Body, by_current: np.ndarray) -> tuple[tuple[Output, ...], list[str]]:
    markers = list(body.markers)
    of_joints = {"joint_1_torque", "joint_2_angle"} if isinstance(body, Jaw) else set()
    found, unknown = [], []
    for channel in recording.outputs():
        name = channel.name.rpartition("_")[0]
        if channel.axis is not None and name in markers:
            found.append(Output(channel, "marker", markers.index(name), "xyz".index(channel.axis)))
        elif channel.kind in SCALARS and channel.index is not None and channel.index <= len(by_current):
            group = SCALARS[channel.kind]
            on_spring = group in ("temperature", "resistance") and by_current[channel.index - 1]
            known = group in ("tension", "displacement") or on_spring or channel.name in of_joints
            found += [Output(channel, group, channel.index - 1, 0)] if known else []
            unknown += [] if known else [channel.name]
        else:
            unknown.append(channel.name)
    return tuple(found), unknown


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


def _commands(trial: Trial, names: list[str]) -> tuple[np.ndarray, list[str]]:
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
                return np.interp(trial.time, trial.time[known], values[known])
    return np.full(len(trial.time), float(trial.conditions.get("ambient_temperature", ROOM)))


def _loads(recording: Recording, trial: Trial, robot: Robot, body: Body) -> Loads:
    loaded = isinstance(body, Jaw) and any(c.name == LOAD for c in recording.inputs())
    gravity = trial.conditions.get("gravity", recording.gravity if recording.gravity is not None else robot.gravity)
    return Loads(
        gravity=np.asarray(gravity, float),
        payload=float(trial.conditions.get("tip_payload", 0.0)),
        force=np.asarray(trial.conditions.get("tip_force", np.zeros(3)), float),
        torque=_commands(trial, [LOAD])[0][:, 0] if loaded else np.zeros(1),
    )
