"""Runs of a twin side by side: each starts at rest on its own, so that workers change nothing but the time it takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from joblib import delayed

from twin.bench import prepare
from twin.errors import DataError, SolveError
from twin.measurements import Recording, Trial
from twin.spread import as_they_come
from twin.twin import Twin, can_step

LEAST = 2  # samples that are worth a trial


@dataclass(frozen=True)
class Ended:
    """A rollout that came to no end of its own: what happened where."""

    trial: str
    why: str


@dataclass(frozen=True)
class Rollouts:
    """What was seen, rollouts that ended early up to where they did, and those."""

    recording: Recording
    ended: tuple[Ended, ...]


def is_dynamic(twin: Twin, controls: Recording) -> bool:
    """Whether MuJoCo can step the controls: the family has dynamics, and they take what drives the tendons."""
    return can_step(prepare(controls, twin.robot))


def rollout(
    twin: Twin, controls: Recording, *, dynamic: bool | None = None, noise: float = 0.0, seed: int = 0, jobs: int = 1,
    progress: Callable[[str], None] = lambda words: None,
) -> Rollouts:  # fmt: skip
    """The twin's outputs under the controls, with `noise` (m, one standard deviation) on its markers, drawn from the seed.

    By MuJoCo steps where `is_dynamic`, else by static equilibria one after another; `dynamic` overrules. A rollout that is lost
    ends there and is listed. Joblib's threads run `jobs` of them at a time. Raises DataError where dynamics are asked for and there
    are none, SolveError where no rollout got anywhere.
    """
    if not noise >= 0.0:
        raise DataError(f"noise {noise:g} is below zero; give one standard deviation in metres")
    able = is_dynamic(twin, controls)
    if dynamic and not able:
        raise DataError(
            f"robot {twin.robot.name!r} has no dynamics under these controls: MuJoCo steps need a family with dynamics and "
            "controls that they take; leave --dynamic out for static equilibria"
        )
    steps = able if dynamic is None else dynamic
    single = [replace(controls, trials=(t,)) for t in controls.trials]
    trials: list[Trial] = []
    ended: list[Ended] = []
    runs = as_they_come((delayed(_one)(twin, one, steps) for one in single), jobs, "threads", ordered=True)
    for k, (trial, lost) in enumerate(runs, 1):
        trials += [] if trial is None else [_noisy(trial, controls, noise, [seed, k])]
        ended += [] if lost is None else [lost]
        progress(f"{k} of {len(single)} rollouts" + (f", {len(ended)} ended early" if ended else ""))
    if not trials:
        raise SolveError(f"no rollout got anywhere: {ended[0].why}")
    how = "MuJoCo steps" if steps else "static equilibria"
    channels = tuple(replace(c, noise=noise) if noise and c.kind in ("disk", "marker", "tip") else c for c in controls.channels)
    source = f"simulation: twin of {twin.robot.name}, {how}" + (f", marker noise {1e3 * noise:g} mm" if noise else "")
    return Rollouts(replace(controls, channels=channels, trials=tuple(trials), source=source), tuple(ended))


def _one(twin: Twin, controls: Recording, dynamic: bool) -> tuple[Trial | None, Ended | None]:
    try:
        return twin.predict(controls, dynamic=dynamic).trials[0], None
    except SolveError as lost:
        trial, ended = controls.trials[0], Ended(controls.trials[0].name, str(lost))
        if lost.sample is None or lost.sample < LEAST:
            return None, ended
        values = {name: column[: lost.sample] for name, column in trial.values.items()}
        seen = replace(controls, trials=(replace(trial, time=trial.time[: lost.sample], values=values),))
        return twin.predict(seen, dynamic=dynamic).trials[0], ended


def _noisy(trial: Trial, controls: Recording, noise: float, seed: list[int]) -> Trial:
    if not noise:
        return trial
    rng = np.random.default_rng(seed)
    named = [c.name for c in controls.outputs() if c.kind in ("disk", "marker", "tip")]
    return replace(trial, values={**trial.values, **{n: trial.values[n] + rng.normal(0.0, noise, len(trial.time)) for n in named}})
