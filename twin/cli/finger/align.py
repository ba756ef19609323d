"""`twin align`: align a soft finger's twin to a built finger."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.sources import load_finger_set
from twin.cli.terminal import command_line, out, show_progress
from twin.foundation.errors import DataError


@dataclass(frozen=True)
class Align:
    """Align a soft finger's twin to a built finger: mounting angle, and R0 and kappa of the strain sensors, from clouds.

    Writes twin.toml, alignment.json and alignment.txt.
    """

    out: Annotated[Path, arg(help="folder for the aligned twin")]
    set: Positional[
        Annotated[
            Path | None,
            arg(help="folder of a measurement set with clouds and at least one trial without a hand; default: the bundled day"),
        ]
    ] = None
    twin: Annotated[str | None, arg(help="start: a twin.toml or a robot's name; default: the robot named in the set")] = None

    def run(self) -> None:
        from twin import report
        from twin.diagnosis import Settings
        from twin.shape.alignment.report import alignment_lines, write_alignment

        recording, twin = load_finger_set(self.set, self.twin)
        from twin.shape.alignment.align import align

        if self.out.exists() and not self.out.is_dir():
            raise DataError(f"{self.out} is a file; give a folder for the aligned twin with --out")
        with show_progress(f"aligning to {recording.title}") as progress:
            aligned = align(recording, twin, progress)
            write_alignment(aligned, self.out, report.provenance(recording, Settings(), command_line()))
        out.print("\n".join(alignment_lines(aligned)), highlight=False, markup=False)
        out.print(f"twin: {self.out / 'twin.toml'}", highlight=False, markup=False)
