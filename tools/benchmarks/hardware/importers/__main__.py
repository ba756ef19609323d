"""Write raw data of a published rig as a measurement set:  python -m tools.benchmarks.hardware.importers RIG RAW_FOLDER OUT"""

import importlib
from pathlib import Path
from typing import Literal

import tyro

from twin.measurements import write

Rig = Literal["tentacle", "cable_tool", "three_cable"]


def main(rig: tyro.conf.Positional[Rig], raw: tyro.conf.Positional[Path], out: tyro.conf.Positional[Path]) -> None:
    """Import one rig."""
    recording, dropped = importlib.import_module(f"tools.benchmarks.hardware.importers.{rig}").read(raw)
    write(recording, out)
    print(f"{recording.title}: {len(recording.trials)} trials, {recording.n_samples} rows\n{dropped}")
    print("\n".join(recording.notices))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
