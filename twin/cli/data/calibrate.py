"""`twin calibrate`: fit the robot's own parameters, without effects."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.table import Table
from tyro.conf import Positional, arg

from twin.cli.sources import load_set_and_twin
from twin.cli.terminal import command_line, cpu_count, out, printable, show_progress
from twin.foundation.errors import DataError

if TYPE_CHECKING:
    from twin.diagnosis.calibration.fit import Fit


DOUBTFUL_DEVIATION = 2.0  # prior standard deviations; one in twenty parameters lies further away by chance


@dataclass(frozen=True)
class Calibrate:
    """Fit the robot's own uncertain parameters to a set, without searching effects. Writes a twin.toml."""

    set: Positional[Annotated[Path, arg(help="folder of a measurement set")]]
    out: Annotated[Path, arg(help="the twin.toml to write")] = Path("twin.toml")
    twin: Annotated[
        str | None,
        arg(help="start of the fit: a twin.toml, a robot's name or the path to its folder; default: the robot named in the set"),
    ] = None
    force: Annotated[bool, arg(help="overwrite an existing file")] = False
    jobs: Annotated[int, arg(help="worker threads")] = cpu_count()
    seed: Annotated[int, arg(help="draws the held-out trials and the simulated sets without effects")] = 0

    def run(self) -> None:
        from twin import report
        from twin.diagnosis import Settings, calibrated_fit
        from twin.prediction.twin_file.storage import twin_table, write_twin

        if self.out.exists() and not self.force:
            raise DataError(f"{self.out} exists already; give another file with --out, or overwrite it with --force")
        if not self.out.absolute().parent.is_dir():
            raise DataError(f"{self.out.absolute().parent} is no folder; make it, or give another file with --out")
        recording, twin = load_set_and_twin(self.set, self.twin)
        settings = Settings(seed=self.seed, jobs=self.jobs)
        with show_progress(f"calibrating on {recording.title}"):
            fitted, held_out, notices = calibrated_fit(recording, twin, settings)
        for notice in notices:
            out.print(f"note: {printable(notice)}", highlight=False, markup=False)
        found = fitted.fitted(None)
        out.print(_fitted_table(fitted))
        if fitted.unfixed():
            out.print(f"not determined by these data (as uncertain as before): {', '.join(fitted.unfixed())}")
        out.print(f"RMS error on held-out trials: {held_out}")
        table = twin_table(
            fitted.model.twin, self.out.parent, found, {e.id: fitted.fitted(e.id) for e in fitted.model.twin.effects}
        )
        write_twin(self.out, table, report.provenance(recording, settings, command_line()), fitted.correlation())
        out.print(f"twin: {self.out}", highlight=False, markup=False)


def _fitted_table(fitted: Fit) -> Table:
    """Return the fitted parameters in the units of the robot's file; first those at a bound or far from their prior."""
    from twin.robots.numbers import in_file_unit, std_in_file_unit

    table = Table("parameter", "value", "standard error", "described", "unit", "")
    rows = []
    free = zip(fitted.model.free, fitted.std(), fitted.at_bound(), strict=True)
    for label, p, f, error, bound in ((f.label, f.parameter, fitted.model.value(f), s, b) for f, s, b in free):
        away = abs(f - p.value) / p.std if p.std else 0.0
        doubt = "at a bound" if bound else f"{away:.1f} std away" if away > DOUBTFUL_DEVIATION else ""
        cells = (in_file_unit(p, f), std_in_file_unit(p, error), in_file_unit(p, p.value))
        rows.append(
            (
                not bound,
                -away if doubt else 0.0,
                label,
                *(f"{x:.{n}g}" for x, n in zip(cells, (6, 2, 6), strict=True)),
                p.file_unit or p.unit,
                doubt,
            )
        )
    for _, _, *cells in sorted(rows, key=lambda row: row[:2]):
        table.add_row(*cells)
    return table
