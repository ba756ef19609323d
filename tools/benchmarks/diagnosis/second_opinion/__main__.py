"""Second opinions on sets that the attribution benchmark has made and diagnosed.

    python -m tools.benchmarks.diagnosis.second_opinion RESULTS

Reads RESULTS/set_*/ and RESULTS/attribution.jsonl (the diagnosis's answers); writes second_opinion.jsonl beside it, or to --out, as
the answers come, so that an interrupted run resumes. Needs pip install ".[second-opinion]".
"""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import tyro

from tools.benchmarks.diagnosis.attribution_table import flagged, made
from tools.benchmarks.diagnosis.second_opinion.start import Calibrated, Opinion
from tools.benchmarks.diagnosis.second_opinion.table import table
from tools.benchmarks.table import append_row, read_rows
from twin.diagnosis import Settings
from twin.foundation.errors import TwinError
from twin.measurements import read
from twin.prediction.twin import Twin


def opinion_functions() -> dict[str, Callable[[Calibrated], Opinion]]:
    """Return the opinions by name; their libraries are imported here."""
    from tools.benchmarks.diagnosis.second_opinion.bound_hit import bound_hit
    from tools.benchmarks.diagnosis.second_opinion.forward_bic import forward_bic
    from tools.benchmarks.diagnosis.second_opinion.sparse_regression import sparse_regression

    return {"bound hit": bound_hit, "forward BIC": forward_bic, "sparse regression": sparse_regression}


def opinions(folder: Path, seed: int) -> dict[str, dict]:
    """Return each opinion on one set as a row of the table; seconds include the calibration they share."""
    began = time.perf_counter()
    start = Calibrated.of(read(folder), Twin.of("continuum"), Settings(seed=seed))
    shared = time.perf_counter() - began
    out = {}
    for name, opinion in opinion_functions().items():
        began = time.perf_counter()
        found = opinion(start)
        seconds = shared + time.perf_counter() - began
        silent = found.missing and not found.named
        after = start.held_out(found.twin)
        out[name] = {"missing": found.missing, "named": found.named, "flagged": silent, "after": after, "seconds": seconds}
    return out


def ours(row: dict) -> dict:
    """Return the diagnosis's own answer in the same form."""
    missing = bool(row["claims"]) or row["verdict"] == "unexplained"
    return {"missing": missing, "named": row["claims"], "flagged": flagged(row), "after": row["after"], "seconds": row["seconds"]}


def main(results: tyro.conf.Positional[Path], out: Path | None = None) -> None:
    """Ask all opinions about every set that has no answers yet, and print the table.

    Args:
        results: the --out folder of tools.benchmarks.diagnosis.attribution
        out: where the answers go (RESULTS/second_opinion.jsonl)
    """
    log = out or results / "second_opinion.jsonl"
    rows = read_rows(log)
    done = {r["seed"] for r in rows}
    logging.getLogger("absl").setLevel(logging.ERROR)  # sysid warns of starts at a bound, where an effect that is OFF stands
    warnings.filterwarnings("ignore", "Sparsity parameter is too big")  # pysindy's way to say that no term is needed
    for diagnosed in read_rows(results / "attribution.jsonl"):
        seed = diagnosed["seed"]
        if seed in done or not made(diagnosed):
            continue
        try:
            answers = {"diagnosis": ours(diagnosed), **opinions(results / f"set_{seed}", seed)}
        except (TwinError, OSError) as error:
            print(f"seed {seed}: {error}", flush=True)
            continue
        rows.append({k: diagnosed[k] for k in ("seed", "true", "floor", "calibrated")} | {"answers": answers})
        append_row(log, rows[-1])
        said = "; ".join(f"{n}: {list(a['named']) or a['missing']} ({a['seconds']:.0f} s)" for n, a in answers.items())
        print(f"seed {seed} {diagnosed['true']} -> {said}", flush=True)
    print(table(rows))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
