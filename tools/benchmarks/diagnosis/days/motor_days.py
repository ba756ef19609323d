"""Does the diagnosis name the right effect on robots that motors drive? Fresh days of tools/simulators/motor_rod, scored.

    python -m tools.benchmarks.diagnosis.days.motor_days --out results/ [--sets 40] [--seed 41000] [--jobs 2]

Zeros, pretensions, spools and springs in series differ from their description within its tolerances; antagonistic pairs and motors
that each wind one tendon take turns, and half of the days log the motors' torques. Of the days a quarter has no effect, half one,
an eighth two, and an eighth one in no catalogue. Rows go to results/motor_days.jsonl as they come; a run goes on where it
stopped.
"""

from __future__ import annotations

import shutil
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import tyro
from joblib import delayed

from tools.benchmarks.diagnosis.answer import answer
from tools.benchmarks.diagnosis.days.attribution_table import table
from tools.benchmarks.table import Row, kept_rows
from tools.simulators.motor_rod.day import MotorRecipe, make_motor_day, possible_effects, truth_of
from tools.simulators.motor_rod.drives import WINDINGS
from tools.simulators.rod.day import MISMATCH
from tools.simulators.rod.effects import all_effects
from tools.simulators.rod.mechanics.rod import NoEquilibrium
from twin.foundation.errors import DataError

KINDS = ("none", "one", "one", "pair", "one", "unknown", "one", "none")
SIZES = (1.0, 3.0, 8.0)


def plan(sets: int, seed: int) -> list[tuple[str, MotorRecipe]]:
    """Return the kind and the recipe of each day, in the order they are run; named effects come in turn."""
    rng = np.random.default_rng(seed)
    known = {True: [], False: []}
    for name in possible_effects():
        known[all_effects()[name].in_catalogue].append(name)
    turn = {flag: [str(n) for _ in range(sets) for n in rng.permutation(names)] for flag, names in known.items()}
    out = []
    for k in range(sets):
        kind = KINDS[k % len(KINDS)]
        count = {"none": 0, "one": 1, "unknown": 1, "pair": 2}[kind]
        effects = tuple(turn[kind != "unknown"].pop() for _ in range(count))
        if len(set(effects)) < count:
            effects, kind = effects[:1], "one"
        winding, mismatch = list(WINDINGS)[k % 2], str(rng.choice(list(MISMATCH)))
        out.append((kind, MotorRecipe(effects, float(rng.choice(SIZES)), seed + k, winding, bool(rng.integers(2)), mismatch)))
    return out


def run(kind: str, recipe: MotorRecipe, folder: Path) -> Row:
    """Make one day, diagnose it, and return what the table needs."""
    where = folder / f"day_{recipe.seed}"
    shutil.rmtree(where, ignore_errors=True)
    told: Row = {"seed": recipe.seed, "kind": kind, "design": recipe.winding, "mismatch": recipe.mismatch}
    try:
        sigmas = [size for _, size in make_motor_day(where, recipe)]
        row, _ = answer(where, recipe.seed)
    except (DataError, NoEquilibrium) as error:
        return {**told, "not made": str(error)}
    told |= {"amplitude": recipe.amplitude, "true": list(recipe.effects), "sigmas": sigmas, "truth": truth_of(where)}
    return {**told, **row, "recipe": asdict(replace(recipe, effects=()))}


def main(out: Path, sets: int = 40, seed: int = 41000, jobs: int = 1) -> None:
    """Make, diagnose and score fresh days of a rod with motors.

    Args:
        out: folder of the days and of motor_days.jsonl
        jobs: days side by side, each on one core
    """
    work = {recipe.seed: delayed(run)(kind, recipe, out) for kind, recipe in plan(sets, seed)}

    def told(row: Row) -> str:
        said = row.get("not made") or f"{row['sigmas']} -> {row['verdict']} {row['claims']} ({row.get('seconds', np.nan):.0f} s)"
        return f"{row['seed']} {row.get('true')} {row['design']} {row['mismatch']} {said}"

    print(table([r for r in kept_rows(out / "motor_days.jsonl", work, jobs, told) if "not made" not in r]))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
