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

    set_or_report: Positional[
        Annotated[
            Path, arg(help="folder of a measurement set; for --mjcf a report's folder, a twin.toml, a robot's name or folder")
        ]
    ]
    mcap: Annotated[Path | None, arg(help="new MCAP file for the set: ROS 2 messages, SI")] = None
    lerobot: Annotated[Path | None, arg(help="new folder for the set as a LeRobot v3 dataset, SI")] = None
    parquet: Annotated[Path | None, arg(help="new folder for the set with a Parquet table a trial, its own units")] = None
    mjcf: Annotated[Path | None, arg(help="new folder for the twin as an MJCF (families mjcf and continuum)")] = None
    rate: Annotated[
        float | None, arg(help="resample for --lerobot to this many frames a second: inputs are held, outputs interpolated")
    ] = None

    def run(self) -> None:
        written = export_set(self.set_or_report, {"mcap": self.mcap, "lerobot": self.lerobot, "parquet": self.parquet}, self.rate)
        if self.mjcf is not None:
            written = [*written, export_model(self.set_or_report, self.mjcf)]
        if not written:
            raise DataError(
                "nothing to write; give a format with its target: --mcap FILE, --lerobot FOLDER, --parquet FOLDER or --mjcf FOLDER"
            )
        for path in written:
            out.print(f"written: {path}", highlight=False, markup=False)


def export_model(source: Path, folder: Path) -> Path:
    """Write the twin of a report, a twin.toml or a robot's folder as an MJCF to `folder`; return the file."""
    from twin.prediction.mjcf import origins_of, write_mjcf
    from twin.prediction.twin_file.storage import read_twin

    return write_mjcf(read_twin(str(source)), folder, origins_of(source))
