"""Does the next experiment settle the doubt? Poor designs of the bench, diagnosed, the proposed trial run on the same built robot,
diagnosed again.

    python -m tools.benchmarks.diagnosis.next_experiment --out results/ [--sets 12] [--seed 3000]

A day lacks one thing (payloads, rates, tendons, ...) and has one effect of 1 sigma, drawn among the six that the table of what
these data can tell calls hardest to tell apart. The bench, not the twin, runs the proposed trial, as often as proposed and twice at
least (repeats are held out last), at most five times. Printed: what was claimed and what else was possible, before and
after.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import tyro

from tools.benchmarks.diagnosis.answer import diagnosed
from tools.benchmarks.diagnosis.attribution_table import right
from tools.simulators.rod.day import Recipe, make_set
from tools.simulators.rod.design import Trial
from twin.diagnosis import Diagnosis
from twin.foundation.errors import TwinError
from twin.measurements import read
from twin.prediction.prepared import Inputs

POOR_DESIGNS = ("one_payload", "one_rate", "one_tendon", "loading_only", "tip_only")
AMPLITUDE = 1.0  # sigma
HARDEST = 6  # effects
MOST_TRIAL_RUNS = 5  # runs of the proposed trial


def settle(out: Path, seed: int, design: str) -> tuple[bool, bool, bool, bool] | None:
    """(doubt, right before, right after, doubt settled) of one set; None where it cannot be made or read."""
    rng = np.random.default_rng(seed)
    folder = out / f"doubt_{seed}"
    try:
        make_set(folder, Recipe(seed=seed, design=design))
        visible = [v for v in diagnosed(read(folder), seed).identifiability if np.isfinite(v.apart)]
        effect = str(rng.choice([v.effect for v in sorted(visible, key=lambda v: v.share)[:HARDEST]]))
        recipe = Recipe((effect,), AMPLITUDE, seed, design)
        make_set(folder, recipe)
        before = diagnosed(read(folder), seed)
        print(f"{seed} {design}: {effect}\n  before: {_words(before)}", flush=True)
        proposed = before.experiment
        if not before.ambiguous or proposed is None:
            return False, _first(before, effect), _first(before, effect), False
        runs = min(MOST_TRIAL_RUNS, max(2, proposed.repeats))
        print(f"  {runs} times: {proposed.words}", flush=True)
        make_set(folder, replace(recipe, more=tuple(_trial(proposed.trial, n, before) for n in range(runs))))
        after = diagnosed(read(folder), seed)
        print(f"  after:  {_words(after)}", flush=True)
    except TwinError as error:
        print(f"{seed} {design}: {error}", flush=True)
        return None
    return True, _first(before, effect), _first(after, effect), not after.ambiguous


def _trial(proposed: Inputs, n: int, of: Diagnosis) -> Trial:
    start = max(float(i.clock[-1]) for i in of.prepared.inputs) + 60.0 + n * (60.0 + float(proposed.time[-1]))
    gravity = tuple(float(g) for g in proposed.loads.gravity)
    return Trial(f"proposed_{n + 1}", proposed.loads.payload, proposed.time, proposed.time, proposed.command, start, gravity)  # type: ignore[arg-type]


def _first(d: Diagnosis, effect: str) -> bool:
    return bool(d.claims) and right({"true": [effect]}, d.claims[0].effect)


def _words(d: Diagnosis) -> str:
    claimed = " + ".join(c.effect for c in d.claims) or "-"
    return f"{d.verdict} {claimed}" + "".join(f"; or {' + '.join(s)}" for s in d.ambiguous)


def main(out: Path, sets: int = 12, seed: int = 3000) -> None:
    """Make so many sets, run the proposed trial where a doubt is left, and print how often it settles it."""
    rows = [row for k in range(sets) if (row := settle(out, seed + k, POOR_DESIGNS[k % len(POOR_DESIGNS)])) is not None]
    doubtful = [r for r in rows if r[0]]
    print(
        f"{len(rows)} sets, {len(doubtful)} left in doubt; of these right first before {sum(r[1] for r in doubtful)}, after "
        f"{sum(r[2] for r in doubtful)}; the doubt settled in {sum(r[3] for r in doubtful)}"
    )


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
