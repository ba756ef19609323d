"""The source's stress test as one command: sensors drift by up to 8.3 % over 1,000 servo cycles in 14 hours (KineSoft, Yoo et al.
2025, arXiv 2503.01078). What that costs the estimated shape, and what is left of it once the diagnosis has named the drift.

    python -m tools.bench.finger --seed 21 --out DAY ; python -m tools.bench.finger --shape --seed 21 --out SHAPE
    python -m tools.drift_stress DAY SHAPE [--seed 1] [--estimators physics,modal] [--settling]

Both days are of one finger (one seed) of the independent finite element bench, which shares no code with the twin. The trials of
DAY stand for what is logged along the way, spread evenly over the 14 hours. Of SHAPE those with clouds are taken when the finger is
new, those that are judged after the last cycle. Resistances are multiplied by 1 + drift t / 14 h; the largest drift of the four is
8.3 %, all cords drift the same way. With --settling drift is not in proportion to time, as the catalogue's law has it: of 1 -
exp(-t / 4 h), scaled to the same end. Then, as on the command line: diagnose DAY; align SHAPE with the twin found; estimate, which
undoes what drift is left and a free trial tells (`twin/shape/drift.py`).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tools.shape_error import score
from twin.diagnose import Settings, diagnose
from twin.measurements import Recording, read
from twin.robots import load
from twin.shape.align import align
from twin.shape.estimator import estimator
from twin.shape.predict import predict
from twin.twin import Twin

CYCLES, HOURS, MOST = 1000, 14.0, 0.083
SPAN, SETTLES = 3600.0 * HOURS, 3600.0 * 4.0


def drifted(recording: Recording, drift: np.ndarray, start: Callable[[int], float], settling: bool = False) -> Recording:
    """Trial k begins at start(k) s, and its sensors read `drift` (s,) more after SPAN."""
    trials = []
    for k, trial in enumerate(recording.trials):
        clock = start(k) + trial.time - trial.time[0]
        share = np.expm1(-clock / SETTLES) / np.expm1(-SPAN / SETTLES) if settling else clock / SPAN
        values = dict(trial.values)
        for i, d in enumerate(drift, 1):
            values[f"sensor_{i}_resistance"] = values[f"sensor_{i}_resistance"] * (1.0 + d * share)
        trials.append(replace(trial, start=start(k), values=values))
    return replace(recording, trials=tuple(trials))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.drift_stress", description=__doc__)
    parser.add_argument("day", type=Path)
    parser.add_argument("shape", type=Path)
    parser.add_argument("--seed", type=int, default=1, help="draws the drift of each sensor")
    parser.add_argument("--estimators", default="physics,modal")
    parser.add_argument("--settling", action="store_true", help="drift that slows down")
    args = parser.parse_args(arguments)
    day, shape, nominal = read(args.day / "measured"), read(args.shape / "measured"), Twin.of(load("finger"))
    rng = np.random.default_rng(args.seed)
    drift = rng.uniform(0.3, 1.0, 4)
    drift *= MOST * rng.choice([-1.0, 1.0]) / drift.max()
    begins = {t.name: k for k, t in enumerate(shape.trials)}
    judged = [k for name, k in begins.items() if name.startswith("test")]

    def late(k: int) -> float:
        return (SPAN if k in judged else 0.0) + 60.0 * k

    def between(k: int) -> float:
        return k * (SPAN - 60.0) / (len(day.trials) - 1)

    print(f"{CYCLES} cycles, {HOURS:g} h; drift of the sensors {np.round(100 * drift, 2)} %", flush=True)
    began = time.perf_counter()
    found = diagnose(drifted(day, drift, between, args.settling), nominal, Settings(jobs=1))
    named = ", ".join(c.effect for c in found.claims) or "none"
    rates = [e[f"rate_{i}"] for e in found.twin.effects if e.id == "sensor_drift" for i in (1, 2, 3, 4)]
    spent, seen = time.perf_counter() - began, np.round(100 * SPAN * np.array(rates), 2)
    print(f"diagnosed in {spent:.0f} s: {found.verdict}, {named}; drift {seen} %", flush=True)
    without, with_drift = drifted(shape, 0.0 * drift, late), drifted(shape, drift, late, args.settling)
    ways = {
        "without drift": (without, align(without, nominal).twin),
        "drift, not diagnosed": (with_drift, align(with_drift, nominal).twin),
        "drift, diagnosed": (with_drift, align(with_drift, found.twin).twin),
    }
    for name in args.estimators.split(","):
        base = None
        for words, (recording, twin) in ways.items():
            s = score(args.shape / "shape_truth.npz", predict(recording, estimator(name)(twin))[0], 0.0)
            error = float(np.mean(list(s.error.values())))
            base = error if base is None else base
            print(f"  {name:10s} {words:22s} {error:.3f} mm, rise {error - base:+.3f} mm", flush=True)


if __name__ == "__main__":
    main()
