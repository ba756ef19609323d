"""What measurements.toml declares is no reading, rolls over, or counts on another clock: done on reading, and said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from twin.foundation.errors import DataError
from twin.measurements import Recording, read, write

TOML = """\
format = "twin-measurements/1"
robot = "continuum"
source = "simulation"
{top}
[[channel]]
name = "motor_1_angle"
role = "input"
unit = "deg"
{channel}
[[channel]]
name = "tip_x"
role = "output"
unit = "mm"
[[channel]]
name = "tip_y"
role = "output"
unit = "mm"
[[trial]]
file = "a.csv"
[[trial]]
file = "b.csv"
"""
READINGS = ((350.0, 1.0, 2.0), (5.0, 0.0, 0.0), (-1.0, 0.0, 3.0), (20.0, 2.0, 4.0), (355.0, 2.5, 4.5))


def recorded(folder: Path, top: str = "", channel: str = "", stamps: tuple[str, ...] = ("0", "1", "2", "3", "4")) -> Recording:
    rows = "\n".join(",".join((t, *(repr(v) for v in row))) for t, row in zip(stamps, READINGS, strict=True))
    folder.mkdir()
    (folder / "measurements.toml").write_text(TOML.format(top=top, channel=channel))
    for file in ("a.csv", "b.csv"):
        (folder / file).write_text(f"time,motor_1_angle,tip_x,tip_y\n{rows}\n")
    return read(folder)


def test_nothing_declared_changes_nothing(tmp_path: Path) -> None:
    made = recorded(tmp_path / "set")
    np.testing.assert_allclose(np.degrees(made.trials[0].values["motor_1_angle"]), [r[0] for r in READINGS], rtol=1e-14)
    assert not [n for n in made.notices if "declared:" in n]


def test_a_lost_marker_is_no_reading_where_all_its_coordinates_say_so(tmp_path: Path) -> None:
    made = recorded(tmp_path / "set", top="missing = [0, 0, 0]")
    for name, left in (("tip_x", [1.0, np.nan, 0.0, 2.0, 2.5]), ("tip_y", [2.0, np.nan, 3.0, 4.0, 4.5])):
        np.testing.assert_allclose(1e3 * made.trials[1].values[name], left)
    assert "missing, as declared: no readings are tip 2" in made.notices


def test_a_roll_over_is_undone_past_what_is_missing(tmp_path: Path) -> None:
    """350, 5 (15 on), none, 20 (15 on), 355 (25 back) by hand."""
    made = recorded(tmp_path / "set", channel="missing = -1\nwraps = 360")
    np.testing.assert_allclose(np.degrees(made.trials[0].values["motor_1_angle"]), [350.0, 365.0, np.nan, 380.0, 355.0])
    assert "missing, as declared: no readings are motor_1_angle 2" in made.notices
    assert "wraps, as declared (motor_1_angle at 360): unwrapped within each trial, jumps in motor_1_angle 4" in made.notices


@pytest.mark.parametrize("clock", ["epoch", "ms", "us", "ns"])
def test_stamps_since_1970_are_seconds_from_the_first(clock: str, tmp_path: Path) -> None:
    ticks = {"epoch": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[clock]
    made = recorded(tmp_path / "set", top=f'time = "{clock}"', stamps=tuple(str((1726041600 + k) * ticks) for k in range(5)))
    np.testing.assert_allclose(made.trials[0].time, np.arange(5.0), atol=1e-6)
    assert [t.start for t in made.trials] == [0.0, 0.0]
    assert any(n.startswith(f'time = "{clock}", as declared: the first stamp of each trial is subtracted') for n in made.notices)


def test_what_was_done_is_what_is_written(tmp_path: Path) -> None:
    stamps = ("1726041600.5", "1726041601.5", "1726041602.5", "1726041603.5", "1726041604.5")
    made = recorded(tmp_path / "set", 'time = "epoch"\nmissing = [0, 0, 0]', "missing = -1\nwraps = 360", stamps)
    write(made, tmp_path / "again")
    again = read(tmp_path / "again")
    assert again.data_hash() == made.data_hash()
    assert not [n for n in again.notices if "declared:" in n]


@pytest.mark.parametrize(
    ("top", "channel", "said"),
    [
        ('time = "minutes"', "", "write one of s, epoch, ms, us, ns"),
        ("missing = [0, 0]", "", "such as \\[0, 0, 0\\]"),
        ("", "wraps = 0", "wraps of motor_1_angle: 0; write the span"),
        ("", 'missing = "none"', "missing of motor_1_angle: 'none' is not a number"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_a_way_out(top: str, channel: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=said):
        recorded(tmp_path / "set", top, channel)
