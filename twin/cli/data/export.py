"""`twin export`: write a measurement set in the formats of other programs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.terminal import out
from twin.foundation.errors import DataError


@dataclass(frozen=True)
class Export:
    """Write a measurement set, measured, simulated or predicted, in the formats of other programs; values in SI."""

    set: Positional[Annotated[Path, arg(help="folder of a measurement set")]]
    mcap: Annotated[Path | None, arg(help="new MCAP file of ROS 2 messages")] = None
    lerobot: Annotated[Path | None, arg(help="new folder of a LeRobot v3 dataset")] = None
    parquet: Annotated[Path | None, arg(help="new folder of the set with a Parquet table a trial")] = None

    def run(self) -> None:
        from twin.measurements import read
        from twin.measurements.logs.export import write_lerobot, write_mcap, write_parquet

        asked = {write_mcap: self.mcap, write_lerobot: self.lerobot, write_parquet: self.parquet}
        if not any(asked.values()):
            raise DataError("nothing to write; give --mcap FILE, --lerobot FOLDER or --parquet FOLDER")
        recording = read(self.set, least_trials=1)
        for write, target in asked.items():
            if target is not None:
                write(recording, target)
                out.print(f"written: {target}", highlight=False, markup=False)
