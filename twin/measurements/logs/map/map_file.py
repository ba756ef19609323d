"""The map of an import: which fields of a log become which channels, on which clocks, cut into which trials.

    format = "twin-import/1"
    robot, title, source, gravity        as in measurements.toml
    cut     = { gap = "1 s" } | { every = "25 s" } | { stream = S } | { stream = S, field = F }
              | { stream = S, field = F, only = VALUE }
    stream  = [{ name, clock, time_unit, rate, offset, equal_stamps, backward_stamps }, ...]
    channel = [{ stream, field, quantity, role, unit, name, scale, offset, noise }, ...]

"?" stands for what only the user knows; such a line is refused by its number.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from twin.foundation.errors import DataError, join_problems, short_repr
from twin.foundation.file_schema import TableSchema, Text, TextLine, validate_table
from twin.foundation.files import parse_toml, prefix_errors, read_utf8
from twin.measurements.channels import Channel
from twin.measurements.logs.guess import UNKNOWN
from twin.measurements.parsing.quantity_strings import parse_number, parse_quantity, parse_vector
from twin.measurements.parsing.toml_text import toml_value

MAP_FORMAT = "twin-import/1"
MAX_MAP_BYTES = 8 * 2**20  # bytes
_FILL_IN = {
    "robot": "a robot's name (twin robots lists them) or the path to its folder from this file", "source": "hardware or simulation",
    "role": "input, output or context", "unit": "the unit of the numbers in the log", "time_unit": "s, ms, us or ns",
    "quantity": "what it is, a channel name of models/measurements.md", "rate": 'rows a second, such as "100 Hz"',
}  # fmt: skip


class CutTable(TableSchema):
    """How a take is cut into trials."""

    gap: str | None = Field(None, description="a pause of all streams that ends a trial")
    every: str | None = Field(None, description="how long each trial is; the last may be shorter")
    stream: str | None = Field(None, description="the stream of marks; without field each of its rows begins a trial")
    field: str | None = Field(None, description="the field of marks: each change of its value begins a trial")
    only: Any = Field(None, description="keep only the rows while the field has this value")


class StreamTable(TableSchema):
    """The clock of a stream."""

    name: Text
    clock: Text
    time_unit: Literal["s", "ms", "us", "ns", "?"] | None = Field(None, description="what the clock counts")
    rate: str | None = Field(None, description="for a clock that counts rows")
    offset: str = Field("0 s", description="added to the stamps")
    equal_stamps: Literal["refuse", "mean", "first"] = Field("refuse", description="rows with the same stamp")
    backward_stamps: Literal["refuse", "sort", "cut"] = Field("refuse", description="rows earlier than the one before")


class ChannelTable(TableSchema):
    """One field that is imported."""

    stream: Text
    field: Text
    quantity: Text
    role: Text
    unit: Text
    name: Text = Field("", description="the column; left out: the quantity")
    scale: Any = 1.0
    offset: Any = 0.0
    noise: Any = None


class MapTable(TableSchema):
    """The top of a map."""

    format: str
    robot: TextLine
    title: Text = ""
    source: TextLine
    gravity: Any = None
    cut: Any = None
    stream: list[Any] = Field([])
    channel: list[Any] = Field([])


@dataclass(frozen=True)
class StreamClock:
    """How a stream's rows are stamped."""

    clock: str
    unit: str | None
    rate: float | None  # counts a second, of a clock that counts rows
    offset: float  # s
    equal: str
    backward: str


@dataclass(frozen=True)
class MappedChannel:
    """A channel and the field it comes from."""

    stream: str
    field: str
    channel: Channel


@dataclass(frozen=True)
class ImportMap:
    """A map that has been read: everything is known."""

    path: Path
    robot: str
    title: str
    source: str
    gravity: Any
    cut: CutTable | None
    gap: float | None  # s
    every: float | None  # s
    clocks: Mapping[str, StreamClock]
    channels: tuple[MappedChannel, ...]


def read_map(path: Path) -> ImportMap:
    """Read a map. Raises DataError that names all lines to fill in or to correct."""
    data = read_utf8(path, MAX_MAP_BYTES)
    lines = data.decode().split("\n")
    problems: list[str] = []
    with prefix_errors(path):
        table = parse_toml(data)
        if table.get("format") != MAP_FORMAT:
            raise DataError(f'format is {short_repr(table.get("format"))}; a map begins with format = "{MAP_FORMAT}"')
        top = validate_table(MapTable, table, "", problems)
        if top is None:
            raise DataError(join_problems(problems))
        channels = [validate_table(ChannelTable, each, _place(lines, each), problems) for each in top.channel]
        kept = [each for each in channels if each is not None]
        cut, gap, every = _cut(top.cut, problems)
        used = {each.stream for each in kept} | ({cut.stream} if cut is not None else set())
        streams = [validate_table(StreamTable, each, _place(lines, each), problems) for each in top.stream]
        if problems:
            raise DataError(join_problems(problems))
        if not kept:
            raise DataError("no channel is chosen; remove the # before those to import and fill them in")
        tables = [*kept, *(each for each in streams if each is not None and each.name in used)]
        if unknown := _to_fill_in(top, tables, lines):
            raise DataError(join_problems(unknown))
        clocks = {each.name: made for each in streams if each and each.name in used and (made := _clock(each, lines, problems))}
        mapped = [made for each in kept if (made := _channel(each, lines, problems))]
        gravity = None if top.gravity is None else parse_vector(top.gravity, "m/s^2")
        _check_names(mapped, problems)
        if problems:
            raise DataError(join_problems(problems))
    return ImportMap(path, top.robot, top.title, top.source, gravity, cut, gap, every, clocks, tuple(mapped))


def _place(lines: list[str], table: Any) -> str:
    """Return the line of a channel or stream, by what it names."""
    if not isinstance(table, Mapping):
        return "the map"
    wanted = [f"{key} = {toml_value(str(table[key]))}" for key in ("stream", "field", "name") if key in table]
    for number, line in enumerate(lines, start=1):
        plain = " ".join(line.split())
        if not plain.startswith("#") and wanted and all(each in plain for each in wanted):
            return f"line {number}"
    return "the map"


def _to_fill_in(top: MapTable, tables: list[Any], lines: list[str]) -> list[str]:
    """Return a problem for each "?" in the lines that are used."""
    found = []
    for key in ("robot", "source"):
        if getattr(top, key).strip() == UNKNOWN:
            number = next((n for n, line in enumerate(lines, start=1) if line.split("=")[0].strip() == key), 0)
            found.append(f'line {number}: {key} = "?"; fill in {_FILL_IN[key]}')
    for table in tables:
        what = table.model_dump()
        open_keys = [key for key in what if what[key] == UNKNOWN]
        if open_keys:
            place = _place(lines, {key: value for key, value in what.items() if value})
            asked = ", ".join(f'{key} = "?" ({_FILL_IN.get(key, "fill it in")})' for key in open_keys)
            named = f"{what.get('field') or 'the clock'} of {what.get('stream') or what['name']}"
            found.append(f"{place}, {named}: {asked}; fill in, or put # before the line")
    return found


def _cut(table: Any, problems: list[str]) -> tuple[CutTable | None, float | None, float | None]:
    """Return what a map says of trials, and the pause that ends one and the length of each (s), where it says so."""
    cut = None if table is None else validate_table(CutTable, table, "cut", problems)
    if cut is None:
        return None, None, None
    ways = [way for way in (cut.gap, cut.every, cut.stream) if way is not None]
    if len(ways) != 1 or (cut.only is not None and cut.field is None):
        problems.append('cut: give one of gap = "1 s", every = "25 s", and stream with field (and only) or without')
        return None, None, None
    times: list[float | None] = []
    for written in (cut.gap, cut.every):
        try:
            times.append(None if written is None else parse_quantity(written, "s"))
            if times[-1] is not None and not times[-1] > 0.0:
                raise DataError(f"{short_repr(written)} is no time; write a positive one")
        except DataError as fault:
            problems.append(f"cut: {fault}")
            return None, None, None
    return cut, times[0], times[1]


def _clock(table: StreamTable, lines: list[str], problems: list[str]) -> StreamClock | None:
    try:
        rate = None if table.rate is None else parse_quantity(table.rate, "Hz")
        if rate is not None and rate <= 0.0:
            raise DataError(f"rate {short_repr(table.rate)} is not positive")
        offset = parse_quantity(table.offset, "s")
    except DataError as fault:
        problems.append(f"{_place(lines, table.model_dump(exclude_none=True))}, clock of {table.name}: {fault}")
        return None
    return StreamClock(table.clock, table.time_unit, rate, offset, table.equal_stamps, table.backward_stamps)


def _channel(table: ChannelTable, lines: list[str], problems: list[str]) -> MappedChannel | None:
    name = table.name or table.quantity
    try:
        if any(letter in name for letter in ',"\n\r') or name.strip() != name or name == "time":
            raise DataError(f"name {short_repr(name)} is no column's; write one without commas and quotes, other than time")
        quantity = "" if name == table.quantity else table.quantity
        factor, offset = parse_number(table.scale), parse_number(table.offset)
        role: Any = table.role
        channel = Channel(name, role, table.unit, None, quantity, factor, offset)
        if table.noise is not None:
            noise = float(channel.unit_scale.without_offset().to_si(parse_number(table.noise)))
            channel = Channel(name, role, table.unit, noise, quantity, factor, offset)
    except DataError as fault:
        problems.append(f"{_place(lines, table.model_dump(exclude_defaults=True))}, {table.field} of {table.stream}: {fault}")
        return None
    return MappedChannel(table.stream, table.field, channel)


def _check_names(mapped: list[MappedChannel], problems: list[str]) -> None:
    names = [each.channel.name for each in mapped]
    for name in sorted({name for name in names if names.count(name) > 1}):
        problems.append(f"two channels are named {name}; give one another name = ...")
