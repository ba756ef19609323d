"""Second opinions on sets that tools/attribution.py has made and diagnosed:  python -m tools.second_opinion RESULTS

Reads RESULTS/set_*/ and RESULTS/attribution.jsonl (our own answers, keyed by seed); writes second_opinion.jsonl beside it, or to
--out, as the answers come, so that an interrupted run resumes. Needs pip install ".[second-opinion]".
"""

from __future__ import annotations

import argparse
import json
import logging
import time
import warnings
from collections.abc import Callable
from pathlib import Path

from tools.attribution_table import flagged, made
from tools.second_opinion.bound_hit import bound_hit
from tools.second_opinion.forward_bic import forward_bic
from tools.second_opinion.sparse_regression import sparse_regression
from tools.second_opinion.start import Calibrated, Opinion
from tools.second_opinion.table import table
from twin.diagnose import Settings
from twin.errors import TwinError
from twin.measurements import read
from twin.twin import Twin

OPINIONS: dict[str, Callable[[Calibrated], Opinion]] = {
    "bound hit": bound_hit, "forward BIC": forward_bic, "sparse regression": sparse_regression,
}  # fmt: skip


def opinions(folder: Path, seed: int) -> dict[str, dict]:
    """Each opinion on one set as a row of the table; seconds include the calibration they share."""
    began = time.perf_counter()
    start = Calibrated.of(read(folder), Twin.of("continuum"), Settings(seed=seed))
    shared = time.perf_counter() - began
    out = {}
    for name, opinion in OPINIONS.items():
        began = time.perf_counter()
        found = opinion(start)
        seconds = shared + time.perf_counter() - began
        silent = found.missing and not found.named
        after = start.held_out(found.twin)
        out[name] = {"missing": found.missing, "named": found.named, "flagged": silent, "after": after, "seconds": seconds}
    return out


def ours(row: dict) -> dict:
    """The diagnosis's own answer in the same form."""
    missing = bool(row["claims"]) or row["verdict"] == "unexplained"
    return {"missing": missing, "named": row["claims"], "flagged": flagged(row), "after": row["after"], "seconds": row["seconds"]}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.second_opinion", description=__doc__)
    parser.add_argument("results", type=Path, help="the --out folder of tools/attribution.py")
    parser.add_argument("--out", type=Path, help="where the answers go (RESULTS/second_opinion.jsonl)")
    args = parser.parse_args()
    log = args.out or args.results / "second_opinion.jsonl"
    rows = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
    done = {r["seed"] for r in rows}
    logging.getLogger("absl").setLevel(logging.ERROR)  # sysid warns of starts at a bound, where an effect that is OFF stands
    warnings.filterwarnings("ignore", "Sparsity parameter is too big")  # pysindy's way to say that no term is needed
    for line in (args.results / "attribution.jsonl").read_text().splitlines():
        diagnosed = json.loads(line)
        seed = diagnosed["seed"]
        if seed in done or not made(diagnosed):
            continue
        try:
            answers = opinions(args.results / f"set_{seed}", seed)
        except (TwinError, OSError) as error:
            print(f"seed {seed}: {error}", flush=True)
            continue
        answers = {"diagnosis": ours(diagnosed), **answers}
        rows.append({k: diagnosed[k] for k in ("seed", "true", "floor", "calibrated")} | {"answers": answers})
        with log.open("a") as file:
            file.write(json.dumps(rows[-1]) + "\n")
        said = "; ".join(f"{n}: {list(a['named']) or a['missing']} ({a['seconds']:.0f} s)" for n, a in answers.items())
        print(f"seed {seed} {diagnosed['true']} -> {said}", flush=True)
    print(table(rows))


main()
