"""Days of the bench whose trials each sit elsewhere, declared as noise: what is said of what happens within them.

python -m tools.within_trials --out DIR --seed 21     every effect of 3 sigma, and none, on a design without repeats
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from tools.bench.day import make_set
from tools.bench.effects import all_effects
from tools.bench.march import NoEquilibrium
from twin.bench import prepare
from twin.calibrate import fit
from twin.diagnose.diagnosis import Settings
from twin.diagnose.evidence import Evidence
from twin.diagnose.objective import objective_of, sensitivity_at
from twin.diagnose.study import Study
from twin.diagnose.within import Within, within
from twin.errors import TwinError
from twin.measurements import Recording, read
from twin.residual import row_noise
from twin.robots import load
from twin.twin import Twin

LASTING = 1.5e-3  # m, six times what the bench's camera scatters by


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=21)
    args = parser.parse_args()
    here = [n for n, e in sorted(all_effects().items()) if not e.by_length and not e.by_current and e.seen_in == "marker"]
    for seed, name in enumerate(["", *here], args.seed):
        folder = args.out / f"set_{seed}"
        try:
            make_set(folder, [name] if name else [], 3.0, seed, "no_repeats")
            said = judged(elsewhere(read(folder), seed))
        except (NoEquilibrium, TwinError) as error:
            print(f"{seed} {name}: {error}", flush=True)
            continue
        print(f"{seed} {name or 'none'}: {said.size:.2f} of what rows scatter by, {said.words()}", flush=True)


def elsewhere(recording: Recording, seed: int) -> Recording:
    """Every output of every trial off by a number of its own, and declared to be as noisy."""
    rng = np.random.default_rng(seed)
    outputs = {c.name for c in recording.channels if c.role == "output"}
    channels = tuple(replace(c, noise=LASTING) if c.name in outputs else c for c in recording.channels)
    trials = tuple(
        replace(t, values={k: v + LASTING * rng.normal() if k in outputs else v for k, v in t.values.items()})
        for t in recording.trials
    )
    return replace(recording, channels=channels, trials=trials)


def judged(recording: Recording) -> Within:
    """Of the calibrated robot, all trials fitted."""
    robot = load("continuum")
    bench = prepare(recording, robot)
    trials = list(range(len(bench.inputs)))
    start, objective, _ = objective_of(bench, Twin.of(robot), trials, Settings())
    found = fit(objective, start, refresh=True)
    G = sensitivity_at(objective, found.evaluation)
    rows = row_noise(bench, found.evaluation.raw, G, objective.whitener.noise.drive)
    return within(
        Study(objective, Evidence(bench, trials, objective.whitener.noise.drive)), found, rows, G, np.ones(len(bench.outputs), bool)
    )


if __name__ == "__main__":
    main()
