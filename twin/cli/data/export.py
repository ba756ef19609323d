"""`twin export`: write what was measured or learnt as files of other programs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.data.export_log import export_set
from twin.cli.terminal import out
from twin.foundation.errors import DataError


@dataclass(frozen=True)
class Export:
    """Write what was measured or learnt in the formats of other programs."""

    set_or_report: Positional[Annotated[Path, arg(help="folder of a measurement set: measured, simulated or predicted")]]
    mcap: Annotated[Path | None, arg(help="new MCAP file for the set: ROS 2 messages, SI")] = None
    lerobot: Annotated[Path | None, arg(help="new folder for the set as a LeRobot v3 dataset, SI")] = None
    parquet: Annotated[Path | None, arg(help="new folder for the set with a Parquet table a trial, its own units")] = None

    rate: Annotated[
        float | None, arg(help="resample for --lerobot to this many frames a second: inputs are held, outputs interpolated")
    ] = None

    def run(self) -> None:
        written = export_set(self.set_or_report, {"mcap": self.mcap, "lerobot": self.lerobot, "parquet": self.parquet}, self.rate)
        if not written:
            raise DataError(
                "nothing to write; give a format with its target, such as --mcap FILE, --lerobot FOLDER or --parquet FOLDER"
            )
        for path in written:
            out.print(f"written: {path}", highlight=False, markup=False)
