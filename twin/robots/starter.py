"""A folder to begin one's own robot with: a `robot.toml` that loads, a README, and a measurement set to fill.

The numbers are those of a robot of that family that ships with the twin, each under the words of its schema.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

from twin.errors import DataError, UnknownNameError, shown
from twin.measurements.toml_text import toml_lines, toml_value
from twin.robots.family import families, family
from twin.robots.numbers import Line, as_written, lines
from twin.robots.robot import FORMAT, Robot, available, load
from twin.robots.schema import NOT_WRITTEN
from twin.units import unit_scale

SOURCE = "example: where does this number come from?"
SET = "samples/first"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


def write_starter(name: str, family: str, place: Path) -> Path:
    """Writes the folder `place`/`name` whole or not at all, and returns it.

    Raises UnknownNameError for an unknown family, DataError for a name that is no simple one, that a shipped robot has, or where
    something is already.
    """
    if family not in families():
        raise UnknownNameError("family", family, families())
    if not _NAME.fullmatch(name) or name in available():
        taken = f" that is none of {', '.join(available())}"
        raise DataError(f"{shown(name)} cannot be a robot's name; write up to 64 letters, digits, - and _{taken}")
    folder = place / name
    draft = place / f".{name}.{os.getpid()}.writing"
    robot = next(r for r in map(load, available()) if r.family == family)
    try:
        if folder.exists():
            raise DataError(f"{folder} is there already and is not overwritten; choose another name, or another place with --out")
        (draft / SET).mkdir(parents=True)
        try:
            (draft / "robot.toml").write_text(robot_text(name, robot), "utf-8")
            (draft / "README.md").write_text(readme_text(name), "utf-8")
            write_set(draft / SET, robot)
            draft.rename(folder)
        except BaseException:
            shutil.rmtree(draft, ignore_errors=True)
            raise
    except OSError as error:
        raise DataError(f"{folder}: cannot be written ({error.strerror or error}); choose another place with --out") from None
    return folder


def robot_text(name: str, robot: Robot) -> str:
    """A commented `robot.toml` with the numbers of `robot`, without what is in force in some uses only (groups)."""
    schema = family(robot.family).SCHEMA
    head = [
        f"# {name}: replace every number by your robot's, and say in `source` where it comes from.",
        "# `std` marks what a built robot may differ in (one standard deviation, same unit): those are fitted to data.",
        "# `low` and `high` are hard bounds. A list has one number for each, fitted one by one; a number alone, where it may stand",
        "# for all, is fitted as one: of disks that are built unlike each other what is left then passes for a missing effect.",
        "#", *(f"#  {line}".rstrip() for line in schema.picture.splitlines()),
        *toml_lines({"format": FORMAT, "family": robot.family, "title": f"{name}, described by its builder"}), "", "[structure]",
    ]  # fmt: skip
    for key, field in schema.structure.model_fields.items():
        given = key in robot.structure
        text = toml_lines({key: robot.structure[key]})[0] if given else f"# {key} ="
        head.append(f"{text}  # {field.description}")
    body = ["", "[parameters]"]
    for line in lines(robot):
        if not line.row.group:
            given = line.parameters[0].source != NOT_WRITTEN
            body += [f"# {line.row.meaning}; {line.row.range()}", _entry(line) if given else f"# {_entry(line)}"]
    gravity = robot.gravity.tolist()
    tail = ["", "[gravity]  # in the base frame", *toml_lines({"value": gravity, "unit": "m/s^2", "source": SOURCE}), ""]
    usual = schema.accuracy.usual
    accuracy = {
        "value": float(f"{robot.accuracy / unit_scale(usual, schema.accuracy.unit).to_si(1.0):.6g}"),
        "unit": usual,
        "source": SOURCE,
    }
    tail += [f"[accuracy]  # {schema.accuracy.meaning}", *toml_lines(accuracy)]
    return "\n".join([*head, *body, *tail]) + "\n"


def _entry(line: Line) -> str:
    p = line.parameters[0]
    entry: dict[str, object] = {"value": line.values if p.name != line.row.name else line.values[0], "unit": line.unit}
    if p.std is not None:
        entry |= {"std": line.spread, "low": as_written(p, p.low), "high": as_written(p, p.high)}
    return f'"{line.row.name}" = {toml_value({**entry, "source": SOURCE})}'


def write_set(folder: Path, robot: Robot) -> None:
    """A measurement set without measurements: two trials whose files have a header only."""
    schema = family(robot.family).SCHEMA
    channels = schema.logged(schema.structure.model_validate(dict(robot.structure)))
    text = [
        "# One [[channel]] a column of the CSV files, one [[trial]] a file. Every key and every channel's name: models/README.md.",
        "# Times in seconds, each trial from rest; an empty cell is a missing value. Fill the files, then: twin diagnose " + SET,
        *toml_lines({"format": "twin-measurements/1", "robot": "../..", "title": "First bench day", "source": "hardware"}),
    ]
    for name, role, unit, noise in channels:
        text += ["", "[[channel]]", *toml_lines({"name": name, "role": role, "unit": unit, "noise": noise})]
    for n in (1, 2):
        text += ["", "[[trial]]", *toml_lines({"file": f"trial_{n}.csv", "start": 600.0 * (n - 1)})]
    (folder / "measurements.toml").write_text("\n".join(text) + "\n", "utf-8")
    for n in (1, 2):
        (folder / f"trial_{n}.csv").write_text(",".join(["time", *(channel[0] for channel in channels)]) + "\n", "utf-8")


def readme_text(name: str) -> str:
    return f"""# {name}

What it is, who built it, where its numbers come from.

    twin robots .                # draws it and prints its numbers: is every unit right?
    twin diagnose {SET}   # once its trials are filled

Every key, unit and sign: models/README.md of the twin.
"""
