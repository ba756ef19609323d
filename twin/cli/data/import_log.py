"""`twin import`: make a measurement set of a log."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.table import Table
from tyro.conf import Positional, arg

from twin.cli.terminal import out, printable, show_progress
from twin.foundation.errors import DataError, TwinError

if TYPE_CHECKING:
    from twin.measurements import Recording
    from twin.measurements.logs.streams import Log

MAX_CSV_NUMBERS = 2**21  # numbers of a trial; larger ones are written as Parquet
SHOWN_FIELDS = 16  # of a stream, on the terminal; the map lists all


@tyro.conf.configure(tyro.conf.subcommand("import"))
@dataclass(frozen=True)
class ImportLog:
    """Make a measurement set of a log: first a list of what is in it and a map to fill in, then, with --out, the set.

    Reads MCAP, ROS 1 and ROS 2 bags, LeRobot folders, Motive CSV, CSV and other text tables, Parquet, JSON, and folders of tables.
    """

    log: Positional[Annotated[Path, arg(help="a log's file or folder")]]
    map: Annotated[Path | None, arg(help="the map, written if it does not exist; default: LOG-map.toml here")] = None
    out: Annotated[Path | None, arg(help="new folder for the set; left out: only list what is in the log")] = None

    def run(self) -> None:
        from twin.measurements.logs import open_log

        path = self.map or Path(f"{self._name()}-map.toml")
        if self.out is not None and not path.exists():
            raise DataError(f"{path}: no such map; run twin import {self.log} first, fill in the map it writes, then give --out")
        with show_progress(f"reading {self.log}"):
            log = open_log(self.log)
        if self.out is None:
            self._list(log, path)
        else:
            self._write(log, path, self.out)

    def _name(self) -> str:
        from twin.measurements.logs.tables.folder import stem

        return stem(self.log.resolve()) or "log"

    def _list(self, log: Log, path: Path) -> None:
        from twin.foundation.atomic_write import write_atomically
        from twin.measurements.logs import map_text

        _show(log)
        if path.exists():
            out.print(f"the map {path} exists and is kept; remove it for a new one", highlight=False, markup=False)
            return
        write_atomically(path, map_text(log, str(path)).encode())
        out.print(
            f'map: {path}; fill in its "?", then: twin import {self.log} --map {path} --out SET',
            highlight=False,
            markup=False,
            soft_wrap=True,
        )

    def _write(self, log: Log, path: Path, folder: Path) -> None:
        from twin.measurements import read, write
        from twin.measurements.logs import assemble, read_map
        from twin.measurements.logs.assemble import clock_words

        import_map = read_map(path)
        recording, notes = assemble(log, import_map)
        recording = replace(recording, robot=_robot(recording, path, folder))
        large = max(trial.time.size for trial in recording.trials) * len(recording.channels) > MAX_CSV_NUMBERS
        write(recording, folder, file_format="parquet" if large else "csv")
        for note in (*clock_words(import_map), *notes, *read(folder, least_trials=1).notices):
            out.print(printable(f"  {note}"), highlight=False, soft_wrap=True)
        trials = recording.trials
        counted = f"{len(trials)} trial{'s' if len(trials) != 1 else ''}, {recording.n_samples} rows"
        out.print(f"{counted}, {len(recording.channels)} channels: {folder}", highlight=False, markup=False)
        if len(trials) == 1:
            out.print("a diagnosis needs two trials: cut this one, or add another to the set", highlight=False, markup=False)


def _robot(recording: Recording, path: Path, folder: Path) -> str:
    """Return how the set names its robot: a map's path is relative to the map, a set's to the set. An unknown robot is said."""
    from twin.prediction.twin_file.storage import robot_reference
    from twin.robots import load

    try:
        return robot_reference(load(recording.robot, path.absolute().parent), folder.absolute())
    except TwinError as fault:
        out.print(f"  the robot is not there yet: {fault}", highlight=False, markup=False, soft_wrap=True)
        return recording.robot


def _show(log: Log) -> None:
    """Print what is in a log: streams with rows, rates and gaps, then fields with ranges and proposals."""
    from twin.measurements.logs.listing import field_rows, stream_rows

    out.print(printable(f"{log.path}: {log.format}, {len(log.takes)} take{'s' if len(log.takes) != 1 else ''}"), highlight=False)
    for note in log.notes[:6]:
        out.print(printable(f"  {note}"), highlight=False, soft_wrap=True)
    if len(log.notes) > 6:
        out.print(f"  and {len(log.notes) - 6} more remarks, see the map", highlight=False)
    table = Table(
        "stream", "type", "rows", "rate (1/s)", "length (s)", "longest step (s)", "clock", title="streams", title_justify="left"
    )
    for row in stream_rows(log):
        table.add_row(*map(printable, row))
    out.print(table)
    fields = Table("field", "readings", "proposed quantity", "role", "unit", title="fields", title_justify="left")
    for name, rows in field_rows(log).items():
        fields.add_row(printable(f"{name}:"), end_section=False)
        for row in rows[:SHOWN_FIELDS]:
            fields.add_row(*(printable(cell) for cell in (f"  {row[0]}", *row[1:])))
        if len(rows) > SHOWN_FIELDS:
            fields.add_row(f"  and {len(rows) - SHOWN_FIELDS} more, see the map")
    out.print(fields)
    for topic, why in log.unread.items():
        out.print(printable(f"not read: {topic} ({why})"), highlight=False)
