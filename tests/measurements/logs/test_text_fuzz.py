"""Any table that a logger may write comes out as the same numbers; any bytes are read or refused in one line."""

from __future__ import annotations

import tempfile
import tomllib
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.foundation.errors import DataError
from twin.measurements.logs import map_text, open_log

NUMBERS = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False, width=64), st.integers(-(10**6), 10**6).map(float), st.just(float("nan"))
)
NAMES = st.lists(st.from_regex(r"[A-Za-z][A-Za-z_]{1,8}[a-z]", fullmatch=True), min_size=2, max_size=5, unique_by=str.lower)


@settings(max_examples=40, deadline=None)
@given(names=NAMES, rows=st.integers(3, 12), delimiter=st.sampled_from(",;\t|"), comma=st.booleans(), data=st.data())
def test_a_table_is_the_same_numbers(names: list[str], rows: int, delimiter: str, comma: bool, data: st.DataObject) -> None:
    cells = [[data.draw(NUMBERS) for _ in names] for _ in range(rows)]
    for row in cells:
        row[0] = 0.5 if np.isnan(row[0]) else row[0]  # a row of empty cells alone is no row
    as_comma = comma and delimiter != ","
    lines = [
        delimiter.join("" if value != value else repr(value).replace(".", "," if as_comma else ".") for value in row)
        for row in cells
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text("\n".join([delimiter.join(names), *lines]) + "\n")
        (stream,) = open_log(path).takes[0].streams.values()
    true = np.array(cells)
    for n, name in enumerate(names):
        found = stream.fields[name].values if name in stream.fields else np.full(rows, np.nan)  # a column of empty cells alone
        np.testing.assert_array_equal(found, true[:, n])


@settings(max_examples=100, deadline=None)
@given(data=st.one_of(st.binary(max_size=200), st.text(alphabet='0123456789.,;\t \n"abc%#-eE{}[]:', max_size=200).map(str.encode)))
def test_any_bytes_are_read_or_refused_in_one_line(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_bytes(data)
        try:
            text = map_text(open_log(path), "m.toml")
        except DataError as fault:
            assert "\n" not in str(fault)  # noqa: PT017 - reading it is as good
        else:
            assert tomllib.loads(text)["format"] == "twin-import/1"
