"""Robot + parameters + effects: a twin, and its prediction of a recording. The only place that steps or solves MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from twin.bench import Bench, Inputs, prepare
from twin.dynamics import Dynamics
from twin.effects import Creep, Effect, Loads, Route, Signals, named
from twin.equilibrium import TOLERANCE, Antagonists, Equilibrium, Heating, Path
from twin.errors import DataError, SolveError
from twin.measurements import Recording
from twin.quantities import Values
from twin.robots import Body, Frame, Jaw, Robot, load


@dataclass(frozen=True)
class Twin:
    """What predicts: a robot, the values of its parameters that differ from nominal, and the effects in force."""

    robot: Robot
    values: Values = field(default_factory=dict)
    effects: tuple[Effect, ...] = ()

    def __hash__(self) -> int:
        return hash((self.robot.name, tuple(sorted(self.values.items())), self.effects))

    @staticmethod
    def of(robot: Robot | str) -> Twin:
        """The robot as described: nominal parameters, and the effects its `robot.toml` declares."""
        robot = load(robot) if isinstance(robot, str) else robot
        n_tendon = int(robot.structure["tendons"])  # type: ignore[call-overload]
        return Twin(robot, {}, tuple(named(name)(values, n_tendon) for name, values in robot.effects))

    def predict(self, recording: Recording, *, dynamic: bool | None = None) -> Recording:
        """The recording's outputs as the twin sees them, on its trials' samples and inputs, with `source` saying so.

        Slow recordings are predicted by static equilibria, fast ones by MuJoCo steps (`dynamic`, or by the recording's rates).
        Raises DataError where the inputs do not determine the robot, SolveError where no equilibrium exists.
        """
        bench = prepare(recording, self.robot)
        traces = simulate(self, bench, dynamic=is_dynamic(bench) if dynamic is None else dynamic)
        values = {
            inputs.name: _by_channel(bench, readings(bench, report(self.effects, trace.true)))
            for inputs, trace in zip(bench.inputs, traces, strict=True)
        }
        return recording.with_values([values[t.name] for t in recording.trials], f"simulation: twin of {self.robot.name}")


def _by_channel(bench: Bench, y: np.ndarray) -> dict[str, np.ndarray]:
    return {o.channel.name: column for o, column in zip(bench.outputs, y.T, strict=True)}


@dataclass(frozen=True)
class Trace:
    """One simulated trial: the true signals, and the static path they came from (None after a dynamic simulation)."""

    true: Signals
    path: Path | None


def is_dynamic(bench: Bench) -> bool:
    """Whether a recording is too fast for static equilibria.

    It is where its samples resolve the motion and some tension crosses its range (10 to 90 %, noise smoothed away) within one
    period of the robot's first bending mode. A ramp over n periods excites the mode to about 1/(pi n) of the static motion.
    """
    if _is_held(bench):
        return False
    period = 1.0 / first_mode(bench.robot)
    for trial in bench.inputs:
        dt = np.diff(trial.time)
        width = int(np.ceil(0.3 * period / np.median(dt)))
        if width < 2:
            continue
        smooth = np.apply_along_axis(lambda x: np.convolve(x, np.ones(width) / width, "valid"), 0, trial.command)  # noqa: B023
        span = np.ptp(smooth, axis=0)
        slope = np.abs(np.gradient(smooth, np.median(dt), axis=0)).max(axis=0)
        if np.any((span > 0.3) & (slope > 0.8 * span / period)):
            return True
    return False


def _is_held(bench: Bench) -> bool:
    """Whether motors or springs hold some tendon's length, which static solves alone do."""
    return bool(bench.by_length.any() or bench.by_current.any())


def simulate(
    twin: Twin, bench: Bench, *, trials: Sequence[int] | None = None, near: Sequence[Trace] | None = None, keep: bool = False,
    dynamic: bool = False, tolerance: float = TOLERANCE, once: bool = False,
) -> list[Trace]:  # fmt: skip
    """The true signals of the bench's trials (all, or those listed) in order of their clock.

    With creep every trial before is simulated too, since the body remembers. `near` (traces with kept tangents of a
    neighbouring twin, same trials) speeds the solves up, with `once` to first order in the difference; `keep` keeps tangents for
    that. Raises SolveError where a static equilibrium was not found, DataError for an effect that finds nothing to act on.
    """
    body = twin.robot.build(twin.values)
    for effect in twin.effects:
        if lacking := effect.needs - body.parts:
            what = " and ".join(sorted(lacking))
            raise DataError(f"effect {effect.id} acts on {what}, which robot {twin.robot.name!r} has not: remove the effect")
        effect.edit(body)
    solver = _solver(body, dynamic and not _is_held(bench))
    creep, route = _merged_creep(twin.effects), merged_route(twin.effects)
    wanted = range(len(bench.inputs)) if trials is None else trials
    run = range(max(wanted) + 1) if creep.amplitude else wanted
    delayed = np.zeros((len(creep.amplitude), solver.model.nv))
    traces, rested = {}, 0.0
    for position, k in enumerate(run):
        inputs = bench.inputs[k]
        pause = max(0.0, float(inputs.clock[0]) - rested)
        delayed *= np.exp(-pause / np.array(creep.time))[:, None] if creep.amplitude else 1.0
        rested = float(inputs.clock[-1])
        close = near[position].path if near is not None and len(near) == len(run) else None
        traces[k] = _trial(twin, solver, inputs, route, creep, delayed, close, keep, tolerance, once, body.frame)
    return [traces[k] for k in (run if keep else wanted)]


def _solver(body: Body, dynamic: bool) -> Equilibrium | Dynamics | Antagonists:
    if isinstance(body, Jaw):
        return Antagonists(body)
    return Dynamics(body) if dynamic else Equilibrium(body)


def _trial(
    twin: Twin, solver: Equilibrium | Dynamics | Antagonists, inputs: Inputs, route: Route, creep: Creep, delayed: np.ndarray,
    near: Path | None, keep: bool, tolerance: float, once: bool, frame: Frame,
) -> Trace:  # fmt: skip
    n, by_length, by_current = len(inputs.time), inputs.by_length, np.broadcast_to(inputs.by_current, inputs.by_length.shape)
    driving = Signals(
        inputs.time, inputs.clock, np.where(by_length | by_current, 0.0, inputs.command), np.where(by_length, inputs.command, 0.0),
        np.zeros((n, 0, 3)), inputs.temperature, by_length, by_current, np.where(by_current, inputs.command, 0.0),
    )  # fmt: skip
    if isinstance(solver, Antagonists):
        driving = driving.with_(angle=solver.drum(inputs.command))
    for effect in reversed(twin.effects):
        driving = effect.command(driving)
    for effect in twin.effects:
        driving = effect.drive(driving)
    loads: Loads = inputs.loads
    for effect in twin.effects:
        loads = effect.surround(loads)
    command = np.where(by_length, driving.displacement, np.where(by_current, driving.current, driving.tension))
    stiffness = np.ones(n)
    for effect in twin.effects:
        stiffness = stiffness * effect.soften(inputs.temperature, inputs.clock)
    if isinstance(solver, Equilibrium):
        heating = heating_of(twin, inputs.temperature, by_current) if by_current.any() else None
        path = solver.solve(
            inputs.time, command, loads, route, creep, delayed, near, keep, tolerance, by_length, stiffness, once, heating
        )  # fmt: skip
    else:
        path = solver.solve(inputs.time, command, loads, route, creep, delayed, stiffness=stiffness)
    if not path.status.all():
        bad = int(np.flatnonzero(path.status == 0)[0])
        pull = ", ".join(
            f"{1e3 * c:.2f} mm" if b else f"{c:.2f} {'A' if a else 'N'}"
            for c, b, a in zip(command[bad], by_length, by_current, strict=True)
        )  # fmt: skip
        hint = "; displacements may pull against each other" if by_length.any() else ""
        raise SolveError(
            f"{inputs.name}: no static equilibrium at sample {bad + 1} (t = {inputs.time[bad]:.3g} s, tendons {pull}, payload "
            f"{loads.payload * 1e3:.3g} g); check the loads' units and directions{hint}"
        )
    shortening = solver.straight_path - path.path + route.elongation(path.tension)
    travel = np.where(by_length, driving.displacement, shortening)
    true = Signals(
        inputs.time, inputs.clock, path.tension, travel, frame.reported(path.markers), inputs.temperature,
        by_length, by_current, driving.current, path.temperature,
    )  # fmt: skip
    if isinstance(solver, Antagonists):
        angle, torque = solver.joints(driving.displacement, path, loads)
        true = true.with_(angle=angle, torque=torque)
    return Trace(true, path)


def heating_of(twin: Twin, ambient: np.ndarray, by_current: np.ndarray) -> Heating:
    spring = twin.robot.springs(len(by_current), twin.values)
    for effect in twin.effects:
        spring = effect.spring(spring)
    return Heating(by_current, ambient, spring)


def _merged_creep(effects: tuple[Effect, ...]) -> Creep:
    creeps = [e.deform() for e in effects]
    return Creep(tuple(a for c in creeps for a in c.amplitude), tuple(t for c in creeps for t in c.time))


def merged_route(effects: tuple[Effect, ...]) -> Route:
    routes = [e.route() for e in effects]
    rubbing = next((r for r in routes if r.mu > 0.0), Route())
    return replace(rubbing, stretch=sum(r.stretch for r in routes), stiffening=sum(r.stiffening for r in routes))


def report(effects: tuple[Effect, ...], true: Signals) -> Signals:
    """What the sensors say of the true signals."""
    for effect in effects:
        true = effect.sense(true)
    return true


def readings(bench: Bench, seen: Signals) -> np.ndarray:
    """The bench's output channels of one trial's signals, (n, n_output)."""
    of = {
        "marker": seen.markers, "displacement": seen.displacement[..., None], "tension": seen.tension[..., None],
        "angle": seen.angle[..., None], "torque": seen.torque[..., None],
    }  # fmt: skip
    if bench.by_current.any():
        resistance = np.broadcast_to(bench.robot.springs(bench.n_tendon).resistance, seen.warmth.shape)
        of |= {"temperature": seen.warmth[..., None], "resistance": resistance[..., None]}
    return np.stack([of[o.group][:, o.index, o.axis] for o in bench.outputs], axis=1)


def unstable_starts(bench: Bench, traces: Sequence[Trace]) -> list[str]:
    """Names of the trials whose loaded, untensioned robot has no stable shape near straight: their branch is a guess."""
    return [inputs.name for inputs, t in zip(bench.inputs, traces, strict=True) if t.path is not None and t.path.unstable_start]


def first_mode(robot: Robot) -> float:
    """Frequency (Hz) of the robot's first bending mode, as a cantilever with all its mass spread: a scale for rates.

    f = 1.875^2 / (2 pi L^2) sqrt(EI / (m/L)) (Euler-Bernoulli).
    """
    body = robot.build()
    model = body.spec.compile()
    first = body.joints[0]
    stiffness = float(model.jnt_stiffness.reshape(model.nv, -1)[model.joint(first.bend_x).id, 0]) * first.length
    per_length = float(model.body_mass.sum()) / body.length
    return 1.875**2 / (2 * math.pi * body.length**2) * math.sqrt(stiffness / per_length)
