"""`twin robots`: list the bundled robots, or draw one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.table import Table
from tyro.conf import Positional, arg

from twin.cli.terminal import out, printable

if TYPE_CHECKING:
    from twin.robots import Robot


@dataclass(frozen=True)
class Robots:
    """List the bundled robots; or draw a robot and print its numbers in the units of its file."""

    name: Positional[Annotated[str | None, arg(help="a robot's name or the path to its folder; default: list all robots")]] = None
    out: Annotated[Path | None, arg(help="the picture to write; default: NAME.html")] = None

    def run(self) -> None:
        from twin.robots import load, robot_names

        if self.name is not None:
            self._show(load(self.name))
            return
        table = Table("robot", "what it is", "family", "uncertain parameters")
        for name in robot_names():
            robot = load(name)
            table.add_row(name, printable(robot.title), robot.family, str(len(robot.nuisance)))
        out.print(table)

    def _show(self, robot: Robot) -> None:
        from twin.report.robot_page import write_drawing
        from twin.robots.numbers import file_entries

        path = self.out or Path(f"{robot.name}.html")
        write_drawing(robot, path)
        out.print(printable(f"{robot.name}: {robot.title}"))
        table = Table("parameter", "value", "± std", "unit", "what it is")
        for line in file_entries(robot):
            table.add_row(
                line.row.name, line.numbers_text(), "" if line.std is None else f"{line.std:.3g}", line.unit, line.row.meaning
            )
        out.print(table)
        out.print(f"structure: {dict(robot.structure)}; gravity: {robot.gravity.tolist()} m/s^2", highlight=False, markup=False)
        out.print(f"picture: {path}", highlight=False, markup=False)
