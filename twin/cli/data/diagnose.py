"""`twin diagnose`: find the missing effects and write the report."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.sources import load_set_and_twin
from twin.cli.terminal import command_line, cpu_count, out, show_progress
from twin.foundation.errors import DataError


@dataclass(frozen=True)
class Diagnose:
    """Find the effects that a twin lacks: predict the data, take the residual, name the effects behind it, add them.

    Reports the error before and after on held-out trials, which neither the fit nor the choice of effects uses.
    Writes report.html, report.json and twin.toml.
    """

    set: Positional[Annotated[Path | None, arg(help="folder of a measurement set; without it the bundled sample")]] = None
    out: Annotated[Path, arg(help="folder for the report")] = Path("twin-report")
    twin: Annotated[
        str | None, arg(help="a twin.toml, a robot's name or the path to its folder; default: the robot named in the set")
    ] = None
    jobs: Annotated[int, arg(help="worker threads")] = cpu_count()
    seed: Annotated[int, arg(help="draws the held-out trials and the simulated sets without effects")] = 0
    budget: Annotated[
        str | None,
        arg(help='time for the search, such as "60s"; then the best answer so far is reported, with the effects not tried'),
    ] = None

    def run(self) -> None:
        from twin import report
        from twin.diagnosis import Settings, diagnose

        recording, twin = load_set_and_twin(self.set, self.twin)
        if self.out.exists() and not self.out.is_dir():
            raise DataError(f"{self.out} is a file; give a folder for the report with --out")
        settings = Settings(self.seed, self.jobs, parse_budget(self.budget))
        with show_progress(f"diagnosing {recording.title}") as progress:
            diagnosis = diagnose(recording, twin, settings, progress, lambda preview: out.print(report.render_preview(preview)))
            progress("writing the report")
            report.write(diagnosis, self.out, report.provenance(recording, settings, command_line()))
        out.print(report.render_diagnosis(diagnosis))
        out.print(f"report: {self.out / 'report.html'}", highlight=False, markup=False)


def parse_budget(budget: str | None) -> float | None:
    """Return the seconds of a text such as "60s". Raises DataError for anything but a time above zero."""
    from twin.measurements.parsing.quantity_strings import parse_quantity

    if budget is None:
        return None
    found = parse_quantity(budget, "s")
    if not found > 0.0:
        raise DataError(f"--budget {budget}: the time must be above zero; give a time such as 60s")
    return found
