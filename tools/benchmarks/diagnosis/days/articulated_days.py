"""Does the diagnosis name the right effect on robots with an MJCF? Fresh days of tools/simulators/articulated, scored and tabled.

    python -m tools.benchmarks.diagnosis.days.articulated_days --out results/ [--sets 48] [--seed 42000] [--jobs 2]

A tendon-driven finger, a servo arm and a leg take turns. Of the days an eighth has no effect, half one, a quarter two, an eighth
one in no catalogue. Errors are on the holdout folder, which no diagnosis reads: of each channel over the noise that is in it.
Rows go to results/articulated_days.jsonl as they come; a run goes on where it stopped.
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import numpy as np
import tyro
from joblib import delayed

from tools.benchmarks.diagnosis.answer import in_words, no_answer
from tools.benchmarks.diagnosis.days.attribution_table import exact, false_positive, first, flagged, right
from tools.benchmarks.table import Row, kept_rows, markdown, share
from tools.simulators.articulated.day import Recipe, make_set
from tools.simulators.articulated.drives import all_effects
from tools.simulators.articulated.robots import ROBOTS
from twin.diagnosis import Settings, diagnose
from twin.foundation.errors import TwinError
from twin.measurements import read
from twin.prediction.evaluate import evaluate
from twin.prediction.twin import Twin

KINDS = ("one", "none", "one", "pair", "one", "unknown", "one", "pair")
LEVELS = (1.0, 3.0, 8.0)


def plan(sets: int, seed: int) -> list[tuple[str, Recipe]]:
    """Return the kind and the recipe of each day, in the order they are run; a robot's effects come in turn."""
    rng, out = np.random.default_rng(seed), list[tuple[str, Recipe]]()
    turn: dict[tuple[str, bool], list[str]] = {}
    for robot in ROBOTS:
        for known in (True, False):
            fitting = [n for n, e in all_effects().items() if e.in_catalogue is known and e.fits(ROBOTS[robot]())]
            turn[robot, known] = [str(n) for _ in range(sets) for n in rng.permutation(fitting)]
    for k in range(sets):
        robot, kind = list(ROBOTS)[k % len(ROBOTS)], KINDS[(k // len(ROBOTS)) % len(KINDS)]
        count = {"none": 0, "one": 1, "unknown": 1, "pair": 2}[kind]
        effects = tuple(turn[robot, kind != "unknown"].pop() for _ in range(count))
        if len(set(effects)) < count:
            effects, kind = effects[:1], "one"
        out.append((kind, Recipe(robot, effects, float(rng.choice(LEVELS)), seed + k)))
    return out


def run(kind: str, recipe: Recipe, folder: Path) -> Row:
    """Make one day, diagnose its measured trials, and judge the twin on the others."""
    where = folder / f"day_{recipe.seed}"
    shutil.rmtree(where, ignore_errors=True)
    truth = make_set(where, recipe)
    told: Row = {"seed": recipe.seed, "kind": kind, "robot": recipe.robot, "asked": recipe.level, "true": list(recipe.effects)}
    told |= {"sigmas": [truth["level_alone"][e] for e in recipe.effects], "rate": truth["rate"], "flags": truth["flags"]}
    recording = read(where / "measured")
    began = time.perf_counter()
    try:
        d = diagnose(recording, Twin.of_recording(recording), Settings(seed=recipe.seed, jobs=1))
    except TwinError as error:
        return {**told, **no_answer(error)}
    told["seconds"] = time.perf_counter() - began
    holdout, floor = read(where / "holdout"), truth["floor_by_channel"]
    over = {}
    for name, twin in (("calibrated", d.calibrated), ("after", d.twin)):
        channels = evaluate(twin, holdout)["by_channel"]
        over[name] = float(np.sqrt(np.mean([(c["rmse"] / floor[n]) ** 2 for n, c in channels.items() if floor[n] > 0.0])))
    return {
        **told, "verdict": d.verdict, "claims": [c.effect for c in d.claims], "probability": [c.probability for c in d.claims],
        "small": [c.effect for c in d.below_materiality], "ambiguous": [list(a) for a in d.ambiguous], "over_floor": over,
        "caveats": list(d.caveats), "description": d.description, "scores": [[list(s), v] for s, v in d.scores[:5]],
    }  # fmt: skip


def table(rows: list[Row]) -> str:
    """Return the shares by robot, and every day that went wrong."""
    lines: list[list[object]] = []
    for robot in (*ROBOTS, "all"):
        mine = [r for r in rows if robot in (r["robot"], "all")]
        of = {kind: [r for r in mine if r["kind"] == kind] for kind in ("none", "one", "pair", "unknown")}
        known = [r["over_floor"]["after"] for r in (*of["one"], *of["pair"]) if "over_floor" in r]
        wrong = [r["verdict"] == "explained" and not all(right(r, c) for c in r["claims"]) for r in mine]
        seconds = [r["seconds"] for r in mine if "seconds" in r]
        over = "/".join(f"{q:.2f}" for q in np.quantile(known, [0.5, 0.9])) if known else ""
        shares = [[false_positive(r) for r in of["none"]], [first(r) for r in of["one"]], [exact(r) for r in of["one"]]]
        shares += [[first(r) for r in of["pair"]], [exact(r) for r in of["pair"]], [flagged(r) for r in of["unknown"]], wrong]
        took = f"{np.median(seconds):.0f} / {np.max(seconds):.0f}" if seconds else ""
        lines.append([robot, *(share(s) for s in shares), over, took])
    head = ["robot", "false", "one first", "one exact", "pair first", "pair exact", "unknown flagged", "wrong without a flag"]
    bad = [r for r in rows if (not flagged(r) if r["kind"] == "unknown" else not exact(r))]
    told = [f"  {r['seed']} {r['robot']}: {r['true']} {[round(s, 1) for s in r['sigmas']]} -> {in_words(r)}" for r in bad]
    return "\n".join([markdown([*head, "held out / floor, median/90 %", "seconds, median / most"], lines), "", *told])


def main(out: Path, sets: int = 48, seed: int = 42000, jobs: int = 1) -> None:
    """Make, diagnose and score fresh days of articulated robots.

    Args:
        out: folder of the days and of articulated_days.jsonl
        jobs: days side by side, each on one core
    """
    work = {recipe.seed: delayed(run)(kind, recipe, out) for kind, recipe in plan(sets, seed)}

    def told(row: Row) -> str:
        said = f"-> {in_words(row)} {row.get('over_floor')} ({row.get('seconds', np.nan):.0f} s)"
        return f"{row['seed']} {row['robot']} {row['true']} {[round(s, 1) for s in row['sigmas']]} {said}"

    print(table(kept_rows(out / "articulated_days.jsonl", work, jobs, told)))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
