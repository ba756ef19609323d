"""Does the diagnosis name the right effect? Fresh sets of the independent bench, diagnosed one by one, scored and tabled.

    python -m tools.attribution --out results/ [--sets 300] [--seed 5000] [--jobs 2] [--backend ray] [--design by_length]

Of the sets 15 % have no effect, 55 % one (all in turn), 15 % two, 15 % one that is not in the catalogue. Amplitudes are 1, 3 or 8
sigma (marker noise, left after refitting the robot's own parameters); the robot is as described ("exact"), within its tolerances
("built"), or half again as far and with a soft spot and a slight helix that no parameter spans ("rough": some 0.1 sigma). Designs,
mounts, instruments and what drives the tendons are drawn. Results go to results/attribution.jsonl as they come, so an interrupted
run resumes; sets run side by side in processes here, or on a cluster (`--backend ray`, by RAY_ADDRESS). An effect counts as named
if it, or one of its class (effects such data hardly tell apart), is claimed with the largest contribution.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed

from tools.attribution_table import table
from tools.bench.day import MISMATCH, make_set
from tools.bench.effects import all_effects
from tools.bench.rod import NoEquilibrium
from tools.cluster import BACKENDS, backend
from tools.compared import COMPARED, SAME, distance
from twin.diagnose import Diagnosis, Settings, diagnose
from twin.effects import catalogue
from twin.errors import DataError, SolveError
from twin.measurements import read
from twin.robots import load
from twin.spread import as_they_come
from twin.twin import Twin

AMPLITUDES = (1.0, 3.0, 8.0)
DESIGNS = ("default", "default", "default", "mixed", "sideways", "hanging", "by_length", "by_current")
BLOCK = ("none", "one", "one", "one", "pair", "unknown", "one", "none", "one", "one", "one", "one", "pair", "unknown",
         "one", "one", "one", "pair", "unknown", "none")  # fmt: skip
NO_SPRINGS = {
    "actuator_saturation",
    "actuator_lag",
    "tendon_backlash",
    "backbone_creep",
    "tendon_elasticity",
}  # not on the bench where springs pull


@dataclass(frozen=True)
class Case:
    """One set of the plan."""

    seed: int
    kind: str
    effects: tuple[str, ...]
    amplitude: float
    design: str
    mismatch: str
    coloured: bool


def plan(sets: int, seed: int, only: str | None = None) -> list[Case]:
    """The sets in the order they are run: any first part of it is a fair sample of the whole. With `only`, all of one design, and
    of the effects those that act there."""
    rng = np.random.default_rng(seed)
    named = sorted(set(catalogue()) & set(all_effects()))  # fingers and jaws are not on this bench
    if only is not None:
        named = [n for n in named if only == "by_current" or not all_effects()[n].by_current]
        named = [n for n in named if only == "by_length" or not all_effects()[n].by_length]
    others = sorted(n for n, e in all_effects().items() if not e.in_catalogue)
    turn: dict[str, list[str]] = {"one": [], "unknown": []}

    def next_of(kind: str, names: list[str]) -> str:
        if not turn[kind]:
            turn[kind] = [str(n) for n in rng.permutation(names)]
        return turn[kind].pop()

    out = []
    for k in range(sets):
        kind = BLOCK[k % len(BLOCK)]
        effects: tuple[str, ...] = ()
        if kind == "one":
            effects = (next_of("one", named),)
        elif kind == "pair":
            effects = tuple(str(n) for n in rng.choice(named, 2, replace=False))
        elif kind == "unknown":
            effects = (next_of("unknown", others),)
        amplitude, design = float(rng.choice(AMPLITUDES)), only or str(rng.choice(DESIGNS))
        if NO_SPRINGS & set(effects) and design == "by_current":
            design = "default"
        if any(all_effects()[e].by_length for e in effects):
            design = "by_length"
            if any(all_effects()[e].by_current for e in effects):
                design, effects, kind = "default", tuple(e for e in effects if not all_effects()[e].by_length), "one"
        if any(all_effects()[e].by_current for e in effects):
            design = "by_current"
            effects = tuple(e for e in effects if e not in NO_SPRINGS)
            kind = "one" if kind == "pair" and len(effects) == 1 else kind
        mismatch, coloured = str(rng.choice(list(MISMATCH))), bool(rng.uniform() < 0.3)
        out.append(Case(seed + k, kind, effects, amplitude, design, mismatch, coloured))
    return out


def run(case: Case, folder: Path) -> dict[str, Any]:
    """Make one set, diagnose it, keep what the table needs."""
    where = folder / f"set_{case.seed}"
    shutil.rmtree(where, ignore_errors=True)
    make_set(
        where, list(case.effects), case.amplitude, case.seed, case.design, coloured=case.coloured, mismatch=case.mismatch,
        displacement=case.seed % 3 == 0, ambient=True,
    )  # fmt: skip
    truth = json.loads((where / "truth.json").read_text())
    asked = {
        "seed": case.seed, "kind": case.kind, "true": list(case.effects), "sigmas": [e["sigmas"] for e in truth["effects"]],
        "amplitude": case.amplitude, "design": case.design, "mismatch": case.mismatch, "coloured": case.coloured,
    }  # fmt: skip
    recording = read(where)
    began = time.perf_counter()
    try:
        d = diagnose(recording, Twin.of(load("continuum")), Settings(seed=case.seed, jobs=1))
    except SolveError as error:  # no answer: wrong in every row of the table that asks for one
        return {**asked, "verdict": "no answer", "claims": [], "probability": [], "small": [], "description": str(error)}
    seconds = time.perf_counter() - began
    group = "marker"
    return {
        **asked, "verdict": d.verdict, "claims": [c.effect for c in d.claims], "probability": [c.probability for c in d.claims],
        "contribution": [c.contribution for c in d.claims], "small": [c.effect for c in d.below_materiality],
        "runners_up": [c.effect for c in d.runners_up], "ambiguous": [list(a) for a in d.ambiguous],
        "calibrated": d.errors.calibrated[group], "after": d.errors.after[group], "floor": d.errors.floor[group],
        "structure": [d.structure_before, d.structure_after, d.structure_unseen],
        "line": d.line[0], "seconds": seconds, "samples": d.bench.n_sample,
        "parameters": {c.effect: {n: [f.value, f.std] for n, f in c.parameters.items()} for c in d.claims},
        "truth": truth["effects"], "apart": _apart(truth["effects"], d), "scores": [[list(s), v] for s, v in d.scores[:5]],
        "description": d.description,
    }  # fmt: skip


def _apart(truth: list[dict], d: Diagnosis) -> dict[str, float]:
    """Relative error of the parameters of every effect that is claimed, true, and of the same law in bench and twin."""
    out = {}
    for t in truth:
        law = next((e for e in d.twin.effects if e.id == t["id"]), None)
        if law is not None and t["id"] in {c.effect for c in d.claims}:
            given: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in t["parameters"].items()}
            true, found, tolerance = COMPARED[t["id"]](all_effects()[t["id"]](**given), law.values)
            if tolerance == SAME:
                out[t["id"]] = distance(true, found)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--sets", type=int, default=300)
    parser.add_argument("--seed", type=int, default=5000)
    parser.add_argument("--design", choices=DESIGNS[2:], help="all sets of this one; default: all designs in turn")
    parser.add_argument("--jobs", type=int, default=1, help="sets diagnosed side by side, each on one core")
    parser.add_argument("--backend", choices=BACKENDS, default="loky", help="processes here, or Ray: RAY_ADDRESS, else a local one")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    log = args.out / "attribution.jsonl"
    done = {r["seed"] for r in _rows(log)}
    left = (delayed(_tried)(case, args.out) for case in plan(args.sets, args.seed, args.design) if case.seed not in done)
    with backend(args.backend, args.jobs):
        _keep(as_they_come(left, args.jobs), log)
    print(table(_rows(log)))


def _keep(rows: Iterator[dict[str, Any]], log: Path) -> None:
    """Each row is said and written as it comes."""
    for row in rows:
        if "not made" in row:
            print(f"seed {row['seed']}: not made or not readable: {row['not made']}", flush=True)
            continue
        with log.open("a") as file:
            file.write(json.dumps(row) + "\n")
        print(f"{row['seed']} {row['true']} {row['sigmas']} {row['design']} {row['mismatch']} -> {row['verdict']} {row['claims']} "
              f"({row.get('seconds', np.nan):.0f} s)", flush=True)  # fmt: skip


def _tried(case: Case, folder: Path) -> dict[str, Any]:
    """What `run` tells of the set, or why there is none."""
    try:
        return run(case, folder)
    except (DataError, NoEquilibrium) as error:
        return {"seed": case.seed, "not made": str(error)}


def _rows(log: Path) -> list[dict]:
    return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []


if __name__ == "__main__":
    main()
