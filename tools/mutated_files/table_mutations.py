"""Mistakes in CSV and Parquet files."""

from __future__ import annotations

from pathlib import Path
from random import Random

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from tools.mutated_files.sources import COLUMNS, csv_text
from tools.mutated_files.toml_mutations import misspelt

CELLS = (
    "", "nan", "NaN", "-nan", "nan(1)", "NAN(0x1)", "inf", "-inf", "1e999", "1e-9", "0x10", "1_0", "1,0", "abc", "-100", "-1",
    "1e308", "5e-324", '"1"', '"1', "1;2", " 1 ", "\t1", "None", "null", "NA", "#N/A", "true", "\uff11", "1e", "--1", "1" * 5000,
    "0.1", "-9999", "1e300",
)  # fmt: skip


def mutated_csv(random: Random) -> bytes:
    rows = [line.split(",") for line in csv_text().splitlines()]
    for _ in range(random.choice((1, 1, 2, 3))):
        random.choice(MUTATIONS)(rows, random)
    data = "\n".join(",".join(row) for row in rows).encode()
    return random.choice(ENCODINGS)(data, random) if random.random() < 0.25 else data + b"\n"


def _cell(rows: list[list[str]], random: Random) -> None:
    row = rows[random.randrange(len(rows))]
    row[random.randrange(len(row))] = random.choice(CELLS)


def _header(rows: list[list[str]], random: Random) -> None:
    at = random.randrange(len(rows[0]))
    names = (misspelt(rows[0][at], random), "tip_y", "disk_1_x", "", rows[0][0], "time", "tendon_1_displacement", "x" * 5000, "[/]")
    rows[0][at] = random.choice(names)


def _columns(rows: list[list[str]], random: Random) -> None:
    """Permuted, with or without the header; one dropped; many added."""
    order = list(range(len(rows[0])))
    random.shuffle(order)
    kind = random.randrange(4)
    if kind == 0:
        rows[:] = [[row[k] for k in order if k < len(row)] for row in rows]
    elif kind == 1:
        rows[0] = [rows[0][k] for k in order]
    elif kind == 2:
        rows[:] = [row[:-1] for row in rows]
    else:
        count = random.choice((1, 3, 10_000))
        rows[0] += [f"more_{k}" for k in range(count)]
        for row in rows[1:]:
            row += ["1"] * count


def _rows(rows: list[list[str]], random: Random) -> None:
    at = random.randrange(len(rows))
    kind = random.randrange(5)
    if kind == 0:
        del rows[at]
        if not rows:
            rows.append([""])
    elif kind == 1:
        rows.insert(at, list(rows[at]))
    elif kind == 2:
        rows[at] = rows[at][:-1] or [""]
    elif kind == 3:
        rows[at] = [*rows[at], "7"]
    else:
        rows.insert(at, [""])


def _time(rows: list[list[str]], random: Random) -> None:
    factor = random.choice((1e-3, 1e-9, 1e-12, 1e3, 1e9, 1e300, -1.0, 0.0))
    for row in rows[1:]:
        try:
            row[0] = repr(float(row[0]) * factor)
        except ValueError:
            continue


MUTATIONS = (_cell, _cell, _cell, _header, _columns, _rows, _time)
ENCODINGS = (
    lambda data, random: data[: random.randrange(len(data))],
    lambda data, random: data.decode().encode(random.choice(("utf-16", "utf-32"))),
    lambda data, random: b"\xef\xbb\xbf" + data,
    lambda data, random: data.replace(b"\n", random.choice((b"\r\n", b"\r"))),
    lambda data, random: data.replace(b",", random.choice((b";", b"\t", b" "))),
    lambda data, random: data + b"\n\0",
    lambda data, random: data + b"\n\xff",
)


def write_mutated_parquet(path: Path, random: Random) -> None:
    columns: dict[str, object] = dict(COLUMNS)
    name = random.choice(list(columns))
    n = len(COLUMNS["time"])
    odd = (
        None, [None] * n, [float("nan")] * n, [float("inf")] * n, ["1"] * n, [True] * n, [1] * n, [-1.0] * n, [1e300] * n,
        [[1.0]] * n,
        pa.array([1, 2, 3, 4], pa.int8()), pa.array([1, 2, 3, 4], pa.float32()), pa.array([1, 2, 3, 4], pa.decimal128(9, 2)),
        pa.array([1, 2, 3, 4], pa.timestamp("s")), pa.array(["1"] * n).dictionary_encode(), list(COLUMNS["time"])[::-1], [0.0,
        1e-9, 2e-9, 3e-9],
    )  # fmt: skip
    kind = random.randrange(6)
    if kind <= 2:
        columns[name] = random.choice(odd)
        columns = {key: value for key, value in columns.items() if value is not None}
    elif kind == 3:
        columns[misspelt(name, random)] = columns.pop(name)
    elif kind == 4:
        rows = random.choice((10**5, 6 * 10**6))
        columns = {key: np.zeros(rows) for key in columns} | {"time": np.arange(rows) * 1e-3}
    else:
        columns |= {f"more_{k}": [1.0] * n for k in range(random.choice((1, 2000)))}
    pyarrow.parquet.write_table(pa.table(columns), path)  # type: ignore[arg-type]
    if kind != 4 and random.random() < 0.3:
        data = bytearray(path.read_bytes())
        for _ in range(random.randrange(1, 20)):
            data[random.randrange(len(data))] = random.randrange(256)
        path.write_bytes(data if random.random() < 0.7 else data[: random.randrange(len(data))])
