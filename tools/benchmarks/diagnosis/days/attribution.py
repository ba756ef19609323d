"""Does the diagnosis name the right effect? Fresh sets of the independent rod simulator, diagnosed one by one, scored and tabled.

    python -m tools.benchmarks.diagnosis.days.attribution --out results/ [--sets 300] [--seed 5000] [--jobs 2] [--backend ray]

Of the sets 15 % have no effect, 55 % one (all in turn), 15 % two, 15 % one that is not in the catalogue. Amplitudes are 1, 3 or 8
sigma (marker noise, left after refitting the robot's own parameters); the robot is as described ("exact"), within its tolerances
("built"), or half again as far and with a soft spot and a slight helix that no parameter spans ("rough": some 0.1 sigma). Designs,
mounts, instruments and what drives the tendons are drawn. Results go to results/attribution.jsonl as they come, so an interrupted
run resumes. An effect counts as named if it, or one of its class (effects such data hardly tell apart), is claimed with the largest
contribution.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from joblib import delayed

from tools.benchmarks import cluster
from tools.benchmarks.diagnosis.answer import answer
from tools.benchmarks.diagnosis.compared import COMPARED, SAME_LAW, distance
from tools.benchmarks.diagnosis.days.attribution_table import table
from tools.benchmarks.table import Row, kept_rows
from tools.simulators.rod.day import MISMATCH, Recipe, make_set
from tools.simulators.rod.effects import all_effects
from tools.simulators.rod.mechanics.rod import NoEquilibrium
from twin.diagnosis import Diagnosis
from twin.effects import catalogue
from twin.foundation.errors import DataError

AMPLITUDES = (1.0, 3.0, 8.0)
DRAWN_DESIGNS = ("default", "default", "default", "mixed", "sideways", "hanging", "by_length", "by_current")
SET_KINDS = ("none", "one", "one", "one", "pair", "unknown", "one", "none", "one", "one", "one", "one", "pair", "unknown",
         "one", "one", "one", "pair", "unknown", "none")  # fmt: skip
# not simulated where springs pull
NO_SPRINGS = {"actuator_saturation", "actuator_lag", "tendon_backlash", "backbone_creep", "tendon_elasticity"}


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

    def recipe(self) -> Recipe:
        """Return what the simulator makes the set by."""
        lengths = self.seed % 3 == 0
        return Recipe(self.effects, self.amplitude, self.seed, self.design, lengths, True, self.coloured, self.mismatch)


def plan(sets: int, seed: int, only: str | None = None) -> list[Case]:
    """The sets in the order they are run: any first part of it is a fair sample of the whole. With `only`, all of one design, and
    of the effects those that act there."""
    rng = np.random.default_rng(seed)
    named = sorted(set(catalogue()) & set(all_effects()))  # fingers and jaws are not on this bench
    if only is not None:
        named = [n for n in named if only == "by_current" or not all_effects()[n].driven_by_current]
        named = [n for n in named if only == "by_length" or not all_effects()[n].driven_by_length]
    others = sorted(n for n, e in all_effects().items() if not e.in_catalogue)
    turn: dict[str, list[str]] = {"one": [], "unknown": []}

    def next_of(kind: str, names: list[str]) -> str:
        if not turn[kind]:
            turn[kind] = [str(n) for n in rng.permutation(names)]
        return turn[kind].pop()

    out = []
    for k in range(sets):
        kind = SET_KINDS[k % len(SET_KINDS)]
        effects: tuple[str, ...] = ()
        if kind == "one":
            effects = (next_of("one", named),)
        elif kind == "pair":
            effects = tuple(str(n) for n in rng.choice(named, 2, replace=False))
        elif kind == "unknown":
            effects = (next_of("unknown", others),)
        amplitude, design = float(rng.choice(AMPLITUDES)), only or str(rng.choice(DRAWN_DESIGNS))
        if NO_SPRINGS & set(effects) and design == "by_current":
            design = "default"
        if any(all_effects()[e].driven_by_length for e in effects):
            design = "by_length"
            if any(all_effects()[e].driven_by_current for e in effects):
                design, effects, kind = "default", tuple(e for e in effects if not all_effects()[e].driven_by_length), "one"
        if any(all_effects()[e].driven_by_current for e in effects):
            design = "by_current"
            effects = tuple(e for e in effects if e not in NO_SPRINGS)
            kind = "one" if kind == "pair" and len(effects) == 1 else kind
        mismatch, coloured = str(rng.choice(list(MISMATCH))), bool(rng.uniform() < 0.3)
        out.append(Case(seed + k, kind, effects, amplitude, design, mismatch, coloured))
    return out


def run(case: Case, folder: Path) -> Row:
    """Make one set, diagnose it, and return what the table needs, or why there is none."""
    told: Row = {key: value for key, value in asdict(case).items() if key != "effects"}
    where = folder / f"set_{case.seed}"
    shutil.rmtree(where, ignore_errors=True)
    try:
        make_set(where, case.recipe())
        truth = json.loads((where / "truth.json").read_text())["effects"]
        row, d = answer(where, case.seed)
    except (DataError, NoEquilibrium) as error:
        return {**told, "not made": str(error)}
    if d is not None:
        row |= {"truth": truth, "apart": _apart(truth, d)}
    return {**told, "true": list(case.effects), "sigmas": [e["sigmas"] for e in truth], **row}


def _apart(truth: list[dict], d: Diagnosis) -> dict[str, float]:
    """Return the relative error of the parameters of each effect that is claimed, true, and has one law in simulator and twin."""
    out = {}
    for t in truth:
        law = next((e for e in d.twin.effects if e.id == t["id"]), None)
        if law is not None and t["id"] in {c.effect for c in d.claims}:
            given: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in t["parameters"].items()}
            true, found, tolerance = COMPARED[t["id"]](all_effects()[t["id"]](**given), law.values)
            if tolerance == SAME_LAW:
                out[t["id"]] = distance(true, found)
    return out


def main(
    out: Path,
    sets: int = 300,
    seed: int = 5000,
    design: Literal["mixed", "sideways", "hanging", "by_length", "by_current", "default"] | None = None,
    jobs: int = 1,
    backend: cluster.Backend = "loky",
) -> None:
    """Make, diagnose and score fresh sets of the independent rod simulator.

    Args:
        out: folder of the sets and of attribution.jsonl
        design: all sets of this one; default: all designs in turn
        jobs: sets diagnosed side by side, each on one core
        backend: processes here, or Ray: RAY_ADDRESS, else a local one
    """
    work = {case.seed: delayed(run)(case, out) for case in plan(sets, seed, design)}

    def told(row: Row) -> str:
        if "not made" in row:
            return f"seed {row['seed']}: not made or not readable: {row['not made']}"
        said = f"{row['verdict']} {row['claims']} ({row.get('seconds', np.nan):.0f} s)"
        return f"{row['seed']} {row['true']} {row['sigmas']} {row['design']} {row['mismatch']} -> {said}"

    with cluster.backend(backend, jobs):
        rows = kept_rows(out / "attribution.jsonl", work, jobs, told)
    print(table([r for r in rows if "not made" not in r]))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
