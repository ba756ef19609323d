"""A set that breaks the contract is refused with one line that names the place, what came and the way out."""

from __future__ import annotations

import io
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from measurement_sets import edit, write_clouds, write_set

from twin.foundation.errors import DataError
from twin.measurements import read

Break = Callable[[Path], object]


def toml(old: str, new: str) -> Break:
    return lambda folder: edit(folder / "measurements.toml", old, new)


def csv(old: str, new: str) -> Break:
    return lambda folder: edit(folder / "a.csv", old, new)


def put(name: str, data: bytes) -> Break:
    return lambda folder: (folder / name).write_bytes(data)


def cloud(**changed: object) -> Break:
    return lambda folder: write_clouds(folder / "a.clouds.npz", **changed)


def parquet(**columns: object) -> Break:
    def change(folder: Path) -> None:
        good = {"time": [0.0, 1.0, 2.0], "tendon_1_tension": [1, 2, 3], "tip_x": [1.0, 2.0, None]}
        good |= {"ambient_temperature": [20.0, 20.0, 20.0], "sma_1_current": [0.0, 0.0, 0.0]}
        pyarrow.parquet.write_table(pa.table({name: each for name, each in (good | columns).items() if each}), folder / "a.parquet")
        edit(folder / "measurements.toml", '"a.csv"', '"a.parquet"')

    return change


def blank(column: int) -> Break:
    """Empties one column of both trials."""

    def change(folder: Path) -> None:
        for path in folder.glob("*.csv"):
            head, *rows = (line.split(",") for line in path.read_text().splitlines())
            rows = [[*row[:column], "", *row[column + 1 :]] for row in rows]
            path.write_text("\n".join(",".join(row) for row in [head, *rows]))

    return change


def garbled_parquet(folder: Path) -> None:
    parquet()(folder)
    (folder / "a.parquet").write_bytes(b"PAR1 nothing PAR1")


def outward_link(folder: Path) -> None:
    outside = folder.parent / "outside.csv"
    (folder / "a.csv").rename(outside)
    (folder / "a.csv").symlink_to(outside)


def npz(**members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return stream.getvalue()


def npy(array: object) -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.asarray(array), allow_pickle=True)
    return stream.getvalue()


def npy_claiming(header: str) -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode("latin1")


def bomb() -> bytes:
    """300 MB of zeros in 300 kB, with a directory that owns up to it."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        with archive.open("points.npy", "w") as member:
            for _ in range(300):
                member.write(bytes(2**20))
        archive.writestr("offsets.npy", npy([0, 1]))
        archive.writestr("time.npy", npy([0.0]))
    return stream.getvalue()


def understated(data: bytes, size: int, claim: int) -> bytes:
    """Every place that says a member unpacks to `size` bytes now says `claim`."""
    return data.replace(struct.pack("<L", size), struct.pack("<L", claim))


def two_time_members() -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in ("points", "offsets", "time", "TIME"):
            archive.writestr(f"{name}.npy", npy([0.0]))
    return stream.getvalue().replace(b"TIME.npy", b"time.npy")


HEADER = "time,tendon_1_tension,tip_x,ambient_temperature,sma_1_current"
TIP = 'name = "tip_x"'
HUGE = "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 3), }\n"
GOOD = {"offsets": npy([0, 1]), "time": npy([0.0])}

BROKEN: dict[str, tuple[Break, list[str]]] = {
    # measurements.toml
    "no toml": (lambda folder: (folder / "measurements.toml").unlink(), ["measurements.toml", "no such file"]),
    "not toml": (toml('title   = "Bench test"', "title = Bench test"), ["measurements.toml", "not TOML", "line 3"]),
    "deep toml": (put("measurements.toml", b"a = " + b"[" * 100_000), ["measurements.toml", "not TOML"]),
    "binary toml": (put("measurements.toml", b"\x1f\x8b\x08\xff"), ["measurements.toml", "row 1", "0x8b", "UTF-8"]),
    "huge toml": (put("measurements.toml", b"# \n" * 2_000_000), ["measurements.toml", "6000000 bytes", "at most"]),
    "other format": (toml("measurements/1", "measurements/2"), ["measurements.toml", "twin-measurements/2", "twin-measurements/1"]),
    "no format": (toml('format  = "twin-measurements/1"', ""), ["measurements.toml", "format is None"]),
    "no robot": (toml('robot   = "continuum"', ""), ["measurements.toml", "robot"]),
    "blank robot": (toml('"continuum"', '" "'), ["measurements.toml", "robot is ' '"]),
    "unknown key": (toml('title   = "Bench test"', 'titel = "x"'), ["measurements.toml", "'titel'", "did you mean 'title'"]),
    "unknown channel key": (toml("noise = 0.25", "nois = 1"), ["channel 2", "'nois'", "did you mean 'noise'"]),
    "almost a condition": (toml("start = 60", 'tip_paylod = "10 g"'), ["trial 2", "tip_paylod", "did you mean 'tip_payload'"]),
    "two mistakes": (
        lambda folder: (toml('unit = "mm"', 'unit = "N"')(folder), toml("start = 60", 'start = "60"')(folder)),
        ["2 things are wrong", "channel 2", "trial 2"],
    ),
    "title no text": (toml('"Bench test"', "14"), ["measurements.toml", "title is 14"]),
    "channel no table": (toml("[[channel]]\n" + TIP, "[channel]\n" + TIP), ["measurements.toml"]),
    "gravity two": (toml("[-9.81, 0.0, 0.0]", "[-9.81, 0.0]"), ["measurements.toml", "gravity", "three-vector"]),
    "gravity nan": (toml("[-9.81, 0.0, 0.0]", "[-9.81, nan, 0.0]"), ["measurements.toml", "gravity", "nan is not finite"]),
    "gravity text": (toml("[-9.81, 0.0, 0.0]", '"down"'), ["measurements.toml", "gravity", "'down'"]),
    "gravity unit": (toml("[-9.81, 0.0, 0.0]", '"[0, 0, 1] m/s"'), ["measurements.toml", "gravity", "wrong dimension", "m/s^2"]),
    "gravity bool": (toml("[-9.81, 0.0, 0.0]", "[true, 0.0, 0.0]"), ["measurements.toml", "gravity", "True is not a number"]),
    # channels
    "no unit": (toml('unit = "mm"', ""), ["measurements.toml", "channel 2", "unit is missing"]),
    "unknown unit": (toml('unit = "mm"', 'unit = "millimetrons"'), ["channel 2", "unknown unit 'millimetrons'", "mm"]),
    "wrong dimension": (toml('unit = "mm"', 'unit = "N"'), ["channel 2", "wrong dimension", "mm"]),
    "unit tower": (toml('unit = "mm"', 'unit = "m**9**9**9**9"'), ["channel 2", "not a unit"]),
    "unit tower 2": (toml('unit = "mm"', 'unit = "((m**99)**99)**99"'), ["channel 2", "not a unit"]),
    "delta": (toml('unit = "degC"', 'unit = "delta_degC"'), ["channel 3", "not a unit", "degC"]),
    "unknown name": (toml('"tip_x"', '"tool_x"'), ["channel 2", "'tool_x'", "tendon_I_tension", "disk_K_x|y|z", "finger_N_"]),
    "index zero": (toml('"tendon_1_tension"', '"tendon_0_tension"'), ["channel 1", "'tendon_0_tension'", "indices from 1"]),
    "channel twice": (toml('"ambient_temperature"', '"tip_x"'), ["measurements.toml", "channel 3"]),
    "unknown role": (toml('role = "output"', 'role = "result"'), ["channel 2", "'result'", "'input', 'output' or 'context'"]),
    "no role": (toml('role = "output"', ""), ["channel 2", "role is missing"]),
    "noise zero": (toml("noise = 0.25", "noise = 0.0"), ["channel 2", "tip_x", "not positive"]),
    "noise negative": (toml("noise = 0.25", "noise = -1"), ["channel 2", "tip_x", "not positive"]),
    "noise text": (toml("noise = 0.25", 'noise = "0.25 mm"'), ["channel 2", "noise of tip_x", "not a number"]),
    "noise nan": (toml("noise = 0.25", "noise = nan"), ["channel 2", "noise of tip_x", "not finite"]),
    "no input": (toml('role  = "input"', 'role = "context"'), ["measurements.toml", "no input channel"]),
    "no output": (toml('role = "output"', 'role = "context"'), ["measurements.toml", "no output channel"]),
    # trials
    "no trial file": (lambda folder: (folder / "b.csv").unlink(), ["trial 2", "b.csv", "no such file"]),
    "no file key": (toml('file = "b.csv"', ""), ["measurements.toml", "trial 2", "None is no file name"]),
    "absolute": (toml('"b.csv"', '"/etc/passwd"'), ["trial 2", "'/etc/passwd'", "leads out"]),
    "dot dot": (toml('"b.csv"', '"x/../../b.csv"'), ["trial 2", "leads out"]),
    "drive": (toml('"b.csv"', "'C:b.csv'"), ["trial 2", "leads out"]),
    "backslash": (toml('"b.csv"', "'..\\b.csv'"), ["trial 2", "leads out"]),
    "cloud dot dot": (toml('"a.clouds.npz"', '"../a.clouds.npz"'), ["trial 1", "leads out"]),
    "link": (outward_link, ["trial 1", "a.csv", "outside"]),
    "folder as file": (lambda folder: ((folder / "a.csv").unlink(), (folder / "a.csv").mkdir()), ["trial 1", "a.csv"]),
    "other suffix": (toml('"b.csv"', '"b.xlsx"'), ["trial 2", "'b.xlsx'", ".csv", ".parquet"]),
    "trial twice": (toml('"b.csv"', '"./a.csv"'), ["trial 2", "a.csv", "twice"]),
    "one trial": (toml('[[trial]]\nfile = "b.csv"\nstart = 60', ""), ["measurements.toml", "1 usable trials", "at least 2"]),
    "start text": (toml("start = 60", 'start = "60 s"'), ["trial 2", "start", "'60 s' is not a number"]),
    "payload unit": (toml('"10 g"', '"10 mm"'), ["trial 1", "tip_payload", "wrong dimension", "kg, g"]),
    "payload twice": (toml('"10 g"', '"10 g g/g"'), ["trial 1", "tip_payload", "names a unit twice"]),
    "payload bare": (toml('"10 g"', "10"), ["trial 1", "tip_payload", "10 has no unit", '"10 g"']),
    "payload words": (toml('"10 g"', '"ten grams"'), ["trial 1", "tip_payload", "'ten grams' is no quantity"]),
    "payload negative": (toml('"10 g"', '"-10 g"'), ["trial 1", "tip_payload", "below zero"]),
    "payload infinite": (toml('"10 g"', '"1e999 g"'), ["trial 1", "tip_payload", "not finite"]),
    "force two": (toml("start = 60", 'tip_force = "[0, 1] N"'), ["trial 2", "tip_force", "three-vector"]),
    "force unit": (toml("start = 60", 'tip_force = "[0, 1, 0] mm"'), ["trial 2", "tip_force", "wrong dimension"]),
    # tables
    "no column": (csv(HEADER, HEADER.replace("tip_x", "tip_y")), ["a.csv", "row 1", "no column tip_x"]),
    "no time": (csv("time,", "t,"), ["a.csv", "row 1", "no column time"]),
    "semicolons": (put("a.csv", b"time;tip_x\n0;1\n"), ["a.csv", "row 1", "commas"]),
    "column twice": (csv(HEADER, HEADER.replace("sma_1_current", "tip_x")), ["a.csv", "row 1", "'tip_x' is there twice"]),
    "empty file": (put("a.csv", b""), ["a.csv", "row 1", "no column time"]),
    "text": (csv("0.1,100,1.2", "0.1,abc,1.2"), ["a.csv", "row 3", "column tendon_1_tension", "'abc' is not a number"]),
    "hexadecimal": (csv("0.1,100,1.2", "0.1,0x10,1.2"), ["a.csv", "row 3", "column tendon_1_tension", "'0x10'"]),
    "underscore": (csv("0.1,100,1.2", "0.1,1_0,1.2"), ["a.csv", "row 3", "column tendon_1_tension", "'1_0'"]),
    "infinite": (csv("0.2,200,", "0.2,inf,"), ["a.csv", "row 4", "column tendon_1_tension", "infinite"]),
    "overflow": (csv("0.3,300,NaN", "0.3,300,1e999"), ["a.csv", "row 5", "column tip_x", "infinite"]),
    "time text": (csv("0.2,200", "noon,200"), ["a.csv", "row 4", "column time", "'noon'"]),
    "time missing": (csv("0.2,200", ",200"), ["a.csv", "row 4", "column time", "missing"]),
    "time infinite": (csv("0.3,300", "inf,300"), ["a.csv", "row 5", "column time", "infinite"]),
    "time repeats": (csv("0.2,200", "0.1,200"), ["a.csv", "row 4", "column time", "0.1 after 0.1", "one row of those with equal"]),
    "time since 1970": (csv("0.3,", "1726041640.5,"), ["a.csv", "row 5", "subtract the first trial's first stamp"]),
    "nanoseconds since 1970": (csv("0.3,", "1726041640500000000,"), ["a.csv", "row 5", "divide by 1e+09 and subtract"]),
    "a date": (csv("0.2,200", "2024-09-11T08:00:00+00:00,200"), ["a.csv", "row 4", "is a date", "write the seconds"]),
    "a nan of its own": (csv("0.1,100,1.2", "0.1,100,nan(1)"), ["a.csv", "row 3", "column tip_x", "'nan(1)'"]),
    "nanoseconds": (csv("0.1,100", "1e-9,100"), ["a.csv", "row 3", "column time", "1e-09 s", "seconds"]),
    "an age": (csv("0.3,300", "1e9,300"), ["a.csv", "row 5", "column time", "seconds"]),
    "a long name": (toml('"b.csv"', f'"{"b" * 5000}.csv"'), ["trial 2", "5004 characters", "at most"]),
    "short row": (csv("0.2,200,,23,250", "0.2,200,,23"), ["a.csv", "row 4", "4 cells under 5"]),
    "long row": (csv("0.2,200,,23,250", "0.2,200,,23,250,7"), ["a.csv", "row 4", "6 cells under 5"]),
    "blank row": (csv("0.2,200", "\n0.2,200"), ["a.csv", "row 4", "column time", "missing"]),
    "quoted line end": (csv("0.2,200,,23,250", '0.2,"200\n",,23,250'), ["a.csv", "row 4"]),
    "nul": (csv("0.2,200", "0.2,2\0"), ["a.csv", "row 4", "NUL"]),
    "latin-1": (put("a.csv", HEADER.encode() + b"\n0,1,2,3,\xb5\n"), ["a.csv", "row 2", "0xb5", "UTF-8"]),
    "utf-16": (lambda folder: (folder / "a.csv").write_text(HEADER, encoding="utf-16"), ["a.csv", "row 1", "UTF-"]),
    "cut utf-8": (put("a.csv", HEADER.encode() + b"\n0,1,2,3,\xc3"), ["a.csv", "row 2", "UTF-8"]),
    "long line": (put("a.csv", HEADER.encode() + b"\n" + b"0" * 3_000_000), ["a.csv", "row 2", "line longer than"]),
    "long header": (put("a.csv", b"x" * 1_500_000 + b"\n1"), ["a.csv", "row 1", "line longer than"]),
    "too cold": (csv("0.1,100,1.2,23", "0.1,100,1.2,-9999"), ["a.csv", "row 3", "column ambient_temperature", "absolute zero"]),
    "no output value": (blank(2), ["measurements.toml", "0 usable trials"]),
    "never filled": (blank(3), ["measurements.toml", "channel ambient_temperature", "no value"]),
    # Parquet
    "garbled parquet": (
        lambda folder: (parquet()(folder), put("a.parquet", b"PAR1 nothing PAR1")(folder)),
        ["a.parquet", "Parquet"],
    ),
    "parquet column": (parquet(tip_x=None), ["a.parquet", "no column tip_x"]),
    "parquet text": (parquet(tip_x=["1", "2", "3"]), ["a.parquet", "column tip_x", "string", "float64"]),
    "parquet infinite": (parquet(tip_x=[1.0, np.inf, 2.0]), ["a.parquet", "row 2", "column tip_x", "infinite"]),
    "parquet time": (parquet(time=[0.0, 2.0, 1.0]), ["a.parquet", "row 3", "column time", "1.0 after 2.0"]),
    # clouds
    "no cloud": (lambda folder: (folder / "a.clouds.npz").unlink(), ["trial 1", "a.clouds.npz", "no such file"]),
    "no zip": (put("a.clouds.npz", b"points"), ["a.clouds.npz", "NPZ"]),
    "extra member": (cloud(colour=np.zeros(3)), ["a.clouds.npz", "colour", "exactly points, offsets and time"]),
    "member twice": (put("a.clouds.npz", two_time_members()), ["a.clouds.npz", "exactly points"]),
    "pickled": (cloud(points=np.array([{}], object)), ["a.clouds.npz", "points", "type 'object'"]),
    "points shape": (cloud(points=np.zeros((5, 2))), ["a.clouds.npz", "(5, 2)", "(M, 3)"]),
    "points nan": (cloud(points=np.full((5, 3), np.nan)), ["a.clouds.npz", "points", "NaN"]),
    "offsets fall": (cloud(offsets=np.array([0, 4, 2, 5])), ["a.clouds.npz", "offsets"]),
    "offsets short": (cloud(offsets=np.array([0, 2, 4, 4])), ["a.clouds.npz", "offsets", "5"]),
    "offsets float": (cloud(offsets=np.array([0.0, 2.0, 4.0, 5.0])), ["a.clouds.npz", "offsets", "integers"]),
    "frames": (cloud(time=np.array([0.0, 0.1])), ["a.clouds.npz", "offsets have shape (4,)"]),
    "cloud time": (cloud(time=np.array([0.0, 0.2, 0.1])), ["a.clouds.npz", "time", "increasing"]),
    "bomb": (lambda folder: put("a.clouds.npz", bomb())(folder), ["a.clouds.npz", "unpacks to 3145", "at most"]),
    "no header": (put("a.clouds.npz", npz(points=b"\x93NUMPY", **GOOD)), ["a.clouds.npz", "points", "no plain .npy"]),
    "header lies": (
        put(
            "a.clouds.npz",
            npz(points=npy_claiming("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 3), }\n"), **GOOD),
        ),
        ["a.clouds.npz", "points", "99999999999", "0 bytes"],
    ),
    "header code": (
        put("a.clouds.npz", npz(points=npy_claiming("__import__('os').abort()\n"), **GOOD)),
        ["a.clouds.npz", "points", "no plain .npy"],
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_set_is_refused_with_its_place(name: str, tmp_path: Path) -> None:
    change, expected = BROKEN[name]
    folder = write_set(tmp_path / "set")
    read(folder)  # in order before the change
    change(folder)
    with pytest.raises(DataError) as caught:
        read(folder)
    message = str(caught.value)
    assert all(part in message for part in expected), message
    assert "\n" not in message
    assert len(message.removeprefix(str(tmp_path))) < 500


def test_a_bomb_that_hides_its_size_is_not_unpacked(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    (folder / "a.clouds.npz").write_bytes(understated(bomb(), 300 * 2**20, 1000))
    read(write_set(tmp_path / "warm up"))
    tracemalloc.start()
    try:
        with pytest.raises(DataError, match=r"a\.clouds\.npz: cannot be read as NPZ"):
            read(folder)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 20e6  # bytes; reading a set of this size takes 2 MB
