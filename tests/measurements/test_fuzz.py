"""Whatever the bytes, reading gives a recording or a DataError: nothing else escapes, and fast and slow readers agree."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from measurement_sets import CSV, TOML, write_set

from twin.foundation.errors import DataError
from twin.measurements import read
from twin.measurements.parsing.quantity_strings import parse_quantity, unit_scale
from twin.measurements.parsing.tables import _fast_columns, _slow_columns

MANY = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = write_set(tmp_path_factory.mktemp("fuzz") / "set")
    columns = {"time": [0.0, 1.0, 2.0], "tendon_1_tension": [1, 2, 3], "tip_x": [1.0, 2.0, None]}
    columns |= {"ambient_temperature": [20.0] * 3, "sma_1_current": [0.5] * 3}
    pyarrow.parquet.write_table(pa.table(columns), folder / "b.parquet")
    yield folder
    shutil.rmtree(folder)


def damaged(whole: bytes) -> st.SearchStrategy[bytes]:
    """`whole` with a few bytes replaced, a piece cut out, or something put in; or bytes of no sense at all."""
    places = st.lists(st.tuples(st.integers(0, len(whole) - 1), st.integers(0, 255)), min_size=1, max_size=4)

    def replaced(changes: list[tuple[int, int]]) -> bytes:
        data = bytearray(whole)
        for at, byte in changes:
            data[at] = byte
        return bytes(data)

    span = st.tuples(st.integers(0, len(whole)), st.integers(0, len(whole)), st.binary(max_size=20))
    return places.map(replaced) | span.map(lambda cut: whole[: cut[0]] + cut[2] + whole[cut[1] :]) | st.binary(max_size=200)


def one_line_or_fine(call: Callable[[], object]) -> None:
    try:
        call()
    except DataError as refused:
        if "\n" in str(refused):
            pytest.fail(f"more than one line: {refused!r}")


def survives(folder: Path, name: str, data: bytes) -> None:
    path = folder / name
    whole = path.read_bytes()
    path.write_bytes(data)
    try:
        one_line_or_fine(lambda: read(folder))
    finally:
        path.write_bytes(whole)


@MANY
@given(damaged(TOML.encode()))
def test_toml(folder: Path, data: bytes) -> None:
    survives(folder, "measurements.toml", data)


@MANY
@given(damaged(CSV.encode()))
def test_csv(folder: Path, data: bytes) -> None:
    survives(folder, "a.csv", data)


@MANY
@given(st.data())
def test_npz(folder: Path, data: st.DataObject) -> None:
    survives(folder, "a.clouds.npz", data.draw(damaged((folder / "a.clouds.npz").read_bytes())))


@MANY
@given(st.data())
def test_parquet(folder: Path, data: st.DataObject) -> None:
    toml = (folder / "measurements.toml").read_text()
    (folder / "measurements.toml").write_text(toml.replace('"b.csv"', '"b.parquet"'))
    try:
        survives(folder, "b.parquet", data.draw(damaged((folder / "b.parquet").read_bytes())))
    finally:
        (folder / "measurements.toml").write_text(toml)


ODD_CELLS = ["nan", "-NaN", "inf", "Infinity", "1e400", "-0.0", "5e-324", ".5", "5."]
CELL = st.text("0123456789+-.eE naif\t_x", max_size=6) | st.sampled_from(ODD_CELLS)


@MANY
@given(st.lists(st.tuples(CELL, CELL), min_size=1, max_size=4), st.booleans())
def test_fast_and_slow_reader_agree(rows: list[tuple[str, str]], last_line_ends: bool) -> None:
    data = ("a,b\n" + "\n".join(",".join(row) for row in rows) + "\n" * last_line_ends).encode()
    fast = _fast_columns(data, ["a", "b"], ["b", "a"])
    if fast is not None:
        slow = _slow_columns(Path("x.csv"), data, ["a", "b"], ["b", "a"])
        for name in ("a", "b"):
            np.testing.assert_array_equal(fast[name], slow[name])


@MANY
@given(st.text(max_size=30) | st.text("0123456789.+-*/^()² mkgNsdeC", max_size=30))
def test_quantities_and_units(text: str) -> None:
    for call in (lambda: parse_quantity(text, "kg"), lambda: parse_quantity("1 " + text, "K"), lambda: unit_scale(text, "m")):
        one_line_or_fine(call)
