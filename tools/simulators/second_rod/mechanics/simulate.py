"""A day run through, trial after trial on one clock, with its effects or with none at given inputs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tools.simulators.second_rod.day import Day, Trial
from tools.simulators.second_rod.effects import Effect
from tools.simulators.second_rod.effects.effect import Backbone, Markers
from tools.simulators.second_rod.mechanics.equilibrium import Equilibrium, Loads, Model
from tools.simulators.second_rod.mechanics.rod import INTERVALS
from tools.simulators.second_rod.mechanics.tendons import ROD_TENDONS

Array = np.ndarray
SETTLING = 1.5  # s from the slow start of a trial to its first row
DRIVE_STEP = 0.01  # s, for what happens between command and delivery; a tenth of a row where rows are closer
FIRST_DRIVE_STEPS = 6  # steps in which a trial's first drive is applied; twice as many where the path counts


@dataclass(frozen=True)
class Run:
    """One trial without noise, at the rows asked for."""

    positions: Array  # (rows, INTERVALS, 3) m, as the camera sees them
    axes: Array  # (rows, INTERVALS, 3)
    inputs: Array  # (rows, ROD_TENDONS) as logged, N or m
    others: Array  # (rows, ROD_TENDONS) the quantity that does not drive, as logged
    failures: int  # equilibria not found


def staged(effects: Sequence[Effect]) -> list[Effect]:
    return sorted(effects, key=lambda effect: effect.stage)


def delivered(trial: Trial, times: Array, day: Day, effects: Sequence[Effect]) -> Array:
    """(n, ROD_TENDONS) what the drive brings to the tendons at times of a trial, N or m."""
    changing = [effect for effect in staged(effects) if type(effect).delivered is not Effect.delivered]
    if not changing:
        return trial.command(times)
    step = min(DRIVE_STEP, float(trial.times[1]) / 10)
    fine = np.arange(0, trial.times[-1] + step, step)
    command = trial.command(fine)
    for effect in changing:
        command = effect.delivered(command, step, day)
    return np.column_stack([np.interp(times, fine, command[:, tendon]) for tendon in range(ROD_TENDONS)])


def read(tension: Array, clock: Array, day: Day, effects: Sequence[Effect]) -> Array:
    """(n, ROD_TENDONS) N the load cells show."""
    for effect in staged(effects):
        tension = effect.read(tension, clock / day.duration)
    return tension


class Path(NamedTuple):
    """What the drive brings to the tendons during a trial, and at how many steps to the row."""

    times: Array  # (n,) s
    drive: Array  # (n, ROD_TENDONS) N, or m
    every: int


def follow(
    model: Model, trial: Trial, path: Path, gravity: Array, backbone: Sequence[Backbone]
) -> tuple[Array, Array, Array, Array, int]:
    """Return one trial's equilibria: disk centres, axes, tensions and pulled-in lengths at every `every`-th time, and failures."""
    times, drive, every = path
    at = Equilibrium(model)
    history = every > 1

    def adapt(seconds: float) -> float:
        """The rest shape as it is now; how stiff."""
        at.rest = np.zeros(at.coefficients.size) + sum((state.rest() for state in backbone), start=0.0)
        return float(np.prod([state.stiffness(trial.start + seconds) for state in backbone]))

    def spend(seconds: float, before: Array) -> None:
        for state in backbone:
            state.spend(seconds, at.coefficients - at.rest, at.coefficients - before)

    at.start(Loads(drive[0], gravity, trial.payload), adapt(0.0), 2 * FIRST_DRIVE_STEPS if history else FIRST_DRIVE_STEPS)
    spend(SETTLING, at.coefficients)
    shapes, axes, tensions, pulled = [], [], [], []
    for row, time in enumerate(times):
        before = at.coefficients
        at.step(Loads(drive[row], gravity, trial.payload), adapt(float(time)))
        spend(float(time - times[row - 1]) if row else 0.0, before)
        if row % every == 0:
            centres, normals = at.disks()
            shapes.append(centres)
            axes.append(normals)
            tensions.append(at.tensions)
            pulled.append(at.pulled_in())
    return np.array(shapes), np.array(axes), np.array(tensions), np.array(pulled), at.failures


def simulate(
    day: Day, effects: Sequence[Effect] = (), rows: Sequence[Array] | None = None, inputs: Sequence[Array] | None = None
) -> list[Run]:
    """The day's trials. rows: of each trial, where not all are needed; inputs: (rows, ROD_TENDONS) each, that drive in place of the
    commands. A robot that remembers nothing needs no rows but those asked for.
    """
    every = max([1, *(effect.between_rows for effect in effects)])
    first = day.robot.model(day.by_displacement)
    backbone = [state for effect in effects if (state := effect.backbone(first.rod, day)) is not None]
    out, clock = [], 0.0
    for number, trial in enumerate(day.trials):
        logged = trial.times if rows is None else trial.times[rows[number]]
        shown = logged
        for effect in effects:
            shown = effect.clock(shown)
        parts = np.diff(shown)[:, None] * np.arange(1, every + 1) / every
        times = np.concatenate([shown[:1], (shown[:-1, None] + parts).ravel()])
        drive = delivered(trial, times, day, effects) if inputs is None else inputs[number]
        robot, gravity = day.robot, day.gravities[trial.mount]
        for effect in effects:
            robot, gravity = effect.built(robot, trial.start / day.duration), effect.gravity(gravity)
        for state in backbone:
            state.wait(trial.start - clock)
        model = robot.model(day.by_displacement)
        centres, axes, tensions, pulled, failures = follow(model, trial, Path(times, drive, every), gravity, backbone)
        clock = trial.start + float(logged[-1])
        positions = centres + day.robot.marker_offsets[:, None] * axes
        if positions.shape != (logged.size, INTERVALS, 3) or not np.all(np.isfinite(positions)):
            raise ArithmeticError(f"trial {trial.name}: the robot's shape was not found in all rows")
        part = Trial(trial.name, logged, trial.command, trial.payload, trial.mount, trial.start)
        for effect in staged(effects):
            positions = effect.seen(Markers(positions, axes, gravity, number), part, day)
        command = trial.command(logged) if inputs is None else inputs[number]
        if day.by_displacement:
            out.append(Run(positions, axes, command, read(tensions, trial.start + logged, day, effects), failures))
        else:
            out.append(Run(positions, axes, read(command, trial.start + logged, day, effects), pulled, failures))
    return out


def without_effects(day: Day, runs: Sequence[Run], rows: Sequence[Array] | None = None) -> list[Run]:
    """The same robot with nothing wrong, driven by what was logged: what a twin without effects would predict at best."""
    lowest = -np.inf if day.by_displacement else 0.0
    return simulate(day, rows=rows, inputs=[np.maximum(run.inputs, lowest) for run in runs])
