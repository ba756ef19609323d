"""The source's stress test as one command: sensors drift by up to 8.3 % over 1,000 servo cycles in 14 hours (KineSoft, Yoo et al.
2025, arXiv 2503.01078). What that costs the estimated shape, and what is left of it once the diagnosis has named the drift.

    python -m tools.bench.finger --seed 21 --out DAY ; python -m tools.bench.finger --shape --seed 21 --out SHAPE
    python -m tools.drift_stress SHAPE [--day DAY] [--seed 1] [--estimators physics,modal] [--way settling]

Both days are of one finger (one seed) of the independent finite element bench, which shares no code with the twin. The trials of
DAY stand for what is logged along the way, spread evenly over the 14 hours. Of SHAPE those with clouds are taken when the finger is
new, those that are judged after the last cycle. Resistances are multiplied by 1 + drift t / 14 h; the largest drift of the four is
8.3 %, all cords drift the same way. Drift that is not in proportion to time, as the catalogue's law has it: `settling` goes as 1 -
exp(-t / 4 h), scaled to the same end; `walk` is a random walk of each sensor alone, 8.3 % from the start at its furthest. Then, as
on the command line: diagnose DAY, where one is given; align SHAPE with the twin found; estimate, which undoes what drift is left
and a free trial tells (`twin/shape/drift.py`). "as read" leaves that out.
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
from twin.measurements.recording import CONTACT
from twin.robots import load
from twin.shape.align import align
from twin.shape.estimator import estimator
from twin.shape.predict import predict
from twin.twin import Twin

CYCLES, HOURS, MOST = 1000, 14.0, 0.083
SPAN, SETTLES = 3600.0 * HOURS, 3600.0 * 4.0


def shares(way: str, seed: int, sensors: int) -> Callable[[np.ndarray], np.ndarray]:
    """(n, s) of each sensor's drift at times (n,) s."""
    if way == "walk":
        grid, steps = np.linspace(0.0, SPAN, 2000), np.random.default_rng([seed, 1]).normal(size=(2000, sensors))
        walk = np.cumsum(steps, axis=0) - steps[0]
        walk /= np.abs(walk).max(axis=0)
        return lambda clock: np.stack([np.interp(clock, grid, w) for w in walk.T], axis=1)
    one = (lambda t: np.expm1(-t / SETTLES) / np.expm1(-SPAN / SETTLES)) if way == "settling" else (lambda t: t / SPAN)
    return lambda clock: np.tile(one(clock)[:, None], (1, sensors))


def drifted(
    recording: Recording, drift: np.ndarray, start: Callable[[int], float], share: Callable[[np.ndarray], np.ndarray]
) -> Recording:
    """Trial k begins at start(k) s, and its sensors read `drift` (s,) times their share more."""
    trials = []
    for k, trial in enumerate(recording.trials):
        clock = start(k) + trial.time - trial.time[0]
        values = dict(trial.values)
        for i, by in enumerate((drift * share(clock)).T, 1):
            values[f"sensor_{i}_resistance"] = values[f"sensor_{i}_resistance"] * (1.0 + by)
        trials.append(replace(trial, start=start(k), values=values))
    return replace(recording, trials=tuple(trials))


def each_alone(recording: Recording) -> Recording:
    """As if something might push in every trial, so that none tells drift."""
    return replace(recording, trials=tuple(replace(t, other={CONTACT: t.other.get(CONTACT, "none")}) for t in recording.trials))


def _diagnosed(day: Recording, drift: np.ndarray, share: Callable[[np.ndarray], np.ndarray]) -> Twin:
    began = time.perf_counter()
    spread = drifted(day, drift, lambda k: k * (SPAN - 60.0) / (len(day.trials) - 1), share)
    found = diagnose(spread, Twin.of(load("finger")), Settings(jobs=1))
    named = ", ".join(c.effect for c in found.claims) or "none"
    rates = [e[f"rate_{i}"] for e in found.twin.effects if e.id == "sensor_drift" for i in (1, 2, 3, 4)]
    spent, seen = time.perf_counter() - began, np.round(100 * SPAN * np.array(rates), 2)
    print(f"diagnosed in {spent:.0f} s: {found.verdict}, {named}; drift {seen} %", flush=True)
    return found.twin


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.drift_stress", description=__doc__)
    parser.add_argument("shape", type=Path)
    parser.add_argument("--day", type=Path)
    parser.add_argument("--seed", type=int, default=1, help="draws the drift of each sensor")
    parser.add_argument("--estimators", default="physics,modal")
    parser.add_argument("--way", choices=("linear", "settling", "walk"), default="linear", help="of drift through time")
    args = parser.parse_args(arguments)
    shape, nominal = read(args.shape / "measured"), Twin.of(load("finger"))
    rng = np.random.default_rng(args.seed)
    drift = rng.uniform(0.3, 1.0, 4)
    drift *= MOST * rng.choice([-1.0, 1.0]) / drift.max()
    drift = np.full(4, MOST) if args.way == "walk" else drift
    way = shares(args.way, args.seed, len(drift))
    begins = {t.name: k for k, t in enumerate(shape.trials)}
    judged = [k for name, k in begins.items() if name.startswith("test")]

    def late(k: int) -> float:
        return (SPAN if k in judged else 0.0) + 60.0 * k

    print(f"{CYCLES} cycles, {HOURS:g} h, {args.way}; drift of the sensors {np.round(100 * drift, 2)} %", flush=True)
    without, with_drift = drifted(shape, 0.0 * drift, late, way), drifted(shape, drift, late, way)
    blind = align(with_drift, nominal).twin
    ways = {
        "without drift": (without, align(without, nominal).twin),
        "drift, as read": (each_alone(with_drift), blind),
        "drift, not diagnosed": (with_drift, blind),
    }
    if args.day:
        ways["drift, diagnosed"] = (with_drift, align(with_drift, _diagnosed(read(args.day / "measured"), drift, way)).twin)
    for name in args.estimators.split(","):
        base = None
        for words, (recording, twin) in ways.items():
            arrays = predict(recording, estimator(name)(twin))[0]
            s = score(args.shape / "shape_truth.npz", arrays, 0.0)
            error = float(np.mean(list(s.error.values())))
            base = error if base is None else base
            print(f"  {name:10s} {words:22s} {error:.3f} mm, rise {error - base:+.3f} mm", flush=True)


if __name__ == "__main__":
    main()
