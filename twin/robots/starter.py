"""Starter folder for a user's own robot: a `robot.toml` that loads, a README, and a measurement set to fill.

The numbers are those of a robot of the same family that ships with the twin, each with the explanation from its schema, or those of
an MJCF of the user's own (`model_starter.py`).
"""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

from twin.foundation.errors import DataError, UnknownNameError, short_repr
from twin.foundation.files import written_whole
from twin.foundation.units import unit_scale
from twin.measurements.parsing.toml_text import toml_lines, toml_value
from twin.robots.family import family_names, load_family
from twin.robots.model_starter import assumed_widths, copy_model, model_text
from twin.robots.numbers import FileEntry, file_entries, in_file_unit
from twin.robots.robot import ROBOT_FILE, ROBOT_FORMAT, Robot, load, robot_names
from twin.robots.schema import SOURCE_OF_DEFAULT

EXAMPLE_SOURCE = "example: where does this number come from?"
FIRST_SET = "samples/first"
_ROBOT_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


def begin_robot(name: str, family: str | None, model: Path | None, place: Path) -> tuple[Path, list[str]]:
    """Write a robot's folder from a family's example or from an MJCF; return it, and remarks on what was assumed.

    Raises DataError unless just one of the two is given, and as `write_starter` and `write_model_starter`.
    """
    if (family is None) == (model is None):
        raise DataError(f"{name}: what it is made from is missing or told twice; give --family FAMILY or --mjcf MODEL.xml")
    if model is not None:
        folder, widths = write_model_starter(name, model, place)
        return folder, [widths]
    return write_starter(name, str(family), place), []


def write_starter(name: str, family: str, place: Path) -> Path:
    """Write the folder `place`/`name` whole or not at all, and return it.

    Raises UnknownNameError for an unknown family, DataError for an invalid name, a shipped robot's name or an existing folder.
    """
    if family not in family_names():
        raise UnknownNameError("family", family, family_names())
    robot = next(r for r in map(load, robot_names()) if r.family == family)

    def fill(draft: Path) -> Robot:
        (draft / ROBOT_FILE).write_text(robot_text(name, robot), "utf-8")
        if load_family(family).SCHEMA.model_file is not None:
            shutil.copy(str(robot.structure["model"]), draft)
        return robot

    return _write_whole(name, place, fill)


def write_model_starter(name: str, model: Path, place: Path) -> tuple[Path, str]:
    """Write the folder `place`/`name` of an MJCF, whole or not at all; return it, and which widths were assumed.

    Raises DataError as `write_starter`, and for a model that cannot be used.
    """
    said = []

    def fill(draft: Path) -> Robot:
        loaded = copy_model(model, draft)
        said.append(assumed_widths(loaded))
        (draft / ROBOT_FILE).write_text(model_text(name, model.name, loaded, ROBOT_FORMAT), "utf-8")
        return load(str(draft))

    return _write_whole(name, place, fill), said[0]


def _write_whole(name: str, place: Path, fill: Callable[[Path], Robot]) -> Path:
    """Write a robot's folder by `fill`, which returns the robot whose channels its empty set has."""
    if not _ROBOT_NAME.fullmatch(name) or name in robot_names():
        taken = ", ".join(robot_names())
        raise DataError(f"{short_repr(name)} cannot be a robot's name; write up to 64 letters, digits, - and _, none of {taken}")
    folder = place / name
    try:
        if folder.exists():
            raise DataError(f"{folder} is there already and is not overwritten; choose another name, or another place with --out")
        with written_whole(folder) as draft:
            (draft / FIRST_SET).mkdir(parents=True)
            robot = fill(draft)
            (draft / "README.md").write_text(readme_text(name), "utf-8")
            write_set(draft / FIRST_SET, robot)
    except OSError as error:
        raise DataError(f"{folder}: cannot be written ({error.strerror or error}); choose another place with --out") from None
    return folder


def robot_text(name: str, robot: Robot) -> str:
    """Return a commented `robot.toml` with the numbers of `robot`, without optional groups."""
    schema = load_family(robot.family).SCHEMA
    if schema.model_file is not None:
        return _model_text(name, robot)
    head = [
        f"# {name}: replace every number by your robot's, and say in `source` where it comes from.",
        "# `std` marks numbers in which a built robot may differ (one standard deviation, same unit): they are fitted to data.",
        "# `low` and `high` are hard bounds. A list has one number for each, all fitted; one number for all is fitted as one.",
        "# If your disks differ, give a list: otherwise their differences may look like a missing effect.",
        "#",
        *(f"#  {line}".rstrip() for line in schema.diagram.splitlines()),
        *toml_lines({"format": ROBOT_FORMAT, "family": robot.family, "title": f"{name}, described by its builder"}),
        "",
        "[structure]",
    ]
    for key, field in schema.structure.model_fields.items():
        given = key in robot.structure
        text = toml_lines({key: robot.structure[key]})[0] if given else f"# {key} ="
        head.append(f"{text}  # {field.description}")
    body = ["", "[parameters]"]
    for line in file_entries(robot):
        if not line.row.group:
            given = line.parameters[0].source != SOURCE_OF_DEFAULT
            body += [f"# {line.row.meaning}; {line.row.range_text()}", _entry_text(line) if given else f"# {_entry_text(line)}"]
    gravity = robot.gravity.tolist()
    tail = ["", "[gravity]  # in the base frame", *toml_lines({"value": gravity, "unit": "m/s^2", "source": EXAMPLE_SOURCE}), ""]
    usual = schema.accuracy.usual_unit
    accuracy = {
        "value": float(f"{robot.accuracy / unit_scale(usual, schema.accuracy.unit).to_si(1.0):.6g}"),
        "unit": usual,
        "source": EXAMPLE_SOURCE,
    }
    tail += [f"[accuracy]  # {schema.accuracy.meaning}", *toml_lines(accuracy)]
    return "\n".join([*head, *body, *tail]) + "\n"


def _model_text(name: str, robot: Robot) -> str:
    """Return the robot.toml of a robot whose numbers are those of a model beside it, under another title."""
    lines = (robot.folder / ROBOT_FILE).read_text("utf-8").splitlines()
    title = toml_lines({"title": f"{name}, described by its builder"})[0]
    head = f"# {name}: replace the model by your robot's, and say below in which of its numbers a built one may differ."
    return "\n".join([head, *(title if line.startswith("title") else line for line in lines if not line.startswith("#"))]) + "\n"


def _entry_text(line: FileEntry) -> str:
    p = line.parameters[0]
    entry: dict[str, object] = {"value": line.values if p.name != line.row.name else line.values[0], "unit": line.unit}
    if p.std is not None:
        entry |= {"std": line.std, "low": in_file_unit(p, p.low), "high": in_file_unit(p, p.high)}
    return f'"{line.row.name}" = {toml_value({**entry, "source": EXAMPLE_SOURCE})}'


def write_set(folder: Path, robot: Robot) -> None:
    """Write a measurement set without samples: two trials whose files have a header only."""
    schema = load_family(robot.family).SCHEMA
    channels = schema.usual_channels(schema.structure.model_validate(dict(robot.structure)))
    text = [
        "# One [[channel]] a column of the CSV files, one [[trial]] a file. Keys, names of channels: models/measurements.md.",
        "# Times in seconds, each trial from rest; an empty cell is a missing value. Fill the files, then: twin diagnose "
        + FIRST_SET,
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
    """Return the README of a new robot."""
    return f"""# {name}

What it is, who built it, where its numbers come from.

    twin robots .                # draws it and prints its numbers: is every unit right?
    twin diagnose {FIRST_SET}   # once its trials are filled

Every key, unit and sign: models/README.md of the twin.
"""
