"""Real rigs, before and after: python -m tools.hardware FOLDER [--out DIR] [rig ...]

FOLDER holds the raw public data, one folder a rig (tentacle, cable-tool, three-cable); each is imported,
compared and held against its bars. Reports go to DIR/<rig>.

    python -m tools.hardware FOLDER --cable-runs [--loads 20 60]

FOLDER holds, at any depth, runs of the cable tool that nothing here has seen: each tool and pose is fitted at two loads (per cent;
the nearest there are) and judged at all others.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tools.comparisons import cable_runs
from tools.comparisons.row import Row
from twin import report
from twin.errors import TwinError

RIGS = {"tentacle": "tentacle", "cable_tool": "cable-tool", "three_cable": "three-cable"}  # module -> folder of the raw data


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="raw data, one folder a rig")
    parser.add_argument("rig", nargs="*", help=f"of {', '.join(RIGS)}; default: all")
    parser.add_argument("--out", type=Path, help="folder for the reports")
    parser.add_argument(
        "--cable-runs", action="store_true", help="FOLDER holds any runs of the cable tool: fit two loads, judge the others"
    )
    parser.add_argument(
        "--loads", nargs=2, type=int, default=cable_runs.LOADS, metavar="PER_CENT", help="those fitted; default: 20 60"
    )
    asked = parser.parse_args()
    if asked.cable_runs:
        try:
            show(cable_runs.compare(asked.folder, asked.loads))
        except TwinError as error:
            parser.error(str(error))
        return
    if unknown := sorted(set(asked.rig) - set(RIGS)):
        parser.error(f"no rig {unknown[0]!r}; there are {', '.join(RIGS)}")
    lines = []
    for rig in asked.rig or RIGS:
        raw = asked.folder / RIGS[rig]
        if not raw.is_dir():
            parser.error(f"{raw} is not there; it should hold the raw data its importer names")
        rows, recording, diagnosis = importlib.import_module(f"tools.comparisons.{rig}").compare(raw)
        lines += rows
        if asked.out:
            report.write(diagnosis, asked.out / rig, report.provenance(recording, diagnosis.settings, " ".join(sys.argv)))
    show(lines)


def show(rows: Sequence[Row]) -> None:
    table = Table("what", "must", "aim", "measured", "bar")
    for row in rows:
        table.add_row(*row.cells())
    Console(width=200).print(table)


if __name__ == "__main__":
    main()
