"""Controls: recordings whose inputs drive a twin and whose outputs, all that its robot shows, are still empty."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from twin.body import Drive, Loads, Port, Problem
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.measurements.parsing.tables import read_table
from twin.prediction.twin import Twin
from twin.robots import Robot

PROBE_TENSION = 0.01  # N; bends the robots by less than a degree, far more than a solve's tolerance
CO_CONTRACTION = 0.1  # of the full pull, largest common pull
PAUSE_RETARDATIONS = 10.0  # retardation times of creep between rollouts, which leave e^-10 of it
# Units of the written channels.
OUTPUT_UNITS = {
    "marker": "mm", "displacement": "mm", "tension": "N", "sensor": "ohm", "angle": "deg", "temperature": "degC",
    "joint angle": "deg", "joint shift": "mm", "tendon length": "mm", "tendon tension": "N",
}  # fmt: skip
INPUT_UNITS = {Drive.TENSION: "N", Drive.DISPLACEMENT: "mm", Drive.CURRENT: "A", Drive.CONTROL: ""}  # a control's is its port's
DRAWN_DRIVES = (Drive.TENSION, Drive.DISPLACEMENT)


class FullPull(NamedTuple):
    """A full pull: tension (N), travel (m) of a motor, and each tendon's direction at the tip, unit (n_tendon, 2)."""

    tension: float
    displacement: float
    towards: np.ndarray


def full_pull(twin: Twin) -> FullPull:
    """Return the pull of one tendon that would move the tip sideways by half its height.

    The motion is extrapolated linearly from a small pull; for an arc of constant curvature that is a bend of one radian. Gravity
    and friction are neglected. Raises DataError for a robot whose tendons do not move a tip sideways.
    """
    body = twin.robot.build(twin.values)
    solver, n = twin.robot.solver(body), body.n_tendon
    if body.marker_sites:
        path = solver.solve(Problem(np.arange(n + 1.0), PROBE_TENSION * np.eye(n + 1, n, -1), Loads(np.zeros(3))))
        away, travel = path.markers[1:, :, :2] - path.markers[0, :, :2], path.path[0] - np.diagonal(path.path[1:])
        tip = np.linalg.norm(away, axis=2).argmax(axis=1)  # of the finger that a tendon bends
        away = away[np.arange(n), tip]
        moved = np.linalg.norm(away, axis=1)
        if moved.min() > 0.0:
            share = float(moved.mean() / (0.5 * np.abs(path.markers[0, tip, 2]).mean()))
            return FullPull(PROBE_TENSION / share, float(travel.mean()) / share, away / moved[:, None])
    raise DataError(f"not every tendon of robot {twin.robot.name!r} moves a tip sideways: no controls are drawn for it; give them")


def commands(twin: Twin, columns: Mapping[str, np.ndarray], rate: float) -> Recording:
    """Return one trial of commands at `rate` (Hz), to be predicted or rolled out; tendons without a column rest at zero.

    `columns` holds arrays (n,) by channel, in SI: tendon_I_tension (N), tendon_I_displacement (m), sma_I_current (A), one kind, or
    an MJCF's actuator.NAME.ctrl. Raises DataError for other channels, unequal columns, and a rate that is not above zero.
    """
    drive = _drive_of(twin.robot, columns)
    names = _input_names(twin.robot, drive)
    lengths = {len(column) for column in columns.values()}
    if not columns or set(columns) - set(names) or len(lengths) != 1:
        sizes = ", ".join(f"{name} ({len(column)} rows)" for name, column in columns.items()) or "no columns"
        raise DataError(f"{sizes} came; columns of one length are needed, of {', '.join(names)}")
    if not (np.isfinite(rate) and rate > 0.0):
        raise DataError(f"a rate of {rate:g} Hz; a number above zero is needed")
    n = lengths.pop()
    trial = Trial("commands", np.arange(n) / rate, {name: np.asarray(columns.get(name, np.zeros(n)), float) for name in names})
    return _controls_recording(twin, [trial], drive, "given commands")


def controls_from_table(twin: Twin, path: Path) -> Recording:
    """Return one rollout from a CSV or Parquet file in SI: `time` (s), and a column for each tendon's drive.

    Columns are tendon_I_tension (N), tendon_I_displacement (m) or sma_I_current (A), or an MJCF's actuator.NAME.ctrl. Raises
    DataError for a missing column, a value that is not finite, and time that does not increase.
    """
    header = path.read_text("utf-8").partition("\n")[0] if path.suffix == ".csv" and path.is_file() else ""
    drive = _drive_of(twin.robot, header.strip().split(","))
    names = _input_names(twin.robot, drive)
    table = read_table(path, ["time", *names])
    for name, column in table.columns.items():
        if not np.isfinite(column).all():
            bad = int(np.flatnonzero(~np.isfinite(column))[0])
            raise DataError(f"{table.cell(bad, name)}: a rollout needs a finite number there")
    trial = Trial(path.stem, table.columns["time"], {name: table.columns[name] for name in names})
    return _controls_recording(twin, [trial], drive, f"rollout under {path.name}")


def controls_from_set(twin: Twin, recording: Recording) -> Recording:
    """Return a measurement set's inputs and conditions, a rollout a trial. Raises DataError where they do not drive the robot."""
    present = {c.name for c in recording.channels}
    column = {c.means: c.name for c in recording.inputs()}
    able = {d: [p.channel for p in ports] for d in INPUT_UNITS if (ports := _ports(twin.robot, d))}
    fitting = [d for d, names in able.items() if set(names) <= set(column)]
    if not fitting:
        wanted = " or ".join(", ".join(names) for names in able.values()) or "an input that can be rolled out"
        raise DataError(f"the set's inputs, {', '.join(column)}, do not drive robot {twin.robot.name!r}: {wanted} are needed")
    names = able[fitting[0]]
    kept = [c.name for c in recording.contexts() if c.kind == "ambient_temperature" and c.name in present]
    trials = [replace(t, values={n: t.values[column.get(n, n)] for n in (*names, *kept)}, clouds=None) for t in recording.trials]
    made = _controls_recording(
        twin, trials, fitting[0], f"rollout under {recording.title}", [c for c in recording.channels if c.name in kept]
    )
    return replace(made, gravity=recording.gravity)


@dataclass(frozen=True)
class Drawing:
    """How controls are drawn: from slack, eased moves of 0.3 to 1.5 s from bend to bend, drawn uniformly from a disk.

    Each tendon takes the part of a bend along its own direction, up to `pull`. On the far side displacements pay out, rods push,
    and other tendons have no tension, except for a common pull of up to `CO_CONTRACTION` of the largest. Controls of an MJCF move
    from rest to values drawn uniformly from their ranges, within `pull` of where they rest.
    """

    seconds: float = 10.0
    rate: float = 50.0
    drive: Drive = Drive.TENSION
    pull: float | None = None  # N or m, or a control's unit; None for `full_pull`, or a control's whole range

    def __post_init__(self) -> None:
        if self.drive not in DRAWN_DRIVES:
            raise DataError(f"controls by {self.drive} are not drawn; allowed: {', '.join(DRAWN_DRIVES)}")
        for name, value in (("seconds", self.seconds), ("rate", self.rate), ("pull", 1.0 if self.pull is None else self.pull)):
            if not (np.isfinite(value) and value > 0.0):
                raise DataError(f"{name} = {value:g}; a number above zero is needed")


def draw_controls(twin: Twin, n: int, seed: int = 0, drawing: Drawing | None = None) -> Recording:
    """Draw controls for n rollouts; rollout k depends on the seed and k only. Raises DataError for controls without a range."""
    drawing = drawing or Drawing()
    if n < 1:
        raise DataError(f"{n} rollouts asked for; at least one is needed")
    if ports := _ports(twin.robot, Drive.CONTROL):
        return _drawn_in_ranges(twin, n, seed, drawing, ports)
    by_length, pull, body = drawing.drive is Drive.DISPLACEMENT, full_pull(twin), twin.robot.build()
    full = drawing.pull or (pull.displacement if by_length else pull.tension)
    time = np.arange(round(drawing.seconds * drawing.rate) + 1) / drawing.rate
    names = _input_names(twin.robot, drawing.drive)
    trials = []
    for k in range(n):
        rng = np.random.default_rng([seed, k])
        knots = _knots(rng, time)
        radius, angle = np.sqrt(rng.uniform(size=len(knots))), rng.uniform(0.0, 2.0 * np.pi, len(knots))
        pulls = full * (radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])) @ pull.towards.T
        if not by_length:
            pulls = body.bending(pulls) + (not body.pushes) * full * CO_CONTRACTION * rng.uniform(size=(len(knots), 1))
        pulls[0] = 0.0
        trials.append(Trial(f"rollout_{k + 1}", time, dict(zip(names, _eased(time, knots, pulls), strict=True))))
    return _controls_recording(twin, trials, drawing.drive, f"{n} drawn rollouts, seed {seed}")


def _drawn_in_ranges(twin: Twin, n: int, seed: int, drawing: Drawing, ports: list[Port]) -> Recording:
    """Draw controls of an MJCF's actuators."""
    low, rest, high = np.array([p.span for p in ports], float).T
    if drawing.pull is not None:
        low, high = np.maximum(low, rest - drawing.pull), np.minimum(high, rest + drawing.pull)
    if not np.isfinite(high - low).all():
        lost = ports[int(np.flatnonzero(~np.isfinite(high - low))[0])].channel
        raise DataError(f"{lost} has no range to draw from; give the actuator a ctrlrange in the model, --pull, or --controls")
    time, trials = np.arange(round(drawing.seconds * drawing.rate) + 1) / drawing.rate, []
    for k in range(n):
        rng = np.random.default_rng([seed, k])
        knots = _knots(rng, time)
        values = rng.uniform(low, high, (len(knots), len(ports)))
        values[0] = rest
        columns = zip((p.channel for p in ports), _eased(time, knots, values), strict=True)
        trials.append(Trial(f"rollout_{k + 1}", time, dict(columns)))
    return _controls_recording(twin, trials, Drive.CONTROL, f"{n} drawn rollouts, seed {seed}")


def _knots(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    """Return the times (s) between which moves are made."""
    return np.append(0.0, np.cumsum(rng.uniform(0.3, 1.5, int(time[-1] / 0.3) + 2)))


def _eased(time: np.ndarray, knots: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return (n_tendon, n) moves from value to value (n_knot, n_tendon) that begin and end without speed."""
    at, way = np.divmod(np.interp(time, knots, np.arange(len(knots))), 1.0)
    return np.stack([np.interp(at + way**2 * (3 - 2 * way), np.arange(len(knots)), v) for v in values.T])


def _ports(robot: Robot, drive: Drive) -> list[Port]:
    """Return the port of each tendon that has this drive; none where a tendon has none."""
    ports = [next((p for p in ports if p.drive is drive), None) for ports in robot.build().ports]
    return [] if None in ports else [p for p in ports if p is not None]


def _drive_of(robot: Robot, columns: Iterable[str]) -> Drive:
    """Return the drive that the names of columns mean."""
    columns = set(columns)
    return next((d for d in INPUT_UNITS if any(p.channel in columns for p in _ports(robot, d))), _usual_drive(robot))


def _usual_drive(robot: Robot) -> Drive:
    return Drive.CONTROL if _ports(robot, Drive.CONTROL) else Drive.TENSION


def _input_names(robot: Robot, drive: Drive) -> list[str]:
    ports = _ports(robot, drive)
    if not ports:
        raise DataError(f"robot {robot.name!r} is not driven by {drive}s of its tendons: rollouts are not made for it")
    return [p.channel for p in ports]


def _output_channels(robot: Robot, inputs: Mapping[str, object] | list[str], drive: Drive) -> list[Channel]:
    """Return all outputs that a robot shows, without those that drive it and without a tip that repeats its last marker."""
    body = robot.build()
    twice = bool(body.marker_sites) and body.marker_sites[-1] in body.marker_sites[:-1]
    return [
        Channel(name, "output", OUTPUT_UNITS.get(sense.group, "N"))
        for name, sense in body.senses.items()
        if sense.required_drive in (None, drive)
        and sense.group in OUTPUT_UNITS
        and name not in inputs
        and not (twice and name.startswith("tip_"))
    ]


def _controls_recording(twin: Twin, trials: list[Trial], drive: Drive, title: str, more: list[Channel] | None = None) -> Recording:
    names = _input_names(twin.robot, drive)
    outputs = _output_channels(twin.robot, names, drive)
    inputs = [Channel(p.channel, "input", INPUT_UNITS[drive] or p.unit) for p in _ports(twin.robot, drive)]
    channels = (*inputs, *(more or []), *outputs)
    pause = PAUSE_RETARDATIONS * max(twin.effect_chain.creep.time, default=0.1)
    starts = np.cumsum([0.0, *(float(t.time[-1] - t.time[0]) + pause for t in trials)])
    filled = tuple(
        replace(t, values={**t.values, **{c.name: np.full(len(t.time), np.nan) for c in outputs}}, start=float(starts[k]))
        for k, t in enumerate(trials)
    )
    return Recording(twin.robot.name, title, f"controls for a twin of {twin.robot.name}", None, channels, filled)
