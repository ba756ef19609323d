"""`twin export`: write a twin as files of other programs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.terminal import out
from twin.foundation.errors import DataError


@dataclass(frozen=True)
class Export:
    """Write what was measured or learnt in the formats of other programs."""

    set_or_report: Positional[Annotated[Path, arg(help="a report's folder, a twin.toml, or the folder of a robot")]]
    mjcf: Annotated[Path | None, arg(help="new folder for the twin as a better MJCF (robots of family mjcf)")] = None

    def run(self) -> None:
        if self.mjcf is None:
            raise DataError("nothing to write; give a format with its folder, such as --mjcf better")
        written = export_model(self.set_or_report, self.mjcf)
        out.print(f"model: {written}", highlight=False, markup=False)


def export_model(source: Path, folder: Path) -> Path:
    """Write the twin of a report, a twin.toml or a robot's folder as an MJCF to `folder`; return the file."""
    from twin.prediction.mjcf import origins_of, write_mjcf
    from twin.prediction.storage import read_twin

    return write_mjcf(read_twin(str(source)), folder, origins_of(source))
