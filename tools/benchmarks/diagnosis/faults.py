"""Faults that trackers, encoders and loggers produce, each planted in one trial of a good measurement set.

The list is of kinds that people report of motion capture (lost and swapped markers), encoders (roll-over, counters), load cells
and converters (fills, stuck values) and loggers (held values, frozen rows, clocks). `mistakes` plants them and prints the answers.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tools.benchmarks.diagnosis.tables import Columns, read_columns, write_columns
from twin.measurements import Recording, read
from twin.measurements.parsing.declared import markers_of

Plant = Callable[[Path], None]
SCALARS = ("joint_angle", "joint_position", "actuator_position", "sensor_resistance", "tendon_tension", "element_tension")
TURNS = {"deg": 360.0, "rad": 2.0 * np.pi}
COUNTS = 4096  # of a twelve-bit encoder


def _markers(good: Recording) -> list[list[str]]:
    """Return the columns of each whole marker, the one that moves most first."""
    whole = [[c.name for c in axes] for axes in markers_of(good.outputs()).values() if len(axes) == 3]
    if not whole:
        raise ValueError("no markers")
    return sorted(whole, key=lambda names: -sum(float(np.nanstd(t.values[n])) for t in good.trials for n in names))


def _scalar(good: Recording, kinds: tuple[str, ...] = SCALARS) -> str:
    """Return the column of the output of these kinds that moves most for its usual size."""
    found = [c.name for c in good.outputs() if c.kind in kinds]
    if not found:
        raise ValueError(f"no {', '.join(kinds)}")
    return max(found, key=lambda n: float(np.nanstd(np.concatenate([t.values[n] for t in good.trials]))))


def _moving(column: np.ndarray, rows: int) -> int:
    """Return the first of so many rows, away from the ends, over which the column moves most, by fewer than all of it at once."""
    at = np.arange(2, len(column) - rows - 2)
    travel = np.abs(column[at + rows] - column[at - 1])
    return int(at[np.nanargmax(np.where(np.isfinite(travel), travel, -1.0))])


def _busiest(folder: Path, name: str) -> Path:
    """Return the trial in which the column goes furthest."""
    return max(sorted(folder.glob("*.csv")), key=lambda p: float(np.nanmax(c := read_columns(p)[name]) - np.nanmin(c)))


def _in_busiest(names: Callable[[Recording], list[str]], change: Callable[[Columns, list[str]], None]) -> Plant:
    """Return a fault of these columns in the trial in which the first goes furthest."""

    def plant(folder: Path) -> None:
        chosen = names(read(folder))
        path = _busiest(folder, chosen[0])
        columns = read_columns(path)
        change(columns, chosen)
        write_columns(path, columns)

    return plant


def _marker(good: Recording) -> list[str]:
    return _markers(good)[0]


def _two_markers(good: Recording) -> list[str]:
    markers = _markers(good)
    if len(markers) < 2:
        raise ValueError("one marker")
    return [*markers[0], *markers[1]]


def _reading(good: Recording) -> list[str]:
    return [_scalar(good)]


def _drive(good: Recording) -> list[str]:
    return [
        max((c.name for c in good.inputs()), key=lambda n: float(np.nanstd(np.concatenate([t.values[n] for t in good.trials]))))
    ]


def _everything(good: Recording) -> list[str]:
    return [*(n for m in _markers(good)[:1] for n in m), *(c.name for c in good.channels)]


def _rows(column: np.ndarray, length: int, times: int) -> list[int]:
    starts = np.linspace(0.15, 0.85, times) * len(column)
    return [int(s) + k for s in starts for k in range(length)]


def _filled(value: float, length: int, times: int) -> Callable[[Columns, list[str]], None]:
    def change(c: Columns, names: list[str]) -> None:
        for name in names:
            c[name][_rows(c[name], length, times)] = value

    return change


def _held(rows: int) -> Callable[[Columns, list[str]], None]:
    """The columns keep the values that they had, over the rows in which the first moves most."""

    def change(c: Columns, names: list[str]) -> None:
        first = _moving(c[names[0]], rows)
        for name in dict.fromkeys(names):
            c[name][first : first + rows] = c[name][first - 1]

    return change


def _swapped(rows: int) -> Callable[[Columns, list[str]], None]:
    def change(c: Columns, names: list[str]) -> None:
        first = _moving(c[names[0]], rows)
        at = slice(first, first + rows)
        for one, other in zip(names[:3], names[3:], strict=True):
            c[one][at], c[other][at] = c[other][at].copy(), c[one][at].copy()

    return change


def _rolled(kinds: tuple[str, ...], counts: bool) -> Plant:
    """A column counted from its middle, so that it rolls over; as counts with a scale, or as an angle within one turn."""

    def plant(folder: Path) -> None:
        good = read(folder)
        name = _scalar(good, kinds)
        unit = next(c.unit for c in good.channels if c.name == name)
        every = {p: read_columns(p) for p in sorted(folder.glob("*.csv"))}
        values = np.concatenate([c[name] for c in every.values()])
        if not counts and unit not in TURNS:
            raise ValueError(f"{name} is no angle")
        span = 1.25 * float(np.nanmax(values) - np.nanmin(values)) if counts else TURNS[unit]
        one = span / COUNTS if counts else 1.0
        middle = 0.5 * float(np.nanmax(values) + np.nanmin(values))
        for path, c in every.items():
            turned = np.mod(c[name] - middle, span) / one
            c[name] = np.where(np.isfinite(turned), np.mod(np.round(turned), COUNTS), np.nan) if counts else turned
            write_columns(path, c)
        file = folder / "measurements.toml"
        keys = f'name = "{name}"\noffset = {middle!r}' + (f"\nscale = {one!r}" if counts else "")
        file.write_text(re.sub(rf'^name\s*=\s*"{re.escape(name)}"', keys, file.read_text(), count=1, flags=re.MULTILINE))

    return plant


def _clock(change: Callable[[np.ndarray], list[str]]) -> Plant:
    """The column time, written otherwise, in every trial."""

    def plant(folder: Path) -> None:
        for path in sorted(folder.glob("*.csv")):
            head, *rows = path.read_text().rstrip().split("\n")
            at = head.split(",").index("time")
            cells = [r.split(",") for r in rows]
            for row, stamp in zip(cells, change(np.array([float(r[at]) for r in cells])), strict=True):
                row[at] = stamp
            path.write_text("\n".join([head, *map(",".join, cells)]) + "\n")

    return plant


def _since_1970(ticks: int) -> Plant:
    return _clock(lambda t: [str(1726041600 * ticks + round(v * ticks)) if ticks > 1 else f"{1726041600 + v:.4f}" for v in t])


def _equal(time: np.ndarray) -> list[str]:
    middle = len(time) // 2
    return [f"{v:.6g}" for v in np.where(np.arange(len(time)) == middle, time[middle - 1], time)]


ANGLES = ("joint_angle", "joint_position")
TRAVELS = (*ANGLES, "actuator_position", "sensor_resistance", "tendon_tension", "element_tension")

FAULTS: dict[str, Plant] = {
    "a lost marker as zeros, four rows at a time": _in_busiest(_marker, _filled(0.0, 4, 3)),
    "a lost marker as zeros, in single rows": _in_busiest(_marker, _filled(0.0, 1, 5)),
    "a lost marker as -1": _in_busiest(_marker, _filled(-1.0, 4, 3)),
    "a lost marker as -1, in single rows": _in_busiest(_marker, _filled(-1.0, 1, 5)),
    "a lost marker as 9999": _in_busiest(_marker, _filled(9999.0, 3, 2)),
    "a lost marker that stays where it was": _in_busiest(_marker, _held(8)),
    "a lost marker that stays where it was for long": _in_busiest(_marker, _held(20)),
    "two markers under each other's names": _in_busiest(_two_markers, _swapped(6)),
    "two markers under each other's names for long": _in_busiest(_two_markers, _swapped(20)),
    "a reading drops out as -1": _in_busiest(_reading, _filled(-1.0, 4, 2)),
    "a reading drops out as 0": _in_busiest(_reading, _filled(0.0, 3, 3)),
    "a reading drops out as 9999": _in_busiest(_reading, _filled(9999.0, 5, 1)),
    "a reading drops out as -999, in single rows": _in_busiest(_reading, _filled(-999.0, 1, 4)),
    "a reading drops out as 65535": _in_busiest(_reading, _filled(65535.0, 2, 2)),
    "a reading that is stuck": _in_busiest(_reading, _held(8)),
    "a reading that is stuck for long": _in_busiest(_reading, _held(20)),
    "an angle that rolls over": _rolled(ANGLES, counts=False),
    "a counter that rolls over": _rolled(TRAVELS, counts=True),
    "a drive drops out as 0": _in_busiest(_drive, _filled(0.0, 3, 3)),
    "a drive drops out as -1": _in_busiest(_drive, _filled(-1.0, 4, 2)),
    "a drive drops out as 9999": _in_busiest(_drive, _filled(9999.0, 2, 2)),
    "a drive that is stuck": _in_busiest(_drive, _held(12)),
    "rows that repeat": _in_busiest(_everything, _held(10)),
    "seconds since 1970": _since_1970(1),
    "milliseconds since 1970": _since_1970(10**3),
    "nanoseconds since 1970": _since_1970(10**9),
    "equal stamps": _clock(_equal),
    "a clock that rolls over": _clock(lambda t: [f"{v:.6g}" for v in np.mod(t - t[0], 0.6 * (t[-1] - t[0]))]),
}
