"""Robot + parameters + effects: a twin, and its prediction of a recording. The only place that steps or solves MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from twin.bench import Bench, Inputs, prepare
from twin.body import TOLERANCE, Body, Heating, Path, Problem, Solver
from twin.effects import Drive, Effect, Signals, named
from twin.errors import DataError, SolveError
from twin.figure import Figure
from twin.laws import Laws
from twin.measurements import Recording
from twin.measurements.channels import MADE
from twin.quantities import Values
from twin.robots import Robot, family, load
from twin.solvers import lent
from twin.springs.spring import Spring

READINGS = 30.0  # of a drive (`Drive.reading`): a smaller range of commands moves a robot too little to excite it


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
        return Twin(robot, {}, tuple(named(name)(values, robot.n_tendon) for name, values in robot.effects))

    @property
    def laws(self) -> Laws:
        return Laws(self.effects)

    def body(self) -> Body:
        """The robot with all that its effects change of it, not compiled yet. Raises DataError for an effect that finds nothing to
        act on."""
        body = self.robot.build(self.values)
        self.laws.edit(body, self.robot.name)
        return body

    @contextmanager
    def statics(self) -> Iterator[tuple[Body, Solver]]:
        """Its body and the solver of its equilibria, for as long as they are needed. Raises as `body`."""
        shaped = replace(self, effects=tuple(e for e in self.effects if e.acts_in("edit")))

        def made() -> tuple[Body, Solver]:
            body = shaped.body()
            return body, self.robot.solver(body)

        with lent(shaped, made) as (body, solver):
            self.laws.find(body, self.robot.name)
            yield body, solver

    def heating(self, ambient: np.ndarray) -> Heating:
        """Its SMA springs in surroundings at `ambient` (n,) K. Raises DataError where the robot describes none."""
        return Heating(ambient, self.springs())

    def springs(self) -> Spring:
        """Its SMA springs under its laws. Raises DataError where the robot describes none."""
        return self.laws.spring(self.robot.springs(self.robot.n_tendon, self.values))

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
        seen = bench.recording
        return seen.with_values([values[t.name] for t in seen.trials], f"simulation: twin of {self.robot.name}")

    def figure(self) -> Figure:
        """What is drawn of its robot. Raises DataError for a family that is not drawn."""
        draw = family(self.robot.family).figure
        if draw is None:
            raise DataError(f"robot {self.robot.name!r} is a {self.robot.family}, which is not drawn here yet; see `twin robots`")
        return draw(self.body())


def _by_channel(bench: Bench, y: np.ndarray) -> dict[str, np.ndarray]:
    return {o.channel.name: column for o, column in zip(bench.outputs, y.T, strict=True) if o.channel.kind not in MADE}


@dataclass(frozen=True)
class Trace:
    """One simulated trial: the true signals, and the static path they came from (None after a dynamic simulation)."""

    true: Signals
    path: Path | None


def is_dynamic(bench: Bench) -> bool:
    """Whether a recording is too fast for static equilibria.

    It is where its samples resolve the motion and some tension or displacement crosses its range (10 to 90 %, noise smoothed away)
    within one period of the robot's first bending mode. A ramp over n periods excites the mode to about 1/(pi n) of the static
    motion. Currents heat springs, which is slow.
    """
    if not can_step(bench) or Drive.CURRENT in bench.drives:
        return False
    period = 1.0 / bench.robot.build().first_mode()
    for trial in bench.inputs:
        dt = np.diff(trial.time)
        width = int(np.ceil(0.3 * period / np.median(dt)))
        if width < 2:
            continue
        smooth = np.apply_along_axis(lambda x: np.convolve(x, np.ones(width) / width, "valid"), 0, trial.command)  # noqa: B023
        span = np.ptp(smooth, axis=0)
        slope = np.abs(np.gradient(smooth, np.median(dt), axis=0)).max(axis=0)
        if np.any((span > READINGS * bench.reading) & (slope > 0.8 * span / period)):
            return True
    return False


def can_step(bench: Bench) -> bool:
    """Whether the robot has dynamics that take what drives it here; the rest is solved by statics alone."""
    return family(bench.robot.family).dynamics is not None and set(bench.drives) <= bench.robot.build().stepped


@dataclass(frozen=True)
class Way:
    """How trials are solved: traces by trial (with kept tangents, of a neighbouring twin) speed the solves of these up, with `once`
    to first order in the difference; `keep` keeps tangents for that."""

    near: Mapping[int, Trace] = field(default_factory=dict)
    keep: bool = False
    once: bool = False
    tolerance: float = TOLERANCE


def simulate(
    twin: Twin, bench: Bench, *, trials: Sequence[int] | None = None, way: Way | None = None, dynamic: bool = False
) -> list[Trace]:
    """The true signals of the bench's trials (all, or those listed) in order of their clock.

    Raises SolveError where a static equilibrium was not found, DataError for an effect that finds nothing to act on.
    """
    wanted = range(len(bench.inputs)) if trials is None else trials
    found = dict(simulated(twin, bench, wanted, way, dynamic))
    return [found[k] for k in wanted]


def simulated(
    twin: Twin, bench: Bench, wanted: Sequence[int], way: Way | None = None, dynamic: bool = False
) -> Iterator[tuple[int, Trace]]:  # fmt: skip
    """As `simulate`, one trial after another; with creep all before the last wanted one, since the body remembers."""
    if dynamic and set(bench.drives) <= (body := twin.body()).stepped:
        yield from _run(twin, body, twin.robot.solver(body, dynamic=True), bench, wanted, way or Way())
        return
    with twin.statics() as (body, solver):
        yield from _run(twin, body, solver, bench, wanted, way or Way())


def _run(
    twin: Twin, body: Body, solver: Solver, bench: Bench, wanted: Sequence[int], way: Way
) -> Iterator[tuple[int, Trace]]:  # fmt: skip
    creep = twin.laws.creep
    run = range(max(wanted) + 1) if creep.amplitude else wanted
    delayed = np.zeros((len(creep.amplitude), solver.n_slow))
    springs = twin.springs() if Drive.CURRENT in bench.drives else None
    rested = 0.0
    for k in run:
        inputs = bench.inputs[k]
        pause = max(0.0, float(inputs.clock[0]) - rested)
        delayed *= np.exp(-pause / np.array(creep.time))[:, None] if creep.amplitude else 1.0
        rested = float(inputs.clock[-1])
        close = way.near[k].path if k in way.near else None
        yield k, _trial(twin, body, solver, inputs, springs, delayed, close, way)


def alone(twin: Twin, inputs: Inputs) -> Trace:
    """One trial by statics, by itself: nothing came before it. Raises as `simulate`."""
    creep = twin.laws.creep
    with twin.statics() as (body, solver):
        springs = twin.springs() if Drive.CURRENT in inputs.drives else None
        return _trial(twin, body, solver, inputs, springs, np.zeros((len(creep.amplitude), solver.n_slow)), None, Way())


def _trial(
    twin: Twin, body: Body, solver: Solver, inputs: Inputs, springs: Spring | None, delayed: np.ndarray, near: Path | None, way: Way
) -> Trace:  # fmt: skip
    laws = twin.laws
    driven = laws.drive(laws.command(inputs.signals.with_(antagonists=body.antagonists)))
    heating = None if springs is None else Heating(inputs.temperature, springs)
    problem = Problem(
        inputs.time, driven.command, laws.surround(inputs.loads), laws.route, inputs.drives, laws.creep, delayed,
        laws.stiffness(inputs.temperature, inputs.clock), heating, near, way.keep, way.once, way.tolerance, inputs.seen,
    )  # fmt: skip
    path = solver.solve(problem)
    if not path.status.all():
        bad = int(np.flatnonzero(path.status == 0)[0])
        raise SolveError(f"{inputs.name}: {path.ended}" if path.ended else _unsolved(inputs.name, problem, bad), bad)
    shortening = solver.straight_path - path.path + problem.route.elongation(path.tension)
    travel = np.where(driven.by_length, driven.displacement, shortening)
    markers = body.frame.reported(path.markers)
    return Trace(driven.with_(tension=path.tension, displacement=travel, markers=markers, others=path.others), path)


def _unsolved(name: str, problem: Problem, bad: int) -> str:
    shown = [d.shown for d in problem.drives]
    pull = ", ".join(f"{factor * c:.2f} {unit}" for c, (unit, factor) in zip(problem.command[bad], shown, strict=True))
    hint = "; displacements may pull against each other" if Drive.DISPLACEMENT in problem.drives else ""
    return (
        f"{name}: no static equilibrium at sample {bad + 1} (t = {problem.time[bad]:.3g} s, tendons {pull}, payload "
        f"{problem.loads.payload * 1e3:.3g} g); check the loads' units and directions{hint}"
    )


def report(effects: tuple[Effect, ...], true: Signals) -> Signals:
    """What the sensors say of the true signals."""
    return Laws(effects).sense(true)


def readings(bench: Bench, seen: Signals) -> np.ndarray:
    """The bench's output channels of one trial's signals, (n, n_output)."""
    if any(o.group == "resistance" for o in bench.outputs):
        of_springs = np.broadcast_to(bench.robot.springs(bench.n_tendon).resistance, seen.tension.shape)
        seen = seen.with_(others={**seen.others, "resistance": of_springs})
    return np.stack([seen.group(o.group)[:, o.index, o.axis] for o in bench.outputs], axis=1)


def unstable_starts(bench: Bench, traces: Sequence[Trace]) -> list[str]:
    """Names of the trials whose loaded, untensioned robot has no stable shape near straight: their branch is a guess."""
    return [inputs.name for inputs, t in zip(bench.inputs, traces, strict=True) if t.path is not None and t.path.unstable_start]
