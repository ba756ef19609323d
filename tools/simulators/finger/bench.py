"""Runs a bench day on a built finger with its effects: every row's equilibrium, in order, since the finger remembers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tools.simulators.finger.effects import Effect
from tools.simulators.finger.mechanics.hand import Hand
from tools.simulators.finger.mechanics.statics import Finger, Load, NotConverged, State
from tools.simulators.finger.motions import PAUSE, Trial
from tools.simulators.finger.sensors import Built

LARGEST_PULL_STEP = 0.8  # mm, the largest step of a pulling drive between two equilibria
SLACK = -1.0  # mm, a tendon paid out further plays no part
RETURN = 1.0  # s in which the finger goes back to rest after a trial


@dataclass(frozen=True)
class Log:
    """One trial, free of noise."""

    trial: Trial
    u: np.ndarray  # (n, nodes, 3) mm, in the finger's own frame
    strain: np.ndarray  # (n, 4)
    tension: np.ndarray  # (n, 4) N, at the base
    failures: int  # rows without an equilibrium, which repeat the one before


def make_finger(built: Built, effects: Sequence[Effect]) -> Finger:
    """The built finger with what effects change in it."""
    finger = Finger.of(1e-3 * built.E_kPa, built.nu)
    for effect in effects:
        effect.build(finger, built.turn())
    return finger


def run(
    finger: Finger,
    effects: Sequence[Effect],
    trials: Sequence[Trial],
    hands: dict[str, Hand],
    progress: Callable[[str], None] = lambda done: None,
) -> list[Log]:
    """All trials in the order of the clock, each from rest; `hands` by the trial's name."""
    rest = finger.hanging()
    lengths = rest.length.sum(axis=1)
    state, logs = rest, []
    for trial in trials:
        logs.append(_run_trial(finger, effects, trial, hands.get(trial.name), state, lengths))
        state = logs[-1][1]
        end = trial.start + float(trial.time[-1])
        for dt in (RETURN, PAUSE - RETURN):
            state = finger.step(state, Load(lengths, swelling=_swelling(effects, end + RETURN)), dt)
        progress(f"{trial.name}: {len(logs)} of {len(trials)}")
    return [log for log, _ in logs]


def _swelling(effects: Sequence[Effect], clock: float) -> float:
    return float(np.prod([effect.swell(clock) for effect in effects]))


def _run_trial(
    finger: Finger, effects: Sequence[Effect], trial: Trial, hand: Hand | None, state: State, lengths: np.ndarray
) -> tuple[Log, State]:
    delivered = trial.command
    for effect in effects:
        delivered = effect.drive(delivered)
    state = replace(state, contacts=np.zeros_like(state.contacts))
    u, strain, tension, failures = [], [], [], 0
    before, last, at = state, 0.0, delivered[0]
    for time, goal in zip(trial.time, delivered, strict=True):
        count = max(1, int(np.ceil(np.abs(np.maximum(goal, SLACK) - np.maximum(at, SLACK)).max() / LARGEST_PULL_STEP)))
        for part in np.arange(1, count + 1) / count:
            now = last + part * (time - last)
            force = None if hand is None else hand.at(now, finger.skin, len(state.u))
            load = Load(lengths - at - part * (goal - at), force=force, swelling=_swelling(effects, trial.start + now))
            if finger.creep is None and _same(load, state.load):
                continue
            try:
                after = finger.step(state, load, (time - last) / count, _ahead(before, state))
            except NotConverged:
                failures += 1
                continue
            before, state = state, after
        last, at = time, goal
        u.append(state.u)
        strain.append(finger.cords.strain(state.u))
        tension.append(state.tension)
    return Log(trial, np.array(u), np.array(strain), np.array(tension), failures), state


def _same(load: Load, other: Load) -> bool:
    forces = load.force is None and other.force is None
    return forces and load.swelling == other.swelling and bool(np.abs(load.limit - other.limit).max() < 1e-9)


def _ahead(before: State, now: State) -> State:
    """A first guess: the last step once more."""
    return replace(
        now,
        u=2 * now.u - before.u,
        pressure=2 * now.pressure - before.pressure,
        tension=np.maximum(2 * now.tension - before.tension, 0.0) * (now.tension > 0),
    )
