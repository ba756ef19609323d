"""Real rigs, before and after: python -m tools.benchmarks.hardware.run FOLDER [--out DIR] [rig ...]

FOLDER holds the raw public data, one folder a rig (tentacle, cable-tool, three-cable); each is imported,
compared and held against its bars. Reports go to DIR/<rig>.

    python -m tools.benchmarks.hardware.run FOLDER --cable-runs [--loads 20 60]

FOLDER holds, at any depth, runs of the cable tool that nothing here has seen: each tool and pose is fitted at two loads (per cent;
the nearest there are) and judged at all others.
"""

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

import tyro

from tools.benchmarks.hardware.comparisons.cable_runs import FITTED_PERCENTS, compare
from tools.benchmarks.hardware.comparisons.row import Row
from tools.benchmarks.table import markdown
from twin import report
from twin.foundation.errors import DataError, TwinError

RIGS = {"tentacle": "tentacle", "cable_tool": "cable-tool", "three_cable": "three-cable"}  # module -> folder of the raw data


def main(
    folder: tyro.conf.Positional[Path],
    rigs: tyro.conf.Positional[tuple[str, ...]] = tuple(RIGS),
    out: Path | None = None,
    cable_runs: bool = False,
    loads: tuple[int, int] = FITTED_PERCENTS,
) -> None:
    """Import and compare rigs, or judge any runs of the cable tool.

    Args:
        folder: raw data, one folder a rig
        out: folder for the reports
        cable_runs: the folder holds any runs of the cable tool: fit two loads, judge the others
        loads: those fitted, per cent
    """
    try:
        show(compare(folder, loads) if cable_runs else [row for rig in rigs for row in judge(folder, rig, out)])
    except TwinError as error:
        sys.exit(str(error))


def judge(folder: Path, rig: str, out: Path | None) -> list[Row]:
    """Return the rows of one rig, and write its report. Raises DataError for a rig that is not known or has no data."""
    if rig not in RIGS:
        raise DataError(f"no rig {rig!r}; there are {', '.join(RIGS)}")
    raw = folder / RIGS[rig]
    if not raw.is_dir():
        raise DataError(f"{raw} is not there; it should hold the raw data its importer names")
    rows, recording, diagnosis = importlib.import_module(f"tools.benchmarks.hardware.comparisons.{rig}").compare(raw)
    if out:
        report.write(diagnosis, out / rig, report.provenance(recording, diagnosis.settings, " ".join(sys.argv)))
    return rows


def show(rows: Sequence[Row]) -> None:
    """Print the table."""
    print(markdown(("what", "must", "aim", "measured", "bar"), [row.cells() for row in rows]))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
