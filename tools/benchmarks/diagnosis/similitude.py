"""The same bench day on a robot of another size: what the diagnosis says must not depend on it.

    python -m tools.benchmarks.diagnosis.similitude SET OUT --lengths 3 --masses 20
    twin diagnose OUT/day

Every length is multiplied by `--lengths` (lambda), every mass by `--masses` (mu) and every time by sqrt(lambda), so that gravity
stays what it is: forces go with mu, moduli with mu / lambda^2. By dimensional analysis (Buckingham 1914) the new set is what the
same experiment gives on that robot. Temperatures, currents and angles stay.

Writes OUT/robot and OUT/day, of trials in CSV. Raises DataError for a factor that is not positive, and for a condition of a trial
that it does not know how to grow.
"""

import csv
import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pint
import tomli_w
import tyro

from twin.foundation.errors import DataError
from twin.robots.robot import models_folder

_UNITS = pint.UnitRegistry()
KNOWN_CONDITIONS = {"file", "start", "tip_payload", "ambient_temperature", "gravity"}  # of a trial; the last two stay


def factor(unit: str, lengths: float, masses: float) -> float:
    """By how much a quantity in `unit` grows."""
    grows = {"[length]": lengths, "[mass]": masses, "[time]": math.sqrt(lengths)}
    dimensions = _UNITS.parse_units(unit).dimensionality
    return math.prod(grows.get(str(name), 1.0) ** float(power) for name, power in dimensions.items())


def resized(folder: Path, out: Path, lengths: float, masses: float) -> Path:
    """The set in `folder` and the robot that it names, of another size; the folder of the new set."""
    if not (lengths > 0 and masses > 0):
        raise DataError(f"factors of lengths and masses must be positive, got {lengths:g} and {masses:g}")

    def by(unit: str) -> float:
        return factor(unit, lengths, masses)

    told = tomllib.loads((folder / "measurements.toml").read_text(encoding="utf-8"))
    robot = models_folder() / told["robot"] if "/" not in told["robot"] else (folder / told["robot"]).resolve()
    described = tomllib.loads((robot / "robot.toml").read_text(encoding="utf-8"))
    for entry in [*described["parameters"].values(), described["accuracy"]]:
        _grow(entry, by)
    for law in described.get("effect", ()):
        for entry in law["parameters"].values():
            _grow(entry, by)
    _write(out / "robot" / "robot.toml", described)

    grown = {"time": by("s")} | {channel["name"]: by(channel["unit"]) for channel in told["channel"]}
    for channel in told["channel"]:
        if "noise" in channel:
            channel["noise"] *= by(channel["unit"])
    for trial in told["trial"]:
        if other := trial.keys() - KNOWN_CONDITIONS:
            raise DataError(f"{trial['file']}: not known how to grow {', '.join(sorted(other))}; leave the trial out")
        if "start" in trial:
            trial["start"] *= by("s")
        if "tip_payload" in trial:
            value, unit = str(trial["tip_payload"]).split()
            trial["tip_payload"] = f"{float(value) * by(unit)!r} {unit}"
    _write(out / "day" / "measurements.toml", told | {"robot": "../robot"})
    for trial in told["trial"]:
        _rewrite(folder / trial["file"], out / "day" / trial["file"], grown)
    return out / "day"


def _grow(entry: dict[str, Any], by: Callable[[str], float]) -> None:
    for key in {"value", "std", "low", "high"} & entry.keys():
        entry[key] = _times(entry[key], by(entry["unit"]))


def _times(value: Any, by: float) -> Any:
    return [_times(one, by) for one in value] if isinstance(value, list) else value * by


def _write(file: Path, table: dict[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(tomli_w.dumps(table).encode())


def _rewrite(source: Path, target: Path, grown: dict[str, float]) -> None:
    with source.open(newline="", encoding="utf-8") as read, target.open("w", newline="", encoding="utf-8") as written:
        rows = csv.reader(read)
        names = next(rows)
        out = csv.writer(written)
        out.writerow(names)
        for row in rows:
            out.writerow([repr(float(text) * grown[name]) if text.strip() else "" for name, text in zip(names, row, strict=True)])


def main(folder: tyro.conf.Positional[Path], out: tyro.conf.Positional[Path], lengths: float = 1.0, masses: float = 1.0) -> None:
    """Write the set and the robot of another size."""
    print(resized(folder, out, lengths, masses))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
