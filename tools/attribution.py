"""Does the diagnosis name the right effect? Fresh sets of the independent bench, diagnosed one by one, scored and tabled.

    python tools/attribution.py --out results/ [--none 15 --single 35 --pairs 10] [--seed 1000]

Amplitudes are log-uniform from 1 to 8 sigmas (marker noise, left after refitting the robot's own parameters); designs, gravity,
nuisance geometry and noise are drawn per set. Results go to results/attribution.jsonl as they come, so an interrupted run resumes.
An effect counts as named if it, or one of its class (effects such data hardly tell apart), is claimed with the largest
contribution.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from pathlib import Path

import numpy as np

from tools.bench.day import make_set
from twin.diagnose import Settings, diagnose
from twin.effects import catalogue
from twin.errors import TwinError
from twin.measurements import read
from twin.robots import load
from twin.twin import Twin

CLASSES = ({"base_tilt", "camera_misalignment"}, {"time_delay", "actuator_lag"})
DESIGNS = ("default", "default", "default", "mixed", "sideways", "hanging")


def plan(none: int, single: int, pairs: int, seed: int) -> list[tuple[int, list[str], float, str, bool]]:
    """(seed, effects, amplitude, design, coloured noise) of each set."""
    rng = np.random.default_rng(seed)
    names = sorted(catalogue())
    sets: list[list[str]] = [[] for _ in range(none)]
    sets += [[names[k % len(names)]] for k in range(single)]
    sets += [[str(n) for n in rng.choice(names, 2, replace=False)] for _ in range(pairs)]
    out = []
    for k, effects in enumerate(sets):
        amplitude = float(np.exp(rng.uniform(0.0, np.log(8.0))))
        out.append((seed + k, effects, amplitude, str(rng.choice(DESIGNS)), bool(rng.uniform() < 0.3)))
    order = rng.permutation(len(out))
    return [out[k] for k in order]


def same(a: str, b: str) -> bool:
    return a == b or any(a in c and b in c for c in CLASSES)


def run(case: tuple[int, list[str], float, str, bool], folder: Path) -> dict[str, object]:
    """Make one set, diagnose it, keep what the table needs."""
    seed, effects, amplitude, design, coloured = case
    where = folder / f"set_{seed}"
    shutil.rmtree(where, ignore_errors=True)
    make_set(where, effects, amplitude, seed, design, coloured=coloured)
    truth = json.loads((where / "truth.json").read_text())
    began = time.perf_counter()
    d = diagnose(read(where), Twin.of(load("continuum")), Settings(seed=seed))
    seconds = time.perf_counter() - began
    claims = [c.effect for c in d.claims]
    return {
        "seed": seed, "true": effects, "sigmas": [e["sigmas"] for e in truth["effects"]], "amplitude": amplitude, "design": design,
        "coloured": coloured, "verdict": d.verdict, "claims": claims, "probability": [c.probability for c in d.claims],
        "contribution": [c.contribution for c in d.claims], "small": [c.effect for c in d.below_materiality],
        "calibrated": d.errors.calibrated["marker"], "after": d.errors.after["marker"], "floor": d.errors.floor["marker"],
        "structure": [d.structure_before, d.structure_after], "line": d.line[0], "seconds": seconds, "samples": d.bench.n_sample,
        "parameters": {c.effect: {n: [f.value, f.std] for n, f in c.parameters.items()} for c in d.claims},
        "truth": truth["effects"], "scores": [[list(s), v] for s, v in d.scores[:5]],
    }  # fmt: skip


def table(rows: list[dict]) -> str:
    none = [r for r in rows if not r["true"]]
    single = [r for r in rows if len(r["true"]) == 1]
    pairs = [r for r in rows if len(r["true"]) == 2]

    def share(hits: list[bool]) -> str:
        return f"{sum(hits)}/{len(hits)}" + (f" = {100 * sum(hits) / len(hits):.0f} %" if hits else "")

    def exact(r: dict) -> bool:
        return len(r["claims"]) == len(r["true"]) and all(any(same(c, t) for t in r["true"]) for c in r["claims"])

    def first(r: dict) -> bool:
        return bool(r["claims"]) and any(same(r["claims"][0], t) for t in r["true"])

    false = [bool(r["claims"]) or r["verdict"] == "unexplained" for r in none]
    left = [r["verdict"] in ("unexplained", "partly_explained") for r in rows]
    seconds = [r["seconds"] for r in rows]
    ratio = [r["after"] / r["floor"] for r in single]
    lines = [
        f"sets                                     {len(rows)} ({len(none)} none, {len(single)} single, {len(pairs)} pairs)",
        f"false positives on no-effect sets        {share(false)}",
        f"right effect first, one effect           {share([first(r) for r in single])}",
        f"exact set, one effect                    {share([exact(r) for r in single])}",
        f"first is a true one, two effects         {share([first(r) for r in pairs])}",
        f"exact set, two effects                   {share([exact(r) for r in pairs])}",
        f"false 'unexplained' or 'partly'          {share(left)}",
    ]
    if ratio:
        lines.append(f"held-out error after / floor, singles    median {np.median(ratio):.3f}, 90 % {np.quantile(ratio, 0.9):.3f}")
    lines.append(f"worse than before on held-out trials     {share([r['after'] > 1.001 * r['calibrated'] for r in rows])}")
    lines.append(f"seconds a diagnosis                      median {np.median(seconds):.1f}, max {max(seconds):.1f}")
    wrong = [r for r in rows if not exact(r) or r["verdict"] not in ("noise", "explained")]
    for r in wrong:
        said = f"{r['verdict']} {r['claims']}, too small {r['small']}"
        lines.append(f"  seed {r['seed']}: {r['true']} at {r['sigmas']} sigma, {r['design']} -> {said}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    for name, count in (("none", 15), ("single", 35), ("pairs", 10)):
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--seed", type=int, default=1000)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    log = args.out / "attribution.jsonl"
    rows = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    done = {r["seed"] for r in rows}
    for case in plan(args.none, args.single, args.pairs, args.seed):
        if case[0] in done:
            continue
        try:
            rows.append(run(case, args.out))
        except TwinError as error:
            print(f"seed {case[0]}: {error}", flush=True)
            continue
        with log.open("a") as file:
            file.write(json.dumps(rows[-1]) + "\n")
        r = rows[-1]
        print(f"seed {r['seed']} {r['true']} {r['sigmas']} -> {r['verdict']} {r['claims']} ({r['seconds']:.0f} s)", flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
