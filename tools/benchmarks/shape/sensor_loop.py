"""The loop closed once more, shape being the error: sensors that lie are diagnosed, corrected, and shapes judged before and after.

    python -m tools.simulators.finger --effects sensor_hysteresis --seed 515 --out DAY
    python -m tools.simulators.finger --effects sensor_hysteresis --seed 515 --shape --out SHAPE
    python -m tools.simulators.finger --seed 515 --shape --out PLAIN
    python -m tools.benchmarks.shape.sensor_loop DAY SHAPE PLAIN [--estimators physics,modal]

All three are of one finger (one seed) of the independent finite element bench, which shares no code with the twin; PLAIN has good
sensors. As on the command line: diagnose DAY; align SHAPE with the twin found; estimate. Mean distance of the named points, mm.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import tyro

from tools.benchmarks.shape.error import score
from twin.diagnosis import Settings, diagnose
from twin.measurements import read
from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape.alignment.align import align
from twin.shape.estimators.estimator import estimator_class
from twin.shape.predict import predict_shapes


def main(
    day: tyro.conf.Positional[Path],
    shape: tyro.conf.Positional[Path],
    plain: tyro.conf.Positional[Path],
    estimators: str = "physics,modal",
) -> None:
    """Diagnose `day`, align `shape` with the twin found, and print errors beside those of `plain`."""
    nominal, began = Twin.of(load("finger")), time.perf_counter()
    found = diagnose(read(day / "measured"), nominal, Settings(jobs=1))
    claims = ", ".join(claim.effect for claim in found.claims) or "none"
    print(f"diagnosed in {time.perf_counter() - began:.0f} s: {found.verdict}, {claims}", flush=True)
    for effect in found.twin.effects:
        print(f"  {effect.id}: {', '.join(f'{name} {value:.3g}' for name, value in effect.values.items())}", flush=True)
    for words, folder, start in (
        ("good sensors", plain, nominal), ("not corrected", shape, nominal), ("corrected", shape, found.twin),
    ):  # fmt: skip
        recording = read(folder / "measured")
        aligned = align(recording, start)
        for name in estimators.split(","):
            arrays, _ = predict_shapes(recording, estimator_class(name)(aligned.twin), aligned.widening)
            s = score(folder / "shape_truth.npz", arrays, 0.0)
            mean = float(np.mean(list(s.error.values())))
            print(f"  {name:10s} {words:14s} {mean:.3f} mm, {100 * s.covered:.0f} % in band", flush=True)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
