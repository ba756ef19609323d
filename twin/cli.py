"""A digital twin of tendon-driven soft and continuum robots that learns from measured data what it is missing.

Exit codes: 0 done; 1 stopped (Ctrl-C) or a fault of the program; 2 bad input, said in one line.
"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import tyro
from rich.table import Table
from tyro.conf import Positional, arg

from twin.errors import DataError, TwinError
from twin.finger_commands import Align, Generate, Shape, Train
from twin.show_commands import Rollout, View, loaded
from twin.task_commands import Demonstrate, Imitate, Tasks
from twin.terminal import command_line, cores, err, out, plain, working

if TYPE_CHECKING:
    from twin.calibrate import Fit
    from twin.robots import Robot

FAR = 2.0  # prior standard deviations: one in twenty fitted parameters of a robot as described lies further away


@dataclass(frozen=True)
class Diagnose:
    """Find what a twin lacks: predict the data, take the residual, name the effect behind it, add it.

    Reports the error before and after on sealed trials, which neither fit nor choice has seen.
    Writes report.html, report.json and twin.toml.
    """

    set: Positional[Annotated[Path | None, arg(help="folder of a measurement set; without it the bundled sample")]] = None
    out: Annotated[Path, arg(help="folder for the report")] = Path("twin-report")
    twin: Annotated[
        str | None, arg(help="a twin.toml, a robot's name or the path to its folder; default: the robot the set names")
    ] = None
    jobs: Annotated[int, arg(help="worker threads")] = cores()
    seed: Annotated[int, arg(help="draws the sealed trials and the no-effect sets")] = 0
    budget: Annotated[
        str | None, arg(help='time to try effects in, such as "60s": the best answer until then, and what was not tried')
    ] = None

    def run(self) -> None:
        from twin import report
        from twin.diagnose import Settings, diagnose

        recording, twin = loaded(self.set, self.twin)
        if self.out.exists() and not self.out.is_dir():
            raise DataError(f"{self.out} is a file; give a folder for the report with --out")
        settings = Settings(self.seed, self.jobs, _seconds(self.budget))
        with working(f"diagnosing {recording.title}") as progress:
            diagnosis = diagnose(recording, twin, settings, progress, lambda seen: out.print(report.beforehand(seen)))
            progress("writing the report")
            report.write(diagnosis, self.out, report.provenance(recording, settings, command_line()))
        out.print(report.console(diagnosis))
        out.print(f"report: {self.out / 'report.html'}", highlight=False, markup=False)


@dataclass(frozen=True)
class Evaluate:
    """Error of a given twin on given data; fits nothing."""

    twin: Positional[Annotated[str, arg(help="a twin.toml, a report's folder, a robot's name or the path to its folder")]]
    set: Positional[Annotated[Path, arg(help="folder of a measurement set")]]
    json: Annotated[bool, arg(help="print the error block as JSON")] = False

    def run(self) -> None:
        from twin.evaluate import evaluate
        from twin.measurements import read
        from twin.storage import read_twin

        twin = read_twin(self.twin)
        recording = read(self.set, least_trials=1)
        with working(f"evaluating on {recording.title}"):
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

    twin: Positional[Annotated[str, arg(help="a twin.toml, a report's folder, a robot's name or the path to its folder")]]
    set: Positional[Annotated[Path, arg(help="folder of the measurement set whose inputs drive the twin")]]
    out: Annotated[Path, arg(help="new folder for the simulated set")]
    dynamic: Annotated[bool | None, arg(help="MuJoCo steps instead of static equilibria; default: by the set's rates")] = None

    def run(self) -> None:
        from twin.measurements import read, write
        from twin.storage import read_twin, robot_reference

        twin = read_twin(self.twin)
        recording = read(self.set, least_trials=1)
        with working(f"simulating {recording.title}"):
            predicted = twin.predict(recording, dynamic=self.dynamic)
            write(replace(predicted, robot=robot_reference(twin.robot, self.out)), self.out)
        out.print(f"simulated set: {self.out}", highlight=False, markup=False)


@dataclass(frozen=True)
class Calibrate:
    """Fit the robot's own uncertain parameters to a set, without seeking effects. Writes a twin.toml."""

    set: Positional[Annotated[Path, arg(help="folder of a measurement set")]]
    out: Annotated[Path, arg(help="the twin.toml to write")] = Path("twin.toml")
    twin: Annotated[
        str | None,
        arg(help="where to start: a twin.toml, a robot's name or the path to its folder; default: the robot the set names"),
    ] = None
    force: Annotated[bool, arg(help="write over a file that is there")] = False
    jobs: Annotated[int, arg(help="worker threads")] = cores()
    seed: Annotated[int, arg(help="draws the sealed trials and the no-effect sets")] = 0

    def run(self) -> None:
        from twin import report
        from twin.diagnose import Settings, calibration
        from twin.storage import twin_table, write_twin

        if self.out.exists() and not self.force:
            raise DataError(f"{self.out} is there already; give another file with --out, or write over it with --force")
        if not self.out.absolute().parent.is_dir():
            raise DataError(f"{self.out.absolute().parent} is no folder; make it, or give another file with --out")
        recording, twin = loaded(self.set, self.twin)
        settings = Settings(seed=self.seed, jobs=self.jobs)
        with working(f"calibrating on {recording.title}"):
            fitted, sealed, notices = calibration(recording, twin, settings)
        for notice in notices:
            out.print(f"note: {plain(notice)}", highlight=False, markup=False)
        found = fitted.fitted(None)
        out.print(_fitted_table(fitted))
        if fitted.unfixed():
            out.print(f"not fixed by these data (as uncertain as before): {', '.join(fitted.unfixed())}")
        out.print(f"RMS error on sealed trials: {sealed}")
        table = twin_table(
            fitted.model.twin, self.out.parent, found, {e.id: fitted.fitted(e.id) for e in fitted.model.twin.effects}
        )
        write_twin(self.out, table, report.provenance(recording, settings, command_line()))
        out.print(f"twin: {self.out}", highlight=False, markup=False)


@dataclass(frozen=True)
class New:
    """Begin a robot of your own: a commented robot.toml that loads, and a measurement set to fill."""

    name: Positional[Annotated[str, arg(help="what it is called, and its folder")]]
    family: Annotated[str, arg(help="what kind of body it is; a wrong name lists those there are")]
    out: Annotated[Path, arg(help="where to put the folder")] = Path()

    def run(self) -> None:
        from twin.robots.starter import SET, write_starter

        folder = write_starter(self.name, self.family, self.out)
        words = [
            f"1. describe it: {folder / 'robot.toml'}", f"2. look at it: twin robots {folder}",
            f"3. fill {folder / SET}", f"4. twin diagnose {folder / SET}",
        ]  # fmt: skip
        out.print("\n".join(words), highlight=False, markup=False)


@dataclass(frozen=True)
class Robots:
    """List the robots that ship with the twin; or draw one and print its numbers as its file has them."""

    name: Positional[Annotated[str | None, arg(help="a robot's name or the path to its folder; without it the list")]] = None
    out: Annotated[Path | None, arg(help="the picture to write; default: NAME.html")] = None

    def run(self) -> None:
        from twin.robots import available, load

        if self.name is not None:
            self._show(load(self.name))
            return
        table = Table("robot", "what it is", "family", "uncertain parameters")
        for name in available():
            robot = load(name)
            table.add_row(name, plain(robot.title), robot.family, str(len(robot.nuisance)))
        out.print(table)

    def _show(self, robot: Robot) -> None:
        from twin.report.robot_page import write_drawing
        from twin.robots.numbers import lines

        path = self.out or Path(f"{robot.name}.html")
        write_drawing(robot, path)
        out.print(plain(f"{robot.name}: {robot.title}"))
        table = Table("parameter", "value", "± std", "unit", "what it is")
        for line in lines(robot):
            table.add_row(
                line.row.name, line.words(), "" if line.spread is None else f"{line.spread:.3g}", line.unit, line.row.meaning
            )
        out.print(table)
        out.print(f"structure: {dict(robot.structure)}; gravity: {robot.gravity.tolist()} m/s^2", highlight=False, markup=False)
        out.print(f"picture: {path}", highlight=False, markup=False)


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


def _seconds(budget: str | None) -> float | None:
    """Of "60s". Raises DataError for what is no time above zero."""
    from twin.measurements.quantity_strings import quantity

    if budget is None:
        return None
    found = quantity(budget, "s")
    if not found > 0.0:
        raise DataError(f"--budget {budget}: no time to try anything in; give more than zero, such as 60s")
    return found


def _fitted_table(fitted: Fit) -> Table:
    """The robot's fitted parameters in the units of its file; first those at a bound or far from what was believed."""
    from twin.robots.numbers import as_written, spread_as_written

    table = Table("parameter", "value", "standard error", "described", "unit", "")
    rows = []
    free = zip(fitted.model.free, fitted.std(), fitted.at_bound(), strict=True)
    for label, p, f, error, bound in ((f.label, f.parameter, fitted.model.value(f), s, b) for f, s, b in free):
        away = abs(f - p.value) / p.std if p.std else 0.0
        doubt = "at a bound" if bound else f"{away:.1f} std away" if away > FAR else ""
        cells = (as_written(p, f), spread_as_written(p, error), as_written(p, p.value))
        rows.append(
            (
                not bound,
                -away if doubt else 0.0,
                label,
                *(f"{x:.{n}g}" for x, n in zip(cells, (6, 2, 6), strict=True)),
                p.written or p.unit,
                doubt,
            )
        )
    for _, _, *cells in sorted(rows, key=lambda row: row[:2]):
        table.add_row(*cells)
    return table


Command = (
    New | Robots | Diagnose | Evaluate | Simulate | Rollout | View | Calibrate | Effects | Generate | Train | Align | Shape | Tasks
    | Demonstrate | Imitate
)  # fmt: skip


def main() -> None:
    """Entry point of the `twin` command."""
    command: Command = tyro.cli(Command, prog="twin", description=__doc__.splitlines()[0] if __doc__ else "")  # type: ignore[arg-type]
    try:
        command.run()
    except TwinError as error:
        err.print(f"twin: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
        _leave(2)
    except KeyboardInterrupt:
        err.print("twin: stopped; nothing half-written is left")
        _leave(1)


def _leave(code: int) -> NoReturn:
    """Ends the program at once: worker threads may be inside compiled code, and taking the interpreter down beneath them would
    crash it."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    main()
