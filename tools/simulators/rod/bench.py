"""Runs a bench day on a built robot with its effects: true motion and noise-free logs of every trial.

Order of loads in a trial: straight and unloaded; gravity and payload in 4 steps; the first command in 12 or more; then
the log. The whole ramp takes RAMP_SECONDS seconds before the log's time zero. Slow states live on the day's clock.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tools.simulators.rod.design import Day, Trial
from tools.simulators.rod.effects import Effect, Situation
from tools.simulators.rod.mechanics.rod import Creep, Rod, follow

RAMP_SECONDS = 2.0  # s
GAUSS_NODES = 3  # Gauss nodes per interval: the tip is within 2e-3 mm of the converged one at the fullest loads
COLD = 16  # steps in which gravity and payload come on where springs pull
LARGEST_DRIVE_STEP = (0.25, 1e-3)  # N or m, largest step of the drive between two equilibria


@dataclass(frozen=True)
class Log:
    """One trial, free of noise; SI."""

    trial: Trial
    tension: np.ndarray  # (n, T) N, by the load cells; the command where an effect says so
    markers: np.ndarray  # (n, N, 3) m
    displacement: np.ndarray  # (n, T) m, motor side
    ambient: np.ndarray  # (n,) degC
    current: np.ndarray  # (n, T) A, where springs pull; else (0, T)
    temperature: np.ndarray  # (n, T) degC, of springs; else (0, T)


def run(rod: Rod, effects: Sequence[Effect], day: Day, progress: Callable[[int], None] = lambda done: None) -> list[Log]:
    """All trials of the day, in the order of the clock."""
    logs: list[Log] = []
    delayed, rested = None, 0.0
    for n, trial in enumerate(day.trials):
        situation = Situation(rod, np.array(trial.gravity or day.gravity), trial.payload, trial.start)
        for effect in effects:
            effect.mount(situation)
        creep = None
        if situation.creep is not None:
            share, time = situation.creep
            if delayed is None:
                delayed = np.zeros((len(time), len(rod.pitch), GAUSS_NODES, 3))
            else:
                delayed *= np.exp(-max(0.0, trial.start - RAMP_SECONDS - rested) / time)[:, None, None, None]
            creep = Creep(share, time, delayed)
        logs.append(_run_trial(situation, effects, day, trial, creep))
        rested = trial.start + trial.time[-1]
        progress(n + 1)
    return logs


def _run_trial(situation: Situation, effects: Sequence[Effect], day: Day, trial: Trial, creep: Creep | None) -> Log:
    if day.driven_by_current:
        return _run_heated(situation, effects, day, trial)
    delivered = trial.command
    for effect in effects:
        delivered = effect.deliver(trial.fine, delivered)

    def at(time: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(time, trial.fine, column) for column in delivered.T], axis=1)

    seen = np.maximum(trial.time - situation.latency, 0.0)  # the moment a row's outputs show
    grid = np.union1d(np.union1d(trial.time, seen), _milestones(trial.fine, delivered, LARGEST_DRIVE_STEP[day.driven_by_length]))
    drive = at(grid)
    if day.driven_by_length:
        for effect in effects:
            drive = effect.pull(drive)
    path, lead = _ramped(drive, LARGEST_DRIVE_STEP[day.driven_by_length])
    shape = follow(
        situation.rod,
        -path if day.driven_by_length else path,
        gravity=situation.gravity,
        payload=situation.payload,
        weight=np.minimum(np.arange(1, len(path) + 1) / 4, 1.0),
        softness=_softness(effects, trial.start + np.concatenate([np.zeros(lead), grid]), day),
        dt=np.concatenate([np.full(lead + 1, RAMP_SECONDS / (lead + 1)), np.diff(grid)]),
        mu=situation.mu,
        stroke=situation.stroke,
        creep=creep,
        fields=situation.fields,
        driven_by_length=day.driven_by_length,
        stretch=situation.stretch if day.driven_by_length else 0.0,
        bedding=situation.bedding if day.driven_by_length else (0.0, 1.0),
        keep=np.arange(len(path)) >= lead,
        nodes=GAUSS_NODES,
    )
    inputs, outputs = np.searchsorted(grid, trial.time), np.searchsorted(grid, seen)
    clock = trial.start + trial.time
    ambient = day.ambient(clock)
    markers = shape.markers[outputs]
    for effect in effects:
        markers = effect.observe(clock, ambient, markers)
    tension, displacement = shape.tension[:, 0], shape.displacement
    if day.driven_by_length:
        tension, displacement = tension[outputs], at(trial.time)
    else:
        for effect in effects:
            displacement = effect.encode(displacement, tension)
        tension, displacement = tension[inputs], displacement[outputs]
        if any(effect.logs_command for effect in effects):
            tension = np.stack([np.interp(trial.time, trial.fine, column) for column in trial.command.T], axis=1)
    for effect in effects:
        tension = effect.read(clock, tension)
    none = np.zeros((0, tension.shape[1]))
    return Log(trial, tension, markers, displacement, ambient, none, none)


def _ramped(drive: np.ndarray, stride: float) -> tuple[np.ndarray, int]:
    """Prepend loading: 4 steps without drive, then 12 or more to the first row; return the path and the rows before the log."""
    ramp = max(12, int(np.ceil(np.abs(drive[0]).max() / (0.4 * stride))))
    path = np.concatenate([np.zeros((4, drive.shape[1])), drive[0] * np.arange(1, ramp + 1)[:, None] / ramp, drive[1:]])
    return path, 4 + ramp - 1


def _softness(effects: Sequence[Effect], clock: np.ndarray, day: Day) -> np.ndarray:
    """Return the factor (n,) on the backbone's compliance at times (n,) s of the day."""
    softness = np.ones(len(clock))
    for effect in effects:
        softness = softness * effect.soften(clock, day.ambient(clock))
    return softness


def _run_heated(situation: Situation, effects: Sequence[Effect], day: Day, trial: Trial) -> Log:
    """A trial in which currents, constant from row to row, heat springs; from cold springs and the unloaded straight robot."""
    current = np.stack([np.interp(trial.time, trial.fine, column) for column in trial.command.T], axis=1)
    lead = 2 * COLD - 1
    clock = trial.start + trial.time
    ambient, softness = day.ambient(clock), _softness(effects, clock, day)
    shape = follow(
        situation.rod,
        np.vstack([np.zeros((lead, current.shape[1])), current]),
        gravity=situation.gravity,
        payload=situation.payload,
        weight=np.minimum(np.arange(1, len(clock) + lead + 1) / COLD, 1.0),
        softness=np.append(np.full(lead, softness[0]), softness),
        dt=np.append(np.zeros(lead + 1), np.diff(trial.time)),
        mu=situation.mu,
        stroke=situation.stroke,
        fields=situation.fields,
        springs=situation.springs,
        ambient=np.append(np.full(lead, ambient[0]), ambient),
        stretch=situation.stretch,
        keep=np.arange(len(clock) + lead) >= lead,
        nodes=GAUSS_NODES,
    )
    markers, tension, displacement = shape.markers, shape.tension[:, 0], shape.displacement
    for effect in effects:
        displacement = effect.encode(displacement, tension)  # at the spring's end, as at the motor's
        markers, tension = effect.observe(clock, ambient, markers), effect.read(clock, tension)
    return Log(trial, tension, markers, displacement, ambient, current, shape.temperature)


def _milestones(time: np.ndarray, drive: np.ndarray, stride: float) -> np.ndarray:
    """Fine times at which some tendon's drive has changed by `stride` since the last one."""
    marks, last = [], drive[0]
    for t, now in zip(time, drive, strict=True):
        if np.abs(now - last).max() > stride:
            marks.append(t)
            last = now
    return np.array(marks)


def logged_inputs(logs: Sequence[Log], day: Day) -> list[np.ndarray]:
    """What the log says that drove each trial (n, T): currents, displacements or tensions."""
    return [
        log.current if day.driven_by_current else log.displacement if day.driven_by_length else np.maximum(log.tension, 0.0)
        for log in logs
    ]


def as_described(rod: Rod, drives: Sequence[Effect], logs: Sequence[Log], day: Day) -> list[Log]:
    """What the same built robot, with its drives, would log without any effect, driven by the logged inputs."""
    inputs = zip(logs, logged_inputs(logs, day), strict=True)
    trials = tuple(replace(log.trial, fine=log.trial.time, command=c) for log, c in inputs)
    return run(rod, drives, replace(day, trials=trials))
