"""CSV and its relatives: the delimiter, the decimal sign, the header and units are found out, then pyarrow reads the numbers."""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.csv

from twin.foundation.errors import DataError, short_repr
from twin.measurements.logs.streams import Stream
from twin.measurements.logs.tables.columns import stream_of_table
from twin.measurements.logs.tables.headers import unit_word
from twin.measurements.logs.tables.text_files import read_text

HEAD_LINES = 300  # lines from which the layout is found out
MAX_RAGGED = 0.01  # share of rows of another length that are left out with a note; more: refused
MAX_FACTS = 0.2  # share of the first lines that facts about a test take at most
_DELIMITERS = (",", ";", "\t", "|", " ")
_COMMENT = ("%", "#", "//")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)|true|false", re.IGNORECASE)
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}.*|\d{1,2}:\d{2}:\d{2}.*")
ROSTOPIC_STAMPS = ("time", "field.header.stamp")  # of rostopic echo -p, in ns
MISSING = ["", "nan", "NaN", "NAN", "-nan", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "-", "--"]


@dataclass(frozen=True)
class Layout:
    """How a text table is written."""

    delimiter: str
    decimal: str
    names: tuple[str, ...]
    units: dict[str, str]
    first: int  # index of the first line of data
    notes: tuple[str, ...] = ()


def read_delimited(path: Path, name: str) -> tuple[Stream, tuple[str, ...]]:
    """Return a text table as a stream, and what is to be said. Raises DataError for text that is no table."""
    text, notes = read_text(path)
    lines = text.split("\n")
    layout = find_layout(lines[:HEAD_LINES], path)
    table, ragged = read_rows(path, lines[layout.first :], layout)
    if table.num_rows == 0:
        raise DataError(f"{path}: a header, but no row of numbers; name another log")
    return stream_of_table(name, "text table", table, layout.units), (*notes, *layout.notes, *ragged)


def find_layout(lines: list[str], path: Path) -> Layout:
    """Return the layout of a table from its first lines. Raises DataError if no row of numbers is in them."""
    best: tuple[float, int, int, str] | None = None
    for rank, delimiter in enumerate(_DELIMITERS):
        rows = [split(line, delimiter) for line in lines if line.strip() and not _is_comment(line)]
        counts = [(*_numeric_cells(row, delimiter), len(row)) for row in rows]
        data = [count for count in counts if count[0] > 0 and 2 * count[0] >= count[1]]
        if data:
            width = max(cells for _, _, cells in data)
            score = sum(numeric / stated for numeric, stated, _ in data) / len(counts)
            if best is None or (round(score, 2), min(width, 2), -rank) > best[:3]:
                best = (round(score, 2), min(width, 2), -rank, delimiter)
    if best is None:
        raise DataError(f"{path}: no row of numbers in its first {len(lines)} lines, so it is no table; name a log")
    return _describe(lines, best[3])


def _describe(lines: list[str], delimiter: str) -> Layout:
    first = _first_of_block(lines, delimiter)
    rows = [split(line, delimiter) for line in lines[first:] if _is_data(line, delimiter)]
    width = max(set(map(len, rows)), key=[len(row) for row in rows].count)
    cells = [cell for row in rows for cell in row]
    comma = delimiter != "," and any(_COMMA_NUMBER.fullmatch(cell) for cell in cells)
    decimal = "," if comma and not any(re.fullmatch(r"[+-]?\d+\.\d+", cell) for cell in cells) else "."
    before = [n for n in range(first) if lines[n].strip()]
    header: list[str] = []
    units: dict[str, str] = {}
    if before:
        header = split(_uncomment(lines[before[-1]]), delimiter)
        units = dict.fromkeys(ROSTOPIC_STAMPS, "ns") if lines[before[-1]].startswith("%time,") else {}
        above = split(_uncomment(lines[before[-2]]), delimiter) if len(before) > 1 else []
        if len(above) == len(header) >= width and all(not cell or unit_word(cell.strip("[]()")) for cell in header):
            header, units = above, dict(zip(above, (unit_word(cell.strip("[]()")) for cell in header), strict=True))
            before = before[:-1]
    if len(header) == width - 1 and header:  # a comma at the end of each row, or a column of row numbers without a name
        header = [*header, ""] if not any(row[-1] for row in rows if len(row) == width) else ["", *header]
    if not width <= len(header) <= width + 1 or _numeric_cells(header, delimiter)[0] == len(header):
        notes = (
            ("no header: the columns are numbered from 1",) if not header else (f"no header of {width} names before the numbers",)
        )
        return Layout(delimiter, decimal, tuple(f"column_{n + 1}" for n in range(width)), {}, first, notes)
    names, renamed = _unique(header[:width])
    skipped = [lines[n] for n in before[:-1]]
    notes = (f"{len(skipped)} lines before the header are left out, the first {short_repr(skipped[0])}",) if skipped else ()
    return Layout(delimiter, decimal, names, units, first, notes + renamed)


def _first_of_block(lines: list[str], delimiter: str) -> int:
    """Return the first line of data, behind a block of facts about the test that looks like a small table of its own."""
    widths = {n: len(split(line, delimiter)) for n, line in enumerate(lines) if _is_data(line, delimiter)}
    first = min(widths)
    for n in range(first + 1, len(lines)):
        cells = [cell for cell in split(lines[n], delimiter) if cell]
        if len(cells) < 2 or _numeric_cells(cells, delimiter)[0] or n + 1 not in widths or lines[n] in lines[:n]:
            continue
        before = [width for at, width in widths.items() if at < n]
        if len(before) <= MAX_FACTS * len(widths) or widths[n + 1] not in before:
            first = n + 1
    return first


def read_rows(path: Path, lines: list[str], layout: Layout) -> tuple[pa.Table, tuple[str, ...]]:
    """Return the rows of a table, and what is to be said of rows that do not fit.

    Raises DataError if more than a hundredth do not, or nothing can be read.
    """
    lines = [line for line in lines if line.strip() and not _is_comment(line)]
    delimiter = layout.delimiter
    if delimiter == " ":
        lines = [" ".join(line.split()) for line in lines]
    width = len(layout.names)
    good = [line for line in lines if _fits(line, delimiter, width)]
    bad = len(lines) - len(good)
    if bad > max(1, MAX_RAGGED * len(lines)):
        odd = next(line for line in lines if not _fits(line, delimiter, width))
        raise DataError(f"{path}: {bad} of {len(lines)} rows have not {width} cells, such as {short_repr(odd)}; correct the file")
    data = "\n".join(good).encode()
    try:
        table = pyarrow.csv.read_csv(
            pa.BufferReader(data),
            read_options=pyarrow.csv.ReadOptions(
                use_threads=False, column_names=list(layout.names), block_size=max(len(data) + 1, 1024)
            ),
            parse_options=pyarrow.csv.ParseOptions(delimiter=delimiter, ignore_empty_lines=True),
            convert_options=pyarrow.csv.ConvertOptions(
                null_values=MISSING, strings_can_be_null=True, decimal_point=layout.decimal, check_utf8=False
            ),
        )
    except (pa.ArrowException, OverflowError) as fault:
        raise DataError(f"{path}: cannot be read as a table ({short_repr(str(fault), 150)}); correct the file") from None
    said = (f"{bad} of {len(lines)} rows have not {width} cells and are left out (a line cut off?)",) if bad else ()
    return table, said


def split(line: str, delimiter: str) -> list[str]:
    """Return a line's cells, without spaces around them."""
    if delimiter == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    except csv.Error:
        return [line]


def _fits(line: str, delimiter: str, width: int) -> bool:
    count = line.count(delimiter) + 1
    return count == width or ('"' in line and len(split(line, delimiter)) == width)


def _numeric_cells(cells: list[str], delimiter: str) -> tuple[int, int]:
    """Return how many cells are numbers or dates, and how many there are; missing ones do not count."""
    stated = [cell for cell in cells if cell not in MISSING[:1]]
    return sum(_is_number(cell, delimiter) for cell in stated), len(stated)


def _is_number(cell: str, delimiter: str) -> bool:
    return bool(
        _NUMBER.fullmatch(cell) or _DATE.fullmatch(cell) or cell in MISSING or (delimiter != "," and _COMMA_NUMBER.fullmatch(cell))
    )


def _is_data(line: str, delimiter: str) -> bool:
    if not line.strip() or _is_comment(line):
        return False
    numeric, total = _numeric_cells(split(line, delimiter), delimiter)
    return numeric > 0 and 2 * numeric >= total


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(_COMMENT)


def _uncomment(line: str) -> str:
    return line.lstrip().lstrip("%#/").strip() if _is_comment(line) else line


def _unique(header: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names that differ: empty ones by their number, repeated ones with (2), (3) ..., and what is to be said of it."""
    names: list[str] = []
    for n, cell in enumerate(header, start=1):
        name = plain = cell or f"column_{n}"
        again = 1
        while name in names:
            again += 1
            name = f"{plain} ({again})"
        names.append(name)
    twice = sorted({cell for cell in header if cell and header.count(cell) > 1})
    return tuple(names), (f"columns of the same name are told apart by (2), (3) ...: {', '.join(twice[:5])}",) if twice else ()
