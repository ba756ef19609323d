"""The loop closed once more, shape being the error: sensors that lie are diagnosed, corrected, and shapes judged before and after.

    python -m tools.bench.finger --effects sensor_hysteresis --seed 515 --out DAY
    python -m tools.bench.finger --effects sensor_hysteresis --seed 515 --shape --out SHAPE
    python -m tools.bench.finger --seed 515 --shape --out PLAIN
    python -m tools.sensor_loop DAY SHAPE PLAIN [--estimators physics,modal]

All three are of one finger (one seed) of the independent finite element bench, which shares no code with the twin; PLAIN has good
sensors. As on the command line: diagnose DAY; align SHAPE with the twin found; estimate. Mean distance of the named points, mm.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tools.shape_error import score
from twin.diagnose import Settings, diagnose
from twin.measurements import read
from twin.robots import load
from twin.shape.align import align
from twin.shape.estimator import estimator
from twin.shape.predict import predict
from twin.twin import Twin


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.sensor_loop", description=__doc__)
    parser.add_argument("day", type=Path)
    parser.add_argument("shape", type=Path)
    parser.add_argument("plain", type=Path)
    parser.add_argument("--estimators", default="physics,modal")
    args = parser.parse_args(arguments)
    nominal, began = Twin.of(load("finger")), time.perf_counter()
    found = diagnose(read(args.day / "measured"), nominal, Settings(jobs=1))
    claims = ", ".join(claim.effect for claim in found.claims) or "none"
    print(f"diagnosed in {time.perf_counter() - began:.0f} s: {found.verdict}, {claims}", flush=True)
    for effect in found.twin.effects:
        print(f"  {effect.id}: {', '.join(f'{name} {value:.3g}' for name, value in effect.values.items())}", flush=True)
    for words, folder, start in (
        ("good sensors", args.plain, nominal), ("not corrected", args.shape, nominal), ("corrected", args.shape, found.twin),
    ):  # fmt: skip
        recording = read(folder / "measured")
        aligned = align(recording, start)
        for name in args.estimators.split(","):
            arrays, _ = predict(recording, estimator(name)(aligned.twin), aligned.bands)
            s = score(folder / "shape_truth.npz", arrays, 0.0)
            mean = float(np.mean(list(s.error.values())))
            print(f"  {name:10s} {words:14s} {mean:.3f} mm, {100 * s.covered:.0f} % in band", flush=True)


if __name__ == "__main__":
    main()
