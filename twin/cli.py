"""The command line: `twin diagnose`, `evaluate`, `simulate`, `calibrate`, `robots`, `effects`.

Exit codes: 0 done; 1 stopped (Ctrl-C) or a fault of the program; 2 bad input, said in one line.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.table import Table
from tyro.conf import Positional, arg

from twin.errors import DataError, TwinError

SAMPLE = "continuum/samples/friday"

out = Console()
err = Console(stderr=True)


def _cores() -> int:
    return os.cpu_count() or 1


@dataclass(frozen=True)
class Diagnose:
    """Find what a twin lacks: predict the data, take the residual, name the effect behind it, add it.

    Reports the error before and after on trials that no fit has seen. Writes report.html, report.json and twin.toml.
    """

    set: Positional[Annotated[Path | None, arg(help="folder of a measurement set; without it the bundled sample")]] = None
    out: Annotated[Path, arg(help="folder for the report")] = Path("twin-report")
    twin: Annotated[str | None, arg(help="a twin.toml, or a robot's name; default: the robot the set names")] = None
    jobs: Annotated[int, arg(help="worker threads")] = _cores()
    seed: Annotated[int, arg(help="draws the held-out trials")] = 0

    def run(self) -> None:
        from twin import report
        from twin.diagnose import Settings, diagnose

        recording, twin = _load(self.set, self.twin)
        if self.out.exists() and not self.out.is_dir():
            raise DataError(f"{self.out} is a file; give a folder for the report with --out")
        settings = Settings(seed=self.seed, jobs=self.jobs)
        with _working(f"diagnosing {recording.title}") as progress:
            diagnosis = diagnose(recording, twin, settings, progress)
            progress("writing the report")
            report.write(diagnosis, self.out, report.provenance(recording, settings, _command()))
        out.print(report.console(diagnosis))
        out.print(f"report: {self.out / 'report.html'}", highlight=False)


@dataclass(frozen=True)
class Evaluate:
    """Error of a given twin on given data; fits nothing."""

    twin: Positional[Annotated[str, arg(help="a twin.toml, a report's folder, or a robot's name")]]
    set: Positional[Annotated[Path, arg(help="folder of a measurement set")]]
    json: Annotated[bool, arg(help="print the error block as JSON")] = False

    def run(self) -> None:
        from twin.evaluate import evaluate
        from twin.measurements import read
        from twin.storage import read_twin

        twin = read_twin(self.twin)
        recording = read(self.set, least_trials=1)
        with _working(f"evaluating on {recording.title}"):
            error = evaluate(twin, recording)
        if self.json:
            print(json.dumps(error, indent=2))
            return
        table = Table("kind", "RMS error", "unit")
        for kind, block in error["by_kind"].items():
            table.add_row(kind, f"{block['rmse']:.4g}", block["unit"])
        out.print(table)


@dataclass(frozen=True)
class Simulate:
    """Write what a twin predicts for a set's trials as a measurement set of its own."""

    twin: Positional[Annotated[str, arg(help="a twin.toml, a report's folder, or a robot's name")]]
    set: Positional[Annotated[Path, arg(help="folder of the measurement set whose inputs drive the twin")]]
    out: Annotated[Path, arg(help="new folder for the simulated set")]
    dynamic: Annotated[bool | None, arg(help="MuJoCo steps instead of static equilibria; default: by the set's rates")] = None

    def run(self) -> None:
        from twin.measurements import read, write
        from twin.storage import read_twin

        twin = read_twin(self.twin)
        recording = read(self.set, least_trials=1)
        with _working(f"simulating {recording.title}"):
            write(twin.predict(recording, dynamic=self.dynamic), self.out)
        out.print(f"simulated set: {self.out}", highlight=False)


@dataclass(frozen=True)
class Calibrate:
    """Fit the robot's own uncertain parameters to a set, without seeking effects. Writes a twin.toml."""

    set: Positional[Annotated[Path, arg(help="folder of a measurement set")]]
    out: Annotated[Path, arg(help="the twin.toml to write")] = Path("twin.toml")
    twin: Annotated[str | None, arg(help="where to start: a twin.toml or a robot's name; default: the robot the set names")] = None
    jobs: Annotated[int, arg(help="worker threads")] = _cores()
    seed: Annotated[int, arg(help="draws the held-out trials")] = 0

    def run(self) -> None:
        from twin import report
        from twin.diagnose import Settings, calibration
        from twin.storage import twin_table, write_twin

        recording, twin = _load(self.set, self.twin)
        settings = Settings(seed=self.seed, jobs=self.jobs)
        with _working(f"calibrating on {recording.title}"):
            fitted, held_out, notices = calibration(recording, twin, settings)
        for notice in notices:
            out.print(f"note: {notice}", highlight=False)
        found = fitted.fitted(None)
        table = Table("parameter", "value", "standard error", "unit")
        for name, f in found.items():
            table.add_row(name, f"{f.value:.6g}", f"{f.std:.2g}", f.unit)
        out.print(table)
        if fitted.unfixed():
            out.print(f"not fixed by these data (as uncertain as before): {', '.join(fitted.unfixed())}")
        out.print(f"RMS error on held-out trials: {held_out}")
        table = twin_table(fitted.model.twin, found, {e.id: fitted.fitted(e.id) for e in fitted.model.twin.effects})
        write_twin(self.out, table, report.provenance(recording, settings, _command()))
        out.print(f"twin: {self.out}", highlight=False)


@dataclass(frozen=True)
class Robots:
    """List the robots that ship with the twin."""

    def run(self) -> None:
        from twin.robots import available, load

        table = Table("robot", "what it is", "family", "uncertain parameters")
        for name in available():
            robot = load(name)
            table.add_row(name, robot.title, robot.family, str(len(robot.nuisance)))
        out.print(table)


@dataclass(frozen=True)
class Effects:
    """List the effects a diagnosis knows."""

    def run(self) -> None:
        from twin.effects import catalogue

        table = Table("effect", "what it is", "parameters", "gives itself away by")
        for name, law in catalogue().items():
            first = (sys.modules[law.__module__].__doc__ or "").strip().splitlines()[0]
            names = [*(p.name for p in law.parameters), *(f"{p.name}_i" for p in law.per_tendon)]
            table.add_row(name, first.partition(": ")[2].rstrip("."), ", ".join(names), law.moves_with)
        out.print(table)


def _load(folder: Path | None, twin: str | None) -> tuple[Any, Any]:
    """The recording (the bundled sample if no folder is given) and the twin to hold against it."""
    from twin.measurements import read
    from twin.robots import load
    from twin.robots.robot import models_folder
    from twin.storage import read_twin
    from twin.twin import Twin

    if folder is None:
        folder = models_folder() / SAMPLE
        out.print("no measurement set given: diagnosing the bundled sample (a simulated bench day, see its `source`)")
    recording = read(folder)
    return recording, read_twin(twin) if twin else Twin.of(load(recording.robot, recording.folder))


@contextmanager
def _working(title: str) -> Iterator[Callable[[str], None]]:
    """A spinner with the present step; says so while the solver is compiled, which happens once."""
    from twin.equilibrium import compile_solver, is_compiled

    with err.status(title) as status:
        if not is_compiled():
            status.update("compiling the solver, once on this machine (about 20 s)")
            compile_solver()
        status.update(title)
        yield lambda words: status.update(f"{title}: {words}")


def _command() -> str:
    return " ".join(["twin", *sys.argv[1:]])


Command = Diagnose | Evaluate | Simulate | Calibrate | Robots | Effects


def main() -> None:
    """Entry point of the `twin` command."""
    command: Command = tyro.cli(Command, prog="twin", description=__doc__.splitlines()[0] if __doc__ else "")  # type: ignore[arg-type]
    try:
        command.run()
    except TwinError as error:
        err.print(f"twin: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(2)
    except KeyboardInterrupt:
        err.print("twin: stopped; nothing half-written is left")
        sys.stdout.flush()
        os._exit(1)  # worker threads are still inside compiled code: taking the interpreter down beneath them would crash it


if __name__ == "__main__":
    main()
