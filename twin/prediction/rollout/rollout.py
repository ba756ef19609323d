"""Rollouts of a twin in parallel. Each starts at rest on its own, so that the number of workers does not change results."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from joblib import delayed

from twin.body import Drive
from twin.foundation.errors import DataError, SolveError
from twin.foundation.parallel import run_parallel
from twin.measurements import Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.simulate import can_step
from twin.prediction.twin import Twin

MARKERS = ("disk", "marker", "tip", "site")  # kinds of channels that are read with noise
FEWEST_ROLLOUT_SAMPLES = 2  # of a rollout that is lost early


@dataclass(frozen=True)
class LostRollout:
    """A rollout that ended early, and why."""

    trial: str
    why: str


@dataclass(frozen=True)
class Rollouts:
    """The rollouts' outputs, those lost early up to their end, and the list of lost ones."""

    recording: Recording
    lost: tuple[LostRollout, ...]


def can_step_controls(twin: Twin, controls: Recording) -> bool:
    """Return whether MuJoCo can step the controls: the family has dynamics, and they accept the tendons' drives."""
    return can_step(prepare(controls, twin.robot))


def _always_steps(twin: Twin, controls: Recording) -> bool:
    """Return whether the controls are an MJCF's, whose prediction is in motion always."""
    return Drive.CONTROL in prepare(controls, twin.robot).drives


def rollout(
    twin: Twin, controls: Recording, *, dynamic: bool | None = None, noise: float = 0.0, seed: int = 0, jobs: int = 1,
    progress: Callable[[str], None] = lambda words: None,
) -> Rollouts:  # fmt: skip
    """Return the twin's outputs under the controls, with `noise` (m, one standard deviation) on its markers, drawn from the seed.

    By MuJoCo steps if `can_step_controls`, else by static equilibria one after another; `dynamic` overrules. A rollout that is lost
    ends there and is listed. `jobs` of them run at a time in joblib's threads. Raises DataError where dynamics are asked for and
    there are none, SolveError where all rollouts are lost at once.
    """
    if not noise >= 0.0:
        raise DataError(f"noise {noise:g} is below zero; give one standard deviation in metres")
    able = can_step_controls(twin, controls)
    if dynamic and not able:
        raise DataError(
            f"robot {twin.robot.name!r} has no dynamics under these controls: MuJoCo steps need a family with dynamics and "
            "controls that they take; leave --dynamic out for static equilibria"
        )
    steps = able if dynamic is None else dynamic
    single = [replace(controls, trials=(t,)) for t in controls.trials]
    trials: list[Trial] = []
    lost_rollouts: list[LostRollout] = []
    runs = run_parallel((delayed(_roll_out)(twin, one, steps) for one in single), jobs, "threads", ordered=True)
    for k, (trial, lost) in enumerate(runs, 1):
        trials += [] if trial is None else [_with_noise(trial, controls, noise, [seed, k])]
        lost_rollouts += [] if lost is None else [lost]
        progress(f"{k} of {len(single)} rollouts" + (f", {len(lost_rollouts)} ended early" if lost_rollouts else ""))
    if not trials:
        raise SolveError(f"all rollouts are lost at their start: {lost_rollouts[0].why}")
    how = "MuJoCo steps" if steps or _always_steps(twin, controls) else "static equilibria"
    channels = tuple(replace(c, noise=noise) if noise and c.kind in MARKERS else c for c in controls.channels)
    source = f"simulation: twin of {twin.robot.name}, {how}" + (f", marker noise {1e3 * noise:g} mm" if noise else "")
    return Rollouts(replace(controls, channels=channels, trials=tuple(trials), source=source), tuple(lost_rollouts))


def _roll_out(twin: Twin, controls: Recording, dynamic: bool) -> tuple[Trial | None, LostRollout | None]:
    try:
        return twin.predict(controls, dynamic=dynamic).trials[0], None
    except SolveError as lost:
        trial, rollout_lost = controls.trials[0], LostRollout(controls.trials[0].name, str(lost))
        if lost.sample is None or lost.sample < FEWEST_ROLLOUT_SAMPLES:
            return None, rollout_lost
        values = {name: column[: lost.sample] for name, column in trial.values.items()}
        shortened = replace(controls, trials=(replace(trial, time=trial.time[: lost.sample], values=values),))
        return twin.predict(shortened, dynamic=dynamic).trials[0], rollout_lost


def _with_noise(trial: Trial, controls: Recording, noise: float, seed: list[int]) -> Trial:
    if not noise:
        return trial
    rng = np.random.default_rng(seed)
    named = [c.name for c in controls.outputs() if c.kind in MARKERS]
    return replace(trial, values={**trial.values, **{n: trial.values[n] + rng.normal(0.0, noise, len(trial.time)) for n in named}})
