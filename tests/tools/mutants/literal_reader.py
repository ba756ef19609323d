"""A second reader, strict and slow: what a file says to the letter, and whether what the program read is that.

It shares no code with the program's readers: tomllib, csv, numpy and pint alone. Each function raises `Differs` where something
written is not in what was read, or the other way round.
"""

from __future__ import annotations

import csv
import io
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pyarrow.parquet

from twin.measurements import Recording
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import correlations
from twin.robots import Robot
from twin.robots.schema import SOURCE_OF_DEFAULT

REGISTRY = pint.UnitRegistry()
TITLE = "title"
PITCHES = 5e-3  # relative: how far a stated length may be from the sum of the pitches (models/README.md)


class Differs(Exception):
    """What was read is not what was written."""


def same(what: str, written: object, read: object) -> None:
    if isinstance(written, bool) is not isinstance(read, bool):
        raise Differs(f"{what}: {written!r} was read as {read!r}")
    if isinstance(written, float) and isinstance(read, float):
        if not (math.isclose(written, read, rel_tol=1e-12, abs_tol=1e-300) or (math.isnan(written) and math.isnan(read))):
            raise Differs(f"{what}: {written!r} was read as {read!r}")
    elif written != read:
        raise Differs(f"{what}: {written!r} was read as {read!r}")


def plain(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Differs(f"{what}: {value!r} was taken for a number")
    return float(value)


def si(value: object, unit: object, si_unit: str, what: str, difference: bool = False) -> float:
    """A number with its unit in `si_unit`, by pint; an angle is a dimension of its own."""
    if not isinstance(unit, str) or not unit.strip() or REGISTRY.Quantity(1.0, unit).to_root_units().units != (
        REGISTRY.Quantity(1.0, si_unit).to_root_units().units
    ):  # fmt: skip
        raise Differs(f"{what}: unit {unit!r} was taken for {si_unit}")
    quantity = REGISTRY.Quantity(plain(value, what), unit)
    if difference:
        one, zero = (REGISTRY.Quantity(n, unit).to(si_unit) for n in (1.0, 0.0))
        return float((one - zero).magnitude) * plain(value, what)
    return float(quantity.to(si_unit).magnitude)


def only(what: str, table: object, keys: str) -> Mapping[str, Any]:
    if not isinstance(table, dict) or set(table) - set(keys.split()):
        raise Differs(f"{what}: {table!r} has what nobody reads")
    return table


def flat(value: object, name: str) -> dict[str, object]:
    if not isinstance(value, list):
        return {name: value}
    return {key: each for k, part in enumerate(value, 1) for key, each in flat(part, f"{name}_{k}").items()}


def text_of(path: Path) -> str:
    return path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")


def check_robot(path: Path, robot: Robot) -> None:
    file = only("robot.toml", tomllib.loads(text_of(path)), "format family title structure parameters gravity accuracy effect")
    same("format", file["format"], "twin-robot/1")
    same("family", file["family"], robot.family)
    same("title", file["title"], robot.title)
    for key, value in file["structure"].items():
        same(f"structure.{key}", value, robot.structure.get(key))
    found = {p.name: p for p in robot.parameters if p.source != SOURCE_OF_DEFAULT}
    length = file["parameters"].pop("backbone.length", None)
    if length is not None:
        only("backbone.length", length, "value unit source")
    for name, entry in file["parameters"].items():
        only(name, entry, "value unit source std low high")
        for each, value in flat(entry["value"], name).items():
            p = found.pop(each, None)
            if p is None:
                raise Differs(f"{each} was not read")
            same(each, si(value, entry["unit"], p.unit, each), p.value)
            same(f"source of {each}", entry["source"], p.source)
            same(f"std of {each}", si(entry["std"], entry["unit"], p.unit, each, True) if "std" in entry else None, p.std)
            for key in {"low", "high"} & set(entry):
                same(f"{key} of {each}", si(entry[key], entry["unit"], p.unit, each), getattr(p, key))
    if found:
        raise Differs(f"{sorted(found)} are not in the file")
    if length is not None:
        n = robot.structure["disks"]
        values = {p.name: p.value for p in robot.parameters}
        total = sum(values.get(f"disks.pitch_{k}", values.get("disks.pitch", 0.0)) for k in range(1, n + 1))  # type: ignore[operator]
        if abs(si(length["value"], length["unit"], "m", "backbone.length") - total) > 1.01 * PITCHES * total:
            raise Differs("backbone.length is not the sum of the pitches")
    gravity = only("gravity", file["gravity"], "value unit source")
    same("gravity", [si(v, gravity["unit"], "m/s^2", "gravity") for v in gravity["value"]], robot.gravity.tolist())
    accuracy = only("accuracy", file["accuracy"], "value unit source")
    same(
        "accuracy",
        si(accuracy["value"], accuracy["unit"], "rad" if robot.family == "transmission" else "m", "accuracy"),
        robot.accuracy,
    )
    check_effects(file.get("effect", []), [(name, dict(values)) for name, values in robot.effects], Twin.of(robot))


def check_effects(written: list[Any], read: list[tuple[str, dict[str, float]]], twin: Twin) -> None:
    same("effects", [only("effect", e, "id parameters")["id"] for e in written], [name for name, _ in read])
    for entry, (name, values), effect in zip(written, read, twin.effects, strict=True):
        declared = {p.name: p for p in effect.all_parameters(effect.n_tendon)}
        written_values = entry.get("parameters", {})
        for key, value in values.items():
            p = declared[key]
            same(f"{name}.{key}", number_or_table(written_values[key], p.unit, key) if key in written_values else p.value, value)
        if set(written_values) - set(values):
            raise Differs(f"{name}: {sorted(set(written_values) - set(values))} were not read")


def number_or_table(entry: object, unit: str, what: str) -> float:
    if not isinstance(entry, dict):
        return plain(entry, what)
    only(what, entry, "value unit std")  # std is for people: a twin holds no standard errors
    return si(entry["value"], entry["unit"], unit, what)


def check_twin(path: Path, twin: Twin) -> None:
    file = only("twin.toml", tomllib.loads(text_of(path)), "format robot parameters effect correlation provenance")
    same("format", file["format"], "twin/1")
    same("robot", Path(file["robot"]).name, twin.robot.name)
    units = {p.name: p.unit for p in twin.robot.parameters}
    written = file.get("parameters", {})
    same("parameters", sorted(written), sorted(twin.values))
    for name, entry in written.items():
        same(name, number_or_table(entry, units[name], name), float(twin.values[name]))
    check_effects(file.get("effect", []), [(e.id, e.values) for e in twin.effects], twin)
    if "correlation" in file:
        check_correlation(file["correlation"], path)


def check_correlation(table: object, path: Path) -> None:
    """Of the errors, which a twin holds no more than its standard errors: read apart."""
    written, read = only("correlation", table, "parameters matrix"), correlations(path)
    names, matrix = written["parameters"], np.array([[plain(x, "matrix") for x in row] for row in written["matrix"]])
    if matrix.size and (matrix.shape != (len(names),) * 2 or np.abs(matrix - matrix.T).max() > 1e-3 or np.abs(matrix).max() > 1.0):
        raise Differs(f"correlation: {table!r} was taken for one")
    same("correlation", read, {(a, b): float(matrix[i, j]) for i, a in enumerate(names) for j, b in enumerate(names)})


SI = {
    "tension": "N", "displacement": "m", "current": "A", "voltage": "V", "temperature": "K", "resistance": "ohm", "angle": "rad",
    "torque": "N*m", "x": "m", "y": "m", "z": "m",
}  # fmt: skip
CONDITIONS = {"tip_payload": "kg", "ambient_temperature": "K", "gravity": "m/s^2", "tip_force": "N"}


def check_set(folder: Path, recording: Recording) -> None:
    file = only(
        "measurements.toml", tomllib.loads(text_of(folder / "measurements.toml")), "format robot title source gravity channel trial"
    )
    same("format", file["format"], "twin-measurements/1")
    for key, default in (("robot", None), (TITLE, ""), ("source", "not stated")):
        same(key, file.get(key, default), getattr(recording, key))
    same(
        "gravity",
        vector(file["gravity"], "gravity") if "gravity" in file else None,
        None if recording.gravity is None else recording.gravity.tolist(),
    )
    same("channels", [c["name"] for c in file["channel"]], [c.name for c in recording.channels])
    for entry, channel in zip(file["channel"], recording.channels, strict=True):
        only("channel", entry, "name role unit noise")
        same("role", entry["role"], channel.role)
        unit = SI[entry["name"].rpartition("_")[2]]
        si(1.0, entry["unit"], unit, entry["name"])
        noise = si(entry["noise"], entry["unit"], unit, "noise", True) if "noise" in entry else None
        same("noise", noise, None if channel.noise is None else float(channel.noise))
    trials = {trial.name: trial for trial in recording.trials}
    for entry in file["trial"]:
        name = next(n for n in (entry["file"], f"{entry['file']}.csv", f"{entry['file']}.parquet") if (folder / n).is_file())
        name = str(Path(name))
        trial = trials.pop(name, None)
        if trial is None:
            if not any(notice.startswith(f"{name} is left out") for notice in recording.notices):
                raise Differs(f"{name} was dropped in silence")
            continue
        same("start", plain(entry["start"], "start") if "start" in entry else None, trial.start)
        for key, value in entry.items():
            if key in CONDITIONS:
                read = trial.conditions[key]
                same(key, vector(value, key) if np.ndim(read) else quantity(value, key), np.asarray(read).tolist())
            elif key not in ("file", "start", "cloud") and not any(repr(key)[:50] in notice for notice in recording.notices):
                raise Differs(f"condition {key} was ignored in silence")
        check_table(folder / name, file["channel"], trial, recording.notices)
        if "cloud" in entry:
            with np.load(folder / entry["cloud"], allow_pickle=False) as arrays:
                for key in ("points", "offsets", "time"):
                    if not np.array_equal(arrays[key].astype(float), np.asarray(getattr(trial.clouds, key), float)):
                        raise Differs(f"cloud {key}")
    if trials:
        raise Differs(f"{sorted(trials)} are not in the file")


def quantity(value: str, name: str) -> float:
    number, _, unit = value.strip().partition(" ")
    return si(float(number), unit, CONDITIONS[name], name)


def vector(value: object, name: str) -> list[float]:
    if isinstance(value, str):
        inside, _, unit = value.strip().removeprefix("[").partition("]")
        return [si(float(part), unit.strip(), CONDITIONS[name], name) for part in inside.split(",")]
    return [quantity(part, name) if isinstance(part, str) else plain(part, name) for part in value]  # type: ignore[union-attr]


def check_table(path: Path, channels: list[Any], trial: Any, notices: tuple[str, ...]) -> None:
    if path.suffix == ".parquet":
        wanted = ["time", *(entry["name"] for entry in channels)]  # the pages of others may be damaged
        table = pyarrow.parquet.read_table(path, columns=wanted)
        columns: dict[str, list[Any]] = {name: [] for name in pyarrow.parquet.read_schema(path).names}
        columns |= {name: [math.nan if v is None else v for v in table.column(name).to_pylist()] for name in table.column_names}
    else:
        rows = list(csv.reader(io.StringIO(text_of(path).rstrip()), strict=True))
        columns = {name.strip(): [row[k] for row in rows[1:]] for k, name in enumerate(rows[0])}
    same("time", [cell(v) for v in columns["time"]], trial.time.tolist())
    for entry in channels:
        unit = SI[entry["name"].rpartition("_")[2]]
        written = REGISTRY.Quantity(np.array([cell(v) for v in columns[entry["name"]]]), entry["unit"]).to(unit).magnitude
        if not np.allclose(written, trial.values[entry["name"]], rtol=1e-12, atol=0.0, equal_nan=True):
            raise Differs(f"{entry['name']} was read as {trial.values[entry['name']][:5]}")
    extra = [name for name in columns if name != "time" and name not in {c["name"] for c in channels}]
    said = " ".join(notices)
    if not (f"{len(extra)} columns" in said or all(repr(name)[:50] in said for name in extra)):
        raise Differs(f"columns {extra[:3]} were ignored in silence")


def cell(value: object) -> float:
    if isinstance(value, bool):
        raise Differs(f"{value!r} was taken for a number")
    if isinstance(value, int | float):
        return float(value)
    text = str(value).strip()
    if text.lower() in ("", "nan", "+nan", "-nan"):
        return math.nan
    if not set(text) <= set("0123456789+-.eE"):
        raise Differs(f"cell {text[:40]!r} was taken for a number")
    return float(text)
