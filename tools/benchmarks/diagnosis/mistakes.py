"""Mistakes of meaning and faults of devices, planted in a good set:  python -m tools.benchmarks.diagnosis.mistakes SET [name ...]

Every mistake leaves a file that reads well and means something else. The table says of each whether the reader or the prediction
refused it, whether the diagnosis said it before any fit, or whether it was missed. The faults are in `faults.py`.
"""

import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table
from rich.text import Text

from tools.benchmarks.diagnosis.faults import FAULTS
from tools.benchmarks.diagnosis.tables import Columns, read_columns, write_columns
from twin.diagnosis import Settings, preview_data
from twin.foundation.errors import TwinError
from twin.measurements import read
from twin.prediction.own_clocks import on_rows_of_outputs
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

Edit = Callable[[Columns], Columns]


def _tables(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.csv"))


def _edited(folder: Path, change: Edit, only: str = "") -> None:
    for path in _tables(folder):
        if path.stem == only or not only:
            before = read_columns(path)
            after = change(before)
            if all(np.array_equal(v, before[n], equal_nan=True) for n, v in after.items()):
                raise ValueError(f"{path} has no column of the kind")
            write_columns(path, after)


def _scaled(pattern: str, factor: float, offset: float = 0.0) -> Callable[[Path], None]:
    """Numbers of the columns that match, in another unit than the file says."""

    def plant(folder: Path) -> None:
        _edited(folder, lambda c: {n: v * factor + offset if re.fullmatch(pattern, n) else v for n, v in c.items()})

    return plant


def _exchanged(*pairs: tuple[str, str]) -> Callable[[Path], None]:
    """Columns under each other's names; in a pair the part of a name that differs."""

    def plant(folder: Path) -> None:
        def change(c: Columns) -> Columns:
            other = {}
            for name in c:
                own = next((p for p in pairs if any(re.fullmatch(f"{x}(_[xyz])?", name) for x in p)), None)
                other[name] = name
                if own is not None:
                    a, b = own if name.startswith(own[0]) else own[::-1]
                    other[name] = name.replace(a, b, 1)
            return {name: c[other[name]] for name in c}

        _edited(folder, change)

    return plant


def _framed(turn: np.ndarray, shift: tuple[float, float, float] = (0.0, 0.0, 0.0), only: str = "") -> Callable[[Path], None]:
    """Markers in another frame, or (`only` one trial) of a robot of another size."""

    def plant(folder: Path) -> None:
        def change(c: Columns) -> Columns:
            out = dict(c)
            for name in {n[:-2] for n in c if re.fullmatch(r"(disk|marker)_\d+_[xyz]|tip_[xyz]", n)}:
                axes = [f"{name}_{a}" for a in "xyz" if f"{name}_{a}" in c]
                if len(axes) == 3:
                    moved = np.stack([c[a] for a in axes], axis=1) @ turn.T + shift
                    out |= dict(zip(axes, moved.T, strict=True))
            return out

        _edited(folder, change, only)

    return plant


def _text(pattern: str, into: str, count: int = 0) -> Callable[[Path], None]:
    """measurements.toml with what matches written otherwise."""

    def plant(folder: Path) -> None:
        file = folder / "measurements.toml"
        text, n = re.subn(pattern, into, file.read_text(), count=count, flags=re.MULTILINE)
        if not n:
            raise ValueError(f"nothing in {file} matches {pattern}")
        file.write_text(text)

    return plant


def _constant(pattern: str, value: float = 0.0) -> Callable[[Path], None]:
    """A channel that died before the first trial and logs one value."""

    def plant(folder: Path) -> None:
        _edited(folder, lambda c: {n: np.full_like(v, value) if re.fullmatch(pattern, n) else v for n, v in c.items()})

    return plant


def _clouds(turn: np.ndarray, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Callable[[Path], None]:
    """Point clouds in another unit or frame, or of another robot."""

    def plant(folder: Path) -> None:
        files = sorted(folder.glob("*.clouds.npz"))
        if not files:
            raise ValueError(f"{folder} has no clouds")
        for file in files:
            arrays = dict(np.load(file))
            np.savez_compressed(file, **(arrays | {"points": arrays["points"] @ turn.T + shift}))

    return plant


def _twice(trial: str) -> Callable[[Path], None]:
    """One trial's file under a second name, listed at the end of the day."""

    def plant(folder: Path) -> None:
        shutil.copy(folder / f"{trial}.csv", folder / f"{trial}_again.csv")
        file = folder / "measurements.toml"
        block = next(b for b in re.split(r"(?=^\[\[trial\]\])", file.read_text(), flags=re.M) if f'"{trial}.csv"' in b)
        block = re.sub(r"^start.*$", "start = 90000.0", block.replace(trial, f"{trial}_again"), flags=re.M)
        file.write_text(file.read_text() + "\n" + block)

    return plant


def _rescaled_robot(pattern: str, factor: float) -> Callable[[Path], None]:
    """The set's own copy of the robot, with one number of robot.toml in another unit."""

    def plant(folder: Path) -> None:
        source = load("continuum").folder / "robot.toml"
        lines = source.read_text().splitlines()
        shutil.rmtree(folder / "robot", ignore_errors=True)
        (folder / "robot").mkdir()

        def other(line: str) -> str:
            head, tail = line.split("value = ", 1)
            value = float(tail.split(",", 1)[0])
            for limit in ("low", "high", "std"):
                tail = re.sub(rf"{limit} = [-\d.]+, ", "", tail)
            return f"{head}value = {value * factor!r},{tail.split(',', 1)[1]}"

        (folder / "robot/robot.toml").write_text("\n".join(other(x) if x.startswith(pattern) else x for x in lines) + "\n")
        _text(r"^robot\s*=.*$", 'robot = "robot"')(folder)

    return plant


QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
POSITION, DISPLACEMENT, TENSION = r"(disk|marker)_\d+_[xyz]", r"tendon_\d+_displacement", r"tendon_\d+_tension"

MISTAKES: dict[str, Callable[[Path], None]] = {
    "positions in m under mm": _scaled(POSITION, 1e-3),
    "positions in mm under m": _text(r'unit = "mm"\nnoise = 0.25', 'unit = "m"\nnoise = 0.00025'),
    "tension in mN under N": _scaled(TENSION, 1e3),
    "tension in N under mN": _scaled(TENSION, 1e-3),
    "displacement in m under mm": _scaled(DISPLACEMENT, 1e-3),
    "displacement in um under mm": _scaled(DISPLACEMENT, 1e3),
    "time in ms": _scaled("time", 1e3),
    "time in thousands of seconds": _scaled("time", 1e-3),
    "room in K under degC": _scaled("ambient_temperature", 1.0, 273.15),
    "room in degF under degC": _scaled("ambient_temperature", 1.8, 32.0),
    "payload in kg for g": _text(r'tip_payload = "(\S+) g"', r'tip_payload = "\1 kg"'),
    "payload in mg for g": _text(r'tip_payload = "(\S+) g"', r'tip_payload = "\1 mg"'),
    "displacement of the wrong sign": _scaled(DISPLACEMENT, -1.0),
    "tension of the wrong sign": _scaled(TENSION, -1.0),
    "gravity of the wrong sign": _text(
        r"^gravity = \[(-?)([\d.]+), (-?)([\d.]+), (-?)([\d.]+)\]", "gravity = [-\\1\\2, -\\3\\4, -\\5\\6]"
    ),
    "gravity in g": _text(r"9\.81\b", "1.0"),
    "mirrored marker frame": _framed(np.diag([-1.0, 1.0, 1.0])),
    "marker frame turned by 90 degrees": _framed(QUARTER),
    "marker frame turned by 180 degrees": _framed(np.diag([-1.0, -1.0, 1.0])),
    "marker axes permuted": _framed(np.roll(np.eye(3), 1, axis=0)),
    "tendons 1 and 2 exchanged": _exchanged(
        ("tendon_1_tension", "tendon_2_tension"), ("tendon_1_displacement", "tendon_2_displacement")
    ),
    "disks 6 and 7 exchanged": _exchanged(("disk_6", "disk_7")),
    "disks counted from the tip": _exchanged(*((f"disk_{k}", f"disk_{9 - k}") for k in range(1, 5))),
    "a trial twice": _twice("slow_1"),
    "a trial of another robot": _framed(100.0 / 120.0 * np.eye(3), only="slow_2"),
    "a marker that is not tracked": _constant(r"disk_6_[xyz]"),
    "resistances in kohm under ohm": _scaled(r"sensor_\d+_resistance", 1e-3),
    "a strain sensor that is shorted": _constant("sensor_2_resistance", 0.2),
    "a strain sensor that is open": _constant("sensor_2_resistance", 9.9e6),
    "a strain sensor that stands still": _constant("sensor_2_resistance", 1000.0),
    "strain sensors 1 and 3 exchanged": _exchanged(("sensor_1_resistance", "sensor_3_resistance")),
    "strain sensors 1 and 2 exchanged": _exchanged(("sensor_1_resistance", "sensor_2_resistance")),
    "clouds in mm": _clouds(1e3 * np.eye(3)),
    "clouds in another frame": _clouds(QUARTER, (0.02, 0.0, 0.03)),
    "clouds of a finger half as large again": _clouds(1.5 * np.eye(3)),
    "markers turned by 16 degrees about the axis": _framed(
        np.array([[np.cos(0.28), -np.sin(0.28), 0.0], [np.sin(0.28), np.cos(0.28), 0.0], [0.0, 0.0, 1.0]])
    ),
    "a load cell that is not plugged in": _constant("tendon_2_tension"),
    "origin of the markers shifted": _framed(np.eye(3), (0.0, 15.0, 20.0)),
    "start in minutes": _text(r"^start = ([\d.]+)", lambda m: f"start = {float(m[1]) / 60:.3f}"),  # type: ignore[arg-type]
    "a start missing": _text(r"^start = [1-9].*\n", "", count=1),
    "marker noise in m under mm": _text(r"noise = 0.25", "noise = 0.00025"),
    "marker noise in um under mm": _text(r"noise = 0.25", "noise = 250.0"),
    "hole radius in m for mm": _rescaled_robot('"tendons.radius"', 1e-3),
    "modulus in MPa for GPa": _rescaled_robot('"backbone.youngs_modulus"', 1e-3),
    "modulus a thousand times too large": _rescaled_robot('"backbone.youngs_modulus"', 1e3),
}


def planted(good: Path, folder: Path, mistake: str) -> Path:
    """A copy of a good set with one mistake in it."""
    shutil.copytree(good, folder)
    (MISTAKES | FAULTS)[mistake](folder)
    return folder


def answer(folder: Path, seed: int = 0) -> tuple[str, list[str]]:
    """("refused", "said" or "missed", what was said) of a set, by all that a diagnosis does before its first fit."""
    try:
        recording = read(folder)
        twin = Twin.of(load(recording.robot, recording.folder))
        found = preview_data(prepare(on_rows_of_outputs(recording), twin.robot), twin, Settings(seed=seed)).suspicions
    except TwinError as error:
        return "refused", [str(error)]
    return ("said" if found else "missed"), [f"{s.kind}: {s.words}; change: {s.change}" for s in found]


def main(good: tyro.conf.Positional[Path], mistakes: tyro.conf.Positional[tuple[str, ...]] = ()) -> None:
    """Plant each of the mistakes (default: all) in a good measurement set and print who notices."""
    table = Table("mistake", "answer", "in words")
    table.add_row("(none)", *_cells(*answer(good)))
    with tempfile.TemporaryDirectory() as work:
        for n, mistake in enumerate(mistakes or MISTAKES | FAULTS):
            try:
                folder = planted(good, Path(work) / str(n), mistake)
            except ValueError:
                continue  # the set has nothing of the kind
            table.add_row(mistake, *_cells(*answer(folder)))
    Console(width=200).print(table)


def _cells(said: str, words: list[str]) -> tuple[str, Text]:
    return said, Text("\n".join(words))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
