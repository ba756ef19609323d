"""Simulated trials of a twin, by static equilibria or in motion. The only place that calls the robots' solvers for predictions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from twin.body import SOLVE_TOLERANCE, Body, Drive, Heating, Loads, Problem, Signals, Solution, Solver
from twin.body.drives.lag import damped
from twin.body.drives.spring import Spring
from twin.body.orientation import angles, followed, rates_and_forces, turned_by
from twin.foundation.errors import SolveError
from twin.prediction.first_pose import true_start
from twin.prediction.prepared import Inputs, PreparedRecording
from twin.robots import load_family

if TYPE_CHECKING:
    from twin.prediction.twin import Twin

LEAST_EXCITATION = 30.0  # resolutions of a drive (`Drive.reading`); a smaller range of commands does not excite a robot

MIN_ROWS = 2  # that have anything between them

UNEVEN_STEPS = 0.5  # of the mean step, by which the median step is off it where rows come in bursts


@dataclass(frozen=True)
class Trace:
    """One simulated trial: the true signals, the solution that they came from, and what steps add to the outputs of statics."""

    true: Signals
    solution: Solution | None
    swing: np.ndarray | None = None  # (n, n_output)

    def outputs(self, twin: Twin, prepared: PreparedRecording) -> np.ndarray:
        """Return the recording's output channels as the twin's sensors report them, (n, n_output)."""
        columns = output_columns(prepared, twin.effect_chain.sense(self.true))
        return columns if self.swing is None else columns + self.swing


@dataclass(frozen=True)
class SolveOptions:
    """Options of a simulation.

    `neighbours`: traces of a similar twin by trial, used as warm starts. `once`: take one Newton step from them, exact to first
    order in the difference. `keep`: keep tangents, so that these traces can serve as neighbours. `tolerance`: as
    `Problem.tolerance`.
    """

    neighbours: Mapping[int, Trace] = field(default_factory=dict)
    keep: bool = False
    once: bool = False
    tolerance: float = SOLVE_TOLERANCE


@dataclass(frozen=True)
class TrialSimulator:
    """A twin's body and solver, ready to simulate one trial after another."""

    twin: Twin
    body: Body
    solver: Solver
    options: SolveOptions = field(default_factory=SolveOptions)
    steps: bool = False  # whether the solver steps through motion

    @cached_property
    def springs(self) -> Spring:
        """The twin's SMA springs."""
        return self.twin.springs()

    def no_delayed_strain(self) -> np.ndarray:
        """Return the delayed strains of a body that has not crept, (n_element, n_delayed)."""
        return np.zeros((len(self.twin.effect_chain.creep.amplitude), self.solver.n_delayed))

    def solve(self, inputs: Inputs, delayed: np.ndarray, near: Solution | None = None) -> Trace:
        """Return the trace of one trial; `near` is a neighbour's solution. The delayed strains are advanced in place.

        Raises SolveError where a static equilibrium was not found.
        """
        chain, options = self.twin.effect_chain, self.options
        driven = chain.drive(chain.command(inputs.signals.with_changes(antagonists=self.body.antagonists)))
        felt = damped(driven, self.body.damping_time) if inputs.damped and not self.steps else driven
        heating = Heating(inputs.temperature, self.springs) if Drive.CURRENT in inputs.drives else None
        problem = Problem(
            inputs.time, felt.command, chain.surround(inputs.loads), chain.route, inputs.drives, chain.creep, delayed,
            chain.stiffness(inputs.temperature, inputs.clock), heating, near, options.keep, options.once, options.tolerance,
            inputs.clouds, true_start(inputs, chain), self._course(inputs, driven),
        )  # fmt: skip
        solution = self.solver.solve(problem)
        if not solution.status.all():
            bad = int(np.flatnonzero(solution.status == 0)[0])
            reason = solution.end_reason
            excess = driven.displacement[bad] - (self.solver.straight_path - solution.path[bad])
            raise SolveError(f"{inputs.name}: {reason}" if reason else _describe_failure(inputs.name, problem, bad, excess), bad)
        # a load cell reads the tension itself, which the shape follows
        tension = solution.tension + (self.body.borne(driven.tension) - self.body.borne(felt.tension))
        shortening = self.solver.straight_path - solution.path + problem.route.elongation(tension)
        travel = np.where(driven.driven_by_length, driven.displacement, shortening)
        markers = self.body.frame.to_marker_frame(solution.markers)
        others = {**solution.others, **(self._orientations(inputs.time, solution, problem.loads) if inputs.turned else {})}
        true = driven.with_changes(tension=tension, displacement=travel, markers=markers, others=others)
        return Trace(true, solution, None if self.steps else inputs.swing)

    def _course(self, inputs: Inputs, driven: Signals) -> tuple[np.ndarray, np.ndarray] | None:
        """Return times and commands between rows where effects change controls: late or filtered, these have other corners."""
        if driven.control is inputs.signals.control or not driven.driven_by_control.all() or len(inputs.time) < MIN_ROWS:
            return None
        finer, chain = inputs.between_rows, self.twin.effect_chain
        return finer.time, chain.drive(chain.command(finer)).control

    def _orientations(self, time: np.ndarray, solution: Solution, loads: Loads) -> dict[str, np.ndarray]:
        """Return the rotation vectors (n, n_marker, 3) rad of markers in their frame, and what IMUs read."""
        seen = len(self.body.marker_sites)
        turn = followed(self.solver.orientations(solution.q, (*self.body.marker_sites, *self.body.imu_sites)))
        rate, force = rates_and_forces(time, turn[:, seen:], loads.gravity)
        return {"turn": turned_by(turn[:, :seen], self.body.frame.turn), "imu rate": rate, "imu force": force}


def simulate(
    twin: Twin,
    prepared: PreparedRecording,
    *,
    trials: Sequence[int] | None = None,
    options: SolveOptions | None = None,
    dynamic: bool = False,
) -> list[Trace]:
    """Return the traces of the recording's trials (all, or those listed) in order of their clock.

    Raises SolveError where a static equilibrium was not found, DataError for an effect that finds nothing to act on.
    """
    wanted = range(len(prepared.inputs)) if trials is None else trials
    found = dict(iterate_traces(twin, prepared, wanted, options, dynamic))
    return [found[k] for k in wanted]


def simulate_alone(twin: Twin, inputs: Inputs) -> Trace:
    """Return the trace of one trial by statics, without any trial before it. Raises as `simulate`."""
    with twin.statics() as (body, solver):
        simulator = TrialSimulator(twin, body, solver)
        return simulator.solve(inputs, simulator.no_delayed_strain())


def iterate_traces(
    twin: Twin, prepared: PreparedRecording, wanted: Sequence[int], options: SolveOptions | None = None, dynamic: bool = False
) -> Iterator[tuple[int, Trace]]:  # fmt: skip
    """Yield trials and their traces, as `simulate`; with creep also all before the last wanted one, since creep has memory."""
    options = options or SolveOptions()
    if dynamic and set(prepared.drives) <= (body := twin.body()).dynamic_drives:
        yield from _iterate(
            TrialSimulator(twin, body, twin.robot.solver(body, dynamic=True), options, steps=True), prepared, wanted
        )
        return
    with twin.statics() as (body, solver):
        yield from _iterate(TrialSimulator(twin, body, solver, options), prepared, wanted)


def _iterate(simulator: TrialSimulator, prepared: PreparedRecording, wanted: Sequence[int]) -> Iterator[tuple[int, Trace]]:
    creep, neighbours = simulator.twin.effect_chain.creep, simulator.options.neighbours
    delayed, end = simulator.no_delayed_strain(), 0.0
    for k in range(max(wanted) + 1) if creep.amplitude else wanted:
        inputs = prepared.inputs[k]
        pause = max(0.0, float(inputs.clock[0]) - end)
        delayed *= np.exp(-pause / np.array(creep.time))[:, None] if creep.amplitude else 1.0
        end = float(inputs.clock[-1])
        yield k, simulator.solve(inputs, delayed, neighbours[k].solution if k in neighbours else None)


def _describe_failure(name: str, problem: Problem, bad: int, excess: np.ndarray) -> str:
    """Return where a trial has no equilibrium, and of held tendons which is asked for most beyond the last shape, `excess` m."""
    shown = [d.display_unit for d in problem.drives]
    pull = ", ".join(f"{factor * c:.2f} {unit}" for c, (unit, factor) in zip(problem.command[bad], shown, strict=True))
    hint = ""
    if Drive.DISPLACEMENT in problem.drives:
        most = int(np.argmax(np.where(problem.drive_mask(Drive.DISPLACEMENT), excess, -np.inf)))
        hint = (
            f"; displacements may pull against each other: tendon {most + 1} most, {1e3 * excess[most]:.2g} mm beyond the "
            "shape before; is its zero or its sign another?"
        )
    return (
        f"{name}: no static equilibrium at sample {bad + 1} (t = {problem.time[bad]:.3g} s, tendons {pull}, payload "
        f"{problem.loads.payload * 1e3:.3g} g); check the loads' units and directions{hint}"
    )


def output_columns(prepared: PreparedRecording, signals: Signals) -> np.ndarray:
    """Return the recording's output channels of one trial's signals, (n, n_output)."""
    if any(o.group == "resistance" for o in prepared.outputs):
        of_springs = np.broadcast_to(prepared.robot.springs(prepared.n_tendon).resistance, signals.tension.shape)
        signals = signals.with_changes(others={**signals.others, "resistance": of_springs})
    if any(o.group == "angles" for o in prepared.outputs):
        signals = signals.with_changes(others={**signals.others, "angles": angles(signals.others["turn"])})
    return np.stack([signals.group(o.group)[:, o.index, o.axis] for o in prepared.outputs], axis=1)


def is_dynamic(prepared: PreparedRecording) -> bool:
    """Return whether a recording is too fast for static equilibria.

    It is where its samples resolve the motion and some tension or displacement crosses its range (10 to 90 %, noise smoothed away)
    within one period of the robot's first bending mode. A ramp over n periods excites the mode to about 1/(pi n) of the static
    motion. Currents heat springs, which is slow.
    """
    if not can_step(prepared) or Drive.CURRENT in prepared.drives:
        return False
    period = 1.0 / prepared.robot.build().first_mode_frequency()
    for trial, measured in zip(prepared.inputs, prepared.measured, strict=True):
        dt, command = _even(trial, measured)
        width = int(np.ceil(0.3 * period / np.median(dt)))
        if width < 2:
            continue
        smooth = np.apply_along_axis(lambda x: np.convolve(x, np.ones(width) / width, "valid"), 0, command)  # noqa: B023
        span = np.ptp(smooth, axis=0)
        slope = np.abs(np.gradient(smooth, np.median(dt), axis=0)).max(axis=0)
        if np.any((span > LEAST_EXCITATION * prepared.reading) & (slope > 0.8 * span / period)):
            return True
    return False


def _even(trial: Inputs, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps of time (n - 1,) and the commands (n, n_tendon) of a trial; even steps where devices take turns in its rows.

    A few milliseconds between the row of one device and that of the next are no fast motion.
    """
    dt = np.diff(trial.time)
    if not np.isnan(measured).any() or abs(np.median(dt) / np.mean(dt) - 1.0) < UNEVEN_STEPS:
        return dt, trial.command
    time = np.linspace(trial.time[0], trial.time[-1], len(trial.time))
    return np.diff(time), np.stack([np.interp(time, trial.time, c) for c in trial.command.T], axis=1)


def can_step(prepared: PreparedRecording) -> bool:
    """Return whether the robot has dynamics that accept the recording's drives; otherwise only statics applies."""
    return load_family(prepared.robot.family).dynamics is not None and set(prepared.drives) <= prepared.robot.build().dynamic_drives


def unstable_starts(prepared: PreparedRecording, traces: Sequence[Trace]) -> list[str]:
    """Return the names of trials whose loaded, untensioned robot has no stable shape near straight: their branch is a guess."""
    return [
        inputs.name
        for inputs, t in zip(prepared.inputs, traces, strict=True)
        if t.solution is not None and t.solution.unstable_start
    ]
