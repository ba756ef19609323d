"""Real rigs, before and after: python -m tools.hardware FOLDER [--out DIR] [rig ...]

FOLDER holds the raw public data, one folder a rig (tentacle, cable-tool, three-cable); each is imported,
compared and held against its bars. Reports go to DIR/<rig>.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from twin import report

RIGS = {"tentacle": "tentacle", "cable_tool": "cable-tool", "three_cable": "three-cable"}  # module -> folder of the raw data


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="raw data, one folder a rig")
    parser.add_argument("rig", nargs="*", help=f"of {', '.join(RIGS)}; default: all")
    parser.add_argument("--out", type=Path, help="folder for the reports")
    asked = parser.parse_args()
    if unknown := sorted(set(asked.rig) - set(RIGS)):
        parser.error(f"no rig {unknown[0]!r}; there are {', '.join(RIGS)}")
    table = Table("what", "must", "aim", "measured", "bar")
    for rig in asked.rig or RIGS:
        raw = asked.folder / RIGS[rig]
        if not raw.is_dir():
            parser.error(f"{raw} is not there; it should hold the raw data its importer names")
        rows, recording, diagnosis = importlib.import_module(f"tools.comparisons.{rig}").compare(raw)
        for row in rows:
            table.add_row(*row.cells())
        if asked.out:
            report.write(diagnosis, asked.out / rig, report.provenance(recording, diagnosis.settings, " ".join(sys.argv)))
    Console(width=200).print(table)


if __name__ == "__main__":
    main()
