"""python -m tools.importers RIG RAW_FOLDER OUT: raw data of a published rig as a measurement set."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from twin.measurements import write


def main(rig: str, raw: str, out: str) -> None:
    recording, dropped = importlib.import_module(f"tools.importers.{rig}").read(Path(raw))
    write(recording, Path(out))
    print(f"{recording.title}: {len(recording.trials)} trials, {recording.n_samples} rows\n{dropped}")
    print("\n".join(recording.notices))


if __name__ == "__main__":
    main(*sys.argv[1:])
