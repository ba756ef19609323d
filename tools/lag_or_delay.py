"""Does the diagnosis tell a lag from a delay? Days of the benchmark with one of them, weighed by `twin.diagnose.lateness` alone.

    python -m tools.lag_or_delay results/ [more results/]

Of each day that `tools.attribution` left in a folder and that has a lag or a delay and nothing else: what is true, what each law is
worth (2 ln odds, the best is 0), and what was found of the likeliest. A bench's lag is of second order, inertia 1 / (4 damping^2).
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from twin.bench import prepare
from twin.diagnose import Settings
from twin.diagnose.calibrate import calibrate
from twin.diagnose.lateness import LATE, given, typical, weighed
from twin.diagnose.look import looked_at
from twin.diagnose.study import silent
from twin.diagnose.weigh import Weighed, extended
from twin.effects import Start
from twin.measurements import read
from twin.robots import load
from twin.threads import single_thread
from twin.twin import Twin

STARTS = {"time_delay": Start({"delay": 0.05}, ("delay",)), "actuator_lag": Start({"time": 0.05}, ("time",))}


def days(results: list[Path]) -> Iterator[tuple[Path, dict]]:
    for folder in results:
        for row in map(json.loads, (folder / "attribution.jsonl").read_text().splitlines()):
            if set(row["true"]) <= LATE and row["true"] and row["design"] != "by_current":
                yield folder / f"set_{row['seed']}", row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("results", type=Path, nargs="+")
    right: Counter[bool] = Counter()
    for folder, row in days(parser.parse_args().results):
        recording = read(folder)
        twin, settings = Twin.of(load(recording.robot)), Settings(seed=row["seed"], jobs=1)
        with single_thread():
            looked = looked_at(prepare(recording, twin.robot), twin, settings, silent)
            study, base, _ = calibrate(looked.bench, twin, looked.sealed, looked.nominal, settings, silent)
            tried = [extended(study, base, name, start) for name, start in STARTS.items()]
            best: Weighed = max((w for w in tried if w is not None), key=lambda w: w.score)
            weights = weighed(given(study, best), typical(best))
        if weights is None:
            print(f"{row['seed']} {row['true'][0]}: early by {-typical(best):.3f} s", flush=True)
            continue
        top = max(weights.values(), key=lambda w: w.score)
        right[set(top.values) == set(row["true"])] += 1
        by = {" + ".join(sorted(laws)): round(w.score - top.score, 1) for laws, w in weights.items()}
        true = [(e["id"], e["parameters"]) for e in row["truth"]]
        found = {law: {n: float(f"{x:.3g}") for n, x in v.items()} for law, v in top.values.items()}
        print(f"{row['seed']} {row['design']}, {row['mismatch']}, {row['sigmas'][0]:.0f} sigma: {true} -> {found} {by}", flush=True)
    print(f"right: {right[True]} of {right.total()}")


if __name__ == "__main__":
    main()
