"""Files with mistakes in them, as hypothesis strategies: robot.toml, twin.toml, measurements.toml, CSV, Parquet and point clouds.

Names are misspelt, types and units changed, numbers huge, negative or none; nesting, encodings, truncation, permuted columns.
"""

from __future__ import annotations

import io
import re
import struct
import zipfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from hypothesis import strategies as st

from twin.robots import load, robot_names
from twin.robots.robot import models_folder
from twin.robots.starter import robot_text

TWIN = """\
format = "twin/1"
robot = "continuum"

[parameters]
"backbone.youngs_modulus" = { value = 76.1, std = 0.4, unit = "GPa" }
"tendons.radius" = { value = 8.1, unit = "mm" }
"tendons.angle_2" = { value = 121.0, unit = "deg" }
"disks.mass" = 0.005

[[effect]]
id = "tendon_friction"
parameters = { mu = { value = 0.21, std = 0.004, unit = "1" } }

[[effect]]
id = "base_tilt"
parameters = { about_x = { value = 2.0, unit = "deg" } }

[[effect]]
id = "time_delay"
parameters = { delay = { value = 100.0, unit = "ms" } }

[provenance]
seed = 0

[correlation]
parameters = ["backbone.youngs_modulus", "tendon_friction.mu"]
matrix = [[1.0, -0.25], [-0.25, 1.0]]
"""
CHANNELS = (
    ("tendon_1_tension", "input", 'unit = "gf"\nnoise = 2.0'), ("tendon_2_tension", "input", 'unit = "N"'),
    ("tendon_3_tension", "input", 'unit = "N"'), ("tip_x", "output", 'unit = "mm"\nnoise = 0.25'),
    ("ambient_temperature", "context", 'unit = "degC"\nnoise = 0.5'),
)  # fmt: skip
SET = (
    'format  = "twin-measurements/1"\nrobot   = "continuum"\ntitle   = "Bench test"\nsource  = "hardware"\n'
    "gravity = [0.0, 0.0, 9.81]\n\n"
    + "".join(f'[[channel]]\nname = "{name}"\nrole = "{role}"\n{rest}\n\n' for name, role, rest in CHANNELS)
    + '[[trial]]\nfile = "a.{suffix}"\nstart = 0.0\ntip_payload = "10 g"\ncloud = "a.clouds.npz"\n\n'
    '[[trial]]\nfile = "b.csv"\nstart = 60\ntip_force = "[0, 0, 0.1] N"\n'
)
COLUMNS: dict[str, Any] = {
    "time": [0.0, 0.1, 0.2, 0.3],
    "tendon_1_tension": [0.0, 100.0, 200.0, 300.0],
    "tendon_2_tension": [0.0, 0.5, 0.25, 0.125],
    "tendon_3_tension": [1.0, 0.5, 0.25, 0.125],
    "tip_x": [0.1, 1.2, None, 3.5],
    "ambient_temperature": [23.0, 23.0, 23.0, 23.5],
}
CLOUDS = {"points": np.arange(15.0).reshape(5, 3) / 100, "offsets": np.array([0, 2, 4, 5]), "time": np.array([0.0, 0.1, 0.2])}


@cache
def robot_texts() -> tuple[str, ...]:
    """Return every shipped robot's file and two starters', without comments, empty lines and sources, where no mistake shows."""
    shipped = [(models_folder() / name / "robot.toml").read_text("utf-8") for name in robot_names()]
    whole = shipped + [robot_text("mine", load(name)) for name in ("continuum", "cable_tool")]
    bare = (re.sub(r'source = "[^"]*"', 'source = "x"', re.sub(r"(?m)(^|\s+)#.*$", "", text)) for text in whole)
    return tuple(re.sub(r"\n{2,}", "\n", text) for text in bare)


def csv_text() -> str:
    """Return the columns as CSV."""
    rows = zip(*COLUMNS.values(), strict=True)
    return "\n".join([",".join(COLUMNS), *(",".join("" if v is None else repr(v) for v in row) for row in rows)]) + "\n"


def write_set(folder: Path, suffix: str) -> None:
    """Write a whole measurement set whose first trial is a CSV or Parquet file."""
    folder.mkdir(parents=True)
    (folder / "measurements.toml").write_text(SET.replace("{suffix}", suffix))
    (folder / "b.csv").write_text(csv_text())
    if suffix == "parquet":
        pyarrow.parquet.write_table(pa.table(COLUMNS), folder / "a.parquet")
    else:
        (folder / "a.csv").write_text(csv_text())
    np.savez(folder / "a.clouds.npz", **CLOUDS)  # type: ignore[arg-type]


# ---- any bytes -----------------------------------------------------------------------------------------------------------


@st.composite
def damaged_bytes(draw: st.DrawFn, whole: bytes) -> bytes:
    """A few bytes replaced, or the end cut off."""
    data = bytearray(whole)
    if draw(st.booleans()):
        return bytes(data[: draw(st.integers(0, len(data) - 1))])
    for at, byte in draw(st.lists(st.tuples(st.integers(0, len(data) - 1), st.integers(0, 255)), min_size=1, max_size=4)):
        data[at] = byte
    return bytes(data)


def misspelt(word: str) -> st.SearchStrategy[str]:
    """One letter dropped, doubled, swapped, changed; capitals; something added."""

    def at(k: int) -> tuple[str, ...]:
        head, letter, after, tail = word[:k], word[k : k + 1], word[k + 1 : k + 2], word[k + 1 :]
        return head + tail, head + letter + letter + tail, head + after + letter + word[k + 2 :], head + "x" + tail

    ways = st.integers(0, max(len(word) - 1, 0)).flatmap(lambda k: st.sampled_from(at(k)))
    return ways | st.sampled_from((word.upper(), word.capitalize(), word + "s", word + "_1", word + "_x"))


# ---- TOML ----------------------------------------------------------------------------------------------------------------

NUMBER = r"(?<![\w.\"])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.\"])"
KEY = r'(?m)^(?:"[^"\n]+"|[A-Za-z_]+)(?=\s*=)|(?<=[{,]\s)[a-z]+(?=\s*=)'
NUMBERS = (
    "0", "0.0", "-0.0", "-1", "-1.0", "1e999", "-1e308", "1e308", "1e-320", "nan", "inf", "-inf", "true", "false", '"5"', '""',
    "[]", "[1.0]", "[1.0, 2.0]", "[[1.0]]", "{ }", "{ value = 1.0 }", "9223372036854775807", "-9223372036854775808", "9" * 400,
    "9" * 5000, "1979-05-27", "07:32:00", "1e3", "1e6", "1e-6", "0x10", "1_000", "0.5", "2", "3", "1000000",
)  # fmt: skip
UNITS = (
    "", " ", "1", "m", "mm", "km", "um", "inch", "g", "kg", "Pa", "kPa", "MPa", "GPa", "deg", "rad", "deg**2", "rad/s", "degC",
    "degF", "K", "delta_degC", "9**9**9", "m**9**9", "((m**99)**99)**99", "10 mm", "mm mm/mm", "N", "gf", "lux", "%", "percent",
    "dB", "turn", "furlong", "m" * 5000, "s", "ms", "hour", "N*m", "1/K", "mm/N", "ångström", "µm", "None", "nan", "m\\u0000",
    "[m]", "2*m", "m^1",
)  # fmt: skip
WORDS = (
    "", " ", "..", "../..", "/etc", ".", "continuum.x", "robot", "schema", "os", "__init__", "body", "continuum_schema", "cast",
    "wire", "tentacle", "x" * 5000, "[/]", "[red]x", "\\u001b[31m", "\\u0000", "\\n", "nan", "twin/1", "a.csv", "b.csv",
    "a.clouds.npz", "input", "output", "context", "10 g g/g", "-10 g", "10", "1e999 g", "10 mm", "[0, 0, 1] N", "[0, 0] N",
    "tip_y", "tip_x", "disk_1_x", "disk_999_x", "tendon_1_tension", "tendon_2_displacement", "finger_1_tip_x", "simulation",
    "tendon_friction", "tip_payload", "disk",
)  # fmt: skip
MADE_UP = (
    "unknown = 1", '"tendons.twist" = { value = 1.0, unit = "deg", source = "x" }', "[unknown]", "[[effect]]",
    'id = "tendon_friction"', "std = 1.0", "a = " + "[" * 5000 + "]" * 5000, "a = " + "{ b = " * 3000,
    ".".join("a" * 2000) + " = 1", "#" + "x" * 10**6, 'wind = "3 m/s"', 'tip_paylod = "10 g"', "[[trial]]", "[[channel]]",
    "strat = 5.0",
)  # fmt: skip
ADDED = (
    "std = 1.0", "std = -1.0", "std = 0", "low = 0.0", "high = 1e9", "Std = 1.0", "vlaue = 1.0", 'unit = "m"', 'std = "x"',
    "std = true",
)  # fmt: skip
FACTORS = (-1.0, 1e-3, 1e3, 1e6, 1e-6, 1e9, 57.29577951308232, 1.01)


def _key(key: str) -> st.SearchStrategy[str]:
    return misspelt(key[1:-1]).map(lambda word: f'"{word}"') if key.startswith('"') else misspelt(key)


def _list(whole: str) -> st.SearchStrategy[str]:
    cells = whole[1:-1].split(",")
    ways = ([*cells, cells[-1]], cells[:-1], cells[::-1], [whole, *cells], ["true", *cells[1:]], ['"x"', *cells[1:]])
    return st.sampled_from([f"[{','.join(way)}]" for way in ways])


def _word(_: str) -> st.SearchStrategy[str]:
    return st.sampled_from(WORDS).map(lambda word: f'"{word}"') | st.sampled_from(("5", "true", "[]", "{ }"))


# a pattern, and what a match may become
REPLACED: tuple[tuple[str, Callable[[str], st.SearchStrategy[str]]], ...] = (
    (NUMBER, lambda _: st.sampled_from(NUMBERS)),
    (NUMBER, lambda number: st.sampled_from(FACTORS).map(lambda by: repr(float(number) * by))),
    (r'(?<=unit = )"[^"\n]*"', lambda _: st.sampled_from(UNITS).map(lambda unit: f'"{unit}"')),
    (r'"[^"\n]*"', _word),
    (KEY, _key),
    (r"(?m)^\[+[a-z]+\]+", misspelt),
    (r"\{ ?(?=\w)", lambda _: st.sampled_from(ADDED).map(lambda entry: "{ " + entry + ", ")),
    (r"\b(?:std|low|high|unit|source|value) = [^,}\n]+(?:, )?", lambda _: st.just("")),
    (r"\[[^\[\]\n\"]*\d[^\[\]\n]*\]", _list),
)


@st.composite
def _lines(draw: st.DrawFn, text: str) -> str:
    """A line dropped, doubled, moved, or made up."""
    lines = text.splitlines()
    at, kind = draw(st.integers(0, len(lines) - 1)), draw(st.sampled_from(("drop", "double", "move", "make up")))
    if kind == "double":
        lines.insert(at, lines[at])
    elif kind == "make up":
        lines.insert(at, draw(st.sampled_from(MADE_UP)))
    else:
        line = lines.pop(at)
        if kind == "move":
            lines.insert(draw(st.integers(0, len(lines))), line)
    return "\n".join(lines) + "\n"


def _encoded(text: str) -> st.SearchStrategy[bytes]:
    odd = [text.encode(code) for code in ("utf-16", "utf-32", "utf-8-sig")]
    odd += [(text + "# Ångström").encode("latin-1", "replace"), b""]
    odd += [text.replace("\n", end).encode() for end in ("\r\n", "\r", "\n\n")]
    return st.sampled_from(odd) | damaged_bytes(text.encode())


@st.composite
def damaged_toml(draw: st.DrawFn, text: str) -> bytes:
    """One mistake, sometimes two or three."""
    for _ in range(draw(st.sampled_from((1, 1, 1, 2, 3)))):
        if draw(st.integers(0, 3)) == 0:
            text = draw(_lines(text))
            continue
        pattern, new = draw(st.sampled_from(REPLACED))
        if matches := list(re.finditer(pattern, text)):
            at = draw(st.sampled_from(matches))
            text = text[: at.start()] + draw(new(at[0])) + text[at.end() :]
    if draw(st.integers(0, 11)) == 0:
        return draw(_encoded(text))
    return text.encode("utf-8", "surrogatepass")


# ---- tables --------------------------------------------------------------------------------------------------------------

CELLS = (
    "", "nan", "NaN", "-nan", "nan(1)", "NAN(0x1)", "inf", "-inf", "1e999", "1e-9", "0x10", "1_0", "1,0", "abc", "-100", "-1",
    "1e308", "5e-324", '"1"', '"1', "1;2", " 1 ", "\t1", "None", "null", "NA", "#N/A", "true", "\uff11", "1e", "--1", "1" * 5000,
    "0.1", "-9999", "1e300",
)  # fmt: skip
HEADS = ("tip_y", "disk_1_x", "", "time", "tendon_1_displacement", "x" * 5000, "[/]")
ROW_CHANGES: tuple[Callable[[list[list[str]], int], list[list[str]]], ...] = (
    lambda rows, k: rows[:k] + rows[k + 1 :] or [[""]],
    lambda rows, k: [*rows[: k + 1], list(rows[k]), *rows[k + 1 :]],
    lambda rows, k: [*rows[:k], rows[k][:-1] or [""], *rows[k + 1 :]],
    lambda rows, k: [*rows[:k], [*rows[k], "7"], *rows[k + 1 :]],
    lambda rows, k: [*rows[:k], [""], *rows[k:]],
    lambda rows, k: [row[:-1] for row in rows],
)


@st.composite
def damaged_rows(draw: st.DrawFn, rows: list[list[str]]) -> list[list[str]]:
    """A cell, a name, the columns' order or number, a row or the times changed."""
    kind, at = draw(st.sampled_from(("cell", "cell", "head", "order", "more", "row", "time"))), draw(st.integers(0, len(rows) - 1))
    if kind == "cell":
        rows[at][draw(st.integers(0, len(rows[at]) - 1))] = draw(st.sampled_from(CELLS))
    elif kind == "head":
        k = draw(st.integers(0, len(rows[0]) - 1))
        rows[0][k] = draw(st.sampled_from(HEADS) | misspelt(rows[0][k]))
    elif kind == "order":
        order = draw(st.permutations(range(len(rows[0]))))
        whole = draw(st.booleans())
        rows = [[row[k] for k in order if k < len(row)] if whole or n == 0 else row for n, row in enumerate(rows)]
    elif kind == "more":
        count = draw(st.sampled_from((1, 3, 10_000)))
        rows = [rows[0] + [f"more_{k}" for k in range(count)], *(row + ["1"] * count for row in rows[1:])]
    elif kind == "row":
        rows = draw(st.sampled_from(ROW_CHANGES))(rows, at)
    else:
        factor = draw(st.sampled_from((1e-3, 1e-9, 1e-12, 1e3, 1e9, 1e300, -1.0, 0.0)))
        for row in rows[1:]:
            if re.fullmatch(r"[\d.]+", row[0]):
                row[0] = repr(float(row[0]) * factor)
    return rows


@st.composite
def damaged_csv(draw: st.DrawFn) -> bytes:
    """One to three mistakes in a table, sometimes another encoding or separator."""
    rows = [line.split(",") for line in csv_text().splitlines()]
    for _ in range(draw(st.integers(1, 3))):
        rows = draw(damaged_rows(rows))
    data = "\n".join(",".join(row) for row in rows).encode()
    if draw(st.integers(0, 3)):
        return data + b"\n"
    odd = [data.decode().encode(code) for code in ("utf-16", "utf-32", "utf-8-sig")] + [data + b"\n\0", data + b"\n\xff"]
    odd += [data.replace(b"\n", b"\r\n"), data.replace(b"\n", b"\r"), *(data.replace(b",", mark) for mark in (b";", b"\t", b" "))]
    return draw(st.sampled_from(odd) | damaged_bytes(data + b"\n"))


N = len(COLUMNS["time"])
ODD_COLUMNS = (
    [None] * N, [float("nan")] * N, [float("inf")] * N, ["1"] * N, [True] * N, [1] * N, [-1.0] * N, [1e300] * N, [[1.0]] * N,
    pa.array([1, 2, 3, 4], pa.int8()), pa.array([1, 2, 3, 4], pa.float32()), pa.array([1, 2, 3, 4], pa.decimal128(9, 2)),
    pa.array([1, 2, 3, 4], pa.timestamp("s")), pa.array(["1"] * N).dictionary_encode(), COLUMNS["time"][::-1],
    [0.0, 1e-9, 2e-9, 3e-9],
)  # fmt: skip


@st.composite
def damaged_parquet(draw: st.DrawFn) -> bytes:
    """A column of another kind, dropped, misspelt, many or long; sometimes damaged bytes too."""
    columns, name = dict(COLUMNS), draw(st.sampled_from(list(COLUMNS)))
    kind = draw(st.sampled_from(("odd", "odd", "drop", "misspelt", "long", "more")))
    if kind == "odd":
        columns[name] = draw(st.sampled_from(ODD_COLUMNS))
    elif kind == "long":
        rows = draw(st.sampled_from((10**5, 6 * 10**6)))
        columns = {key: np.zeros(rows) for key in columns} | {"time": np.arange(rows) * 1e-3}
    elif kind == "more":
        columns |= {f"more_{k}": [1.0] * N for k in range(draw(st.sampled_from((1, 2000))))}
    else:
        values = columns.pop(name)
        columns |= {draw(misspelt(name)): values} if kind == "misspelt" else {}
    stream = io.BytesIO()
    pyarrow.parquet.write_table(pa.table(columns), stream)
    whole = stream.getvalue()
    return whole if kind == "long" or draw(st.integers(0, 2)) else draw(damaged_bytes(whole))


# ---- point clouds --------------------------------------------------------------------------------------------------------

ARRAY_CHANGES: tuple[Callable[[np.ndarray], Any], ...] = (
    lambda a: a[:-1], lambda a: a[::-1], lambda a: a * -1, lambda a: a * 1000, lambda a: a[None], lambda a: a[:0],
    lambda a: np.full(a.shape, np.nan), lambda a: np.full(a.shape, np.inf), np.asfortranarray, lambda a: np.array(3.0),
    *(partial(lambda kind, a: a.astype(kind), kind) for kind in (complex, str, bool, np.float16, ">f8", np.int64, object)),
)  # fmt: skip
SHAPES = ("(99999999999, 3)", "(-1, 3)", "(5, 3)", "()", "(True, 3)", "(5.0, 3)")


@st.composite
def damaged_clouds(draw: st.DrawFn) -> bytes:
    """An array of another kind, missing, misnamed or added; a header that claims more than there is; sometimes damaged bytes."""
    if draw(st.integers(0, 6)) == 0:
        return draw(_claiming())
    arrays, name = dict(CLOUDS), draw(st.sampled_from(list(CLOUDS)))
    kind = draw(st.sampled_from(("none", "change", "change", "change", "drop", "rename", "add")))
    if kind == "change":
        arrays[name] = np.asarray(draw(st.sampled_from(ARRAY_CHANGES))(arrays[name]))
    elif kind == "add":
        arrays["colour"] = np.zeros(3)
    elif kind != "none":
        values = arrays.pop(name)
        arrays |= {f"_{name}": values} if kind == "rename" else {}
    stream = io.BytesIO()
    draw(st.sampled_from((np.savez, np.savez_compressed)))(stream, **arrays)
    return draw(damaged_bytes(stream.getvalue())) if draw(st.booleans()) else stream.getvalue()


@st.composite
def _claiming(draw: st.DrawFn) -> bytes:
    """A member whose header claims more than it holds, or that unpacks to a great deal."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        if draw(st.integers(0, 3)) == 0:
            archive.writestr("points.npy", bytes(300 * 2**20))
        else:
            kind, shape = draw(st.sampled_from(("<f8", "|i1", "|O", "x"))), draw(st.sampled_from(SHAPES))
            header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n"
            body = bytes(draw(st.sampled_from((0, 120, 10**6))))
            archive.writestr("points.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + body)
        for name in ("offsets", "time"):
            part = io.BytesIO()
            np.save(part, CLOUDS[name])
            archive.writestr(f"{name}.npy", part.getvalue())
    return stream.getvalue()
