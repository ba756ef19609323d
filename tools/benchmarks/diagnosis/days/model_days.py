"""Does a stranger's model get the right answer? Three MJCF that nobody tuned to, plain MuJoCo as the robot, one effect a day.

    python -m tools.benchmarks.diagnosis.days.model_days --out results/ [--models servo_arm] [--effects none] [--jobs 2]

Each day is a folder as `twin new --mjcf` writes it, its log filled by `tools.simulators.plain_mujoco`, and diagnosed. Rows go to
results/model_days.jsonl as they come; a run goes on where it stopped.
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import tyro
from joblib import delayed

from tools.benchmarks.diagnosis.answer import in_words, no_answer
from tools.benchmarks.table import Row, kept_rows, share
from tools.simulators.plain_mujoco.day import EFFECTS, HERE, MODELS, write_log
from twin.diagnosis import Settings, diagnose
from twin.foundation.errors import TwinError
from twin.measurements import read
from twin.prediction.evaluate import headline_group
from twin.robots.starter import write_model_starter


def run(model: str, effect: str, folder: Path, seed: int) -> Row:
    """Make one day, and return its answer."""
    where = folder / f"{model}_{effect}"
    shutil.rmtree(where, ignore_errors=True)
    write_model_starter(where.name, HERE / f"{model}.xml", folder)
    write_log(model, effect, where, seed)
    row: Row = {"day": f"{model} {effect}", "model": model, "effect": effect}
    began = time.perf_counter()
    try:
        found = diagnose(read(where / "samples/first"), settings=Settings(seed=seed, jobs=1))
    except TwinError as error:
        return {**row, **no_answer(error)}
    headline = headline_group(o.group for o in found.prepared.outputs)
    after, floor = found.errors.after[headline], found.errors.floor[headline]
    claims = {c.effect: {n: v.value for n, v in c.parameters.items()} for c in found.claims}
    took = time.perf_counter() - began
    return {**row, "verdict": found.verdict, "claims": list(claims), "values": claims, "over_floor": after / floor, "seconds": took}


def right(row: Row) -> bool:
    """Return whether nothing is claimed of a robot without an effect, or its effect comes first."""
    return row["claims"][:1] == ([] if row["effect"] == "none" else [row["effect"]])


def main(
    out: Path, models: tuple[str, ...] = tuple(MODELS), effects: tuple[str, ...] = tuple(EFFECTS), seed: int = 5, jobs: int = 1
) -> None:
    """Make, diagnose and score.

    Args:
        out: folder of model_days.jsonl
        jobs: days side by side, each on one core
    """
    work = {f"{m} {e}": delayed(run)(m, e, out, seed) for m in models for e in effects}
    rows = kept_rows(out / "model_days.jsonl", work, jobs, lambda row: f"{row['day']}: {in_words(row)}")
    print("false", share([not right(r) for r in rows if r["effect"] == "none"]))
    print("right first", share([right(r) for r in rows if r["effect"] != "none"]))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
