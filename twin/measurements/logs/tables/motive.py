"""CSV files of Motive (OptiTrack): rigid bodies, bones and markers under a header of several rows.

The layout is that of OptiTrack's documentation, "Data Export: CSV": a first row of keys and values (Length Units, Rotation
Type ...), then rows Type, Name, ID (Parent), Position or Rotation, and last `Frame, Time (Seconds), X, Y, Z, W ...`.
"""

import csv
from pathlib import Path

from twin.foundation.errors import DataError
from twin.measurements.logs.streams import Stream
from twin.measurements.logs.tables.columns import stream_of_table
from twin.measurements.logs.tables.delimited import Layout, read_rows
from twin.measurements.logs.tables.headers import unit_word
from twin.measurements.logs.tables.text_files import read_text

FIRST_CELL = "Format Version"
TIME = "Time (Seconds)"
_LONGEST_HEADER = 20  # lines
_SAID_KEYS = ("Take Name", "Capture Start Time", "Coordinate Space", "Rotation Type", "Length Units", "Export Frame Rate")


def read_motive(path: Path, name: str) -> tuple[Stream, tuple[str, ...]]:
    """Return a Motive CSV as a stream, fields `BODY.position.x` and `BODY.rotation.w`.

    Raises DataError for a file without the rows of the layout.
    """
    text, notes = read_text(path)
    lines = text.split("\n")
    rows = [next(csv.reader([line]), []) for line in lines[:_LONGEST_HEADER]]
    about = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    last = next((n for n, row in enumerate(rows) if [cell.strip() for cell in row[:1]] == ["Frame"]), None)
    if last is None or last < 3 or len(rows[last]) < 3:
        raise DataError(f"{path}: begins like a Motive CSV, but has no row Frame, Time, X, Y ...; export it again with its header")
    frames = [line for line in lines[last + 1 :] if line.strip()]
    width = max([len(rows[last]), *(line.count(",") + 1 for line in frames)])
    frames = [line + "," * (width - 1 - line.count(",")) for line in frames]  # Motive leaves out what is empty at a row's end
    names, units = _columns(rows[1:last], rows[last] + [""] * (width - len(rows[last])), about)
    table, ragged = read_rows(path, frames, Layout(",", ".", tuple(names), {}, last + 1))
    if table.num_rows == 0:
        raise DataError(f"{path}: a Motive CSV without frames; export the take again")
    said = [f"{key}: {about[key]}" for key in _SAID_KEYS if about.get(key)]
    axes = "Motive's y axis points up unless exported otherwise: give each field the axis of the robot's base frame that it is"
    return stream_of_table(name, "Motive CSV", table, units), (*notes, f"Motive says {', '.join(said)}", axes, *ragged)


def _columns(header: list[list[str]], axes: list[str], about: dict[str, str]) -> tuple[list[str], dict[str, str]]:
    """Return the names of all columns and the units of those that have one."""
    labelled = {row[1].strip().lower(): row for row in header if len(row) > 2}
    kinds = labelled.get("type") or next((row for row in header if len(row) > 2), [])
    named = labelled.get("name") or next((row for row in header if len(row) > 2 and row is not kinds), [])
    parts = header[-1]
    length, angle = unit_word(about.get("Length Units", "")), "deg"
    names, units = ["Frame", TIME], {}
    for n in range(2, len(axes)):
        kind, body, part, axis = (row[n].strip() if n < len(row) else "" for row in (kinds, named, parts, axes))
        name = ".".join(word for word in (body or f"column_{n + 1}", part.lower().replace(" ", "_"), axis.lower()) if word)
        name = f"{kind} {name}" if name in names else name
        while name in names:
            name += "'"
        names.append(name)
        if part == "Position" and length:
            units[name] = length
        elif part == "Rotation":
            units[name] = "1" if about.get("Rotation Type", "Quaternion") == "Quaternion" else angle
    return names, units
