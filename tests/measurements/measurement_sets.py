"""A small valid measurement set, written as text so that no code under test is needed to make one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

TOML = """\
format  = "twin-measurements/1"
robot   = "continuum"
title   = "Bench test"
source  = "hardware"
gravity = [-9.81, 0.0, 0.0]

[[channel]]
name  = "tendon_1_tension"
role  = "input"
unit  = "gf"
noise = 2.0

[[channel]]
name = "tip_x"
role = "output"
unit = "mm"
noise = 0.25

[[channel]]
name = "ambient_temperature"
role = "context"
unit = "degC"
noise = 0.5

[[channel]]
name = "sma_1_current"
role = "context"
unit = "mA"

[[trial]]
file        = "a.csv"
start       = 0.0
tip_payload = "10 g"
cloud       = "a.clouds.npz"

[[trial]]
file = "b.csv"
start = 60
"""
CSV = """\
time,tendon_1_tension,tip_x,ambient_temperature,sma_1_current
0.0,0,0.1,23,0
0.1,100,1.2,23,3
0.2,200,,23,250
0.3,300,NaN,23.5,500
"""


def write_set(folder: Path) -> Path:
    """Writes the set to `folder` and returns it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "measurements.toml").write_text(TOML)
    for name in ("a.csv", "b.csv"):
        (folder / name).write_text(CSV)
    write_clouds(folder / "a.clouds.npz")
    return folder


def write_clouds(path: Path, **changed: object) -> None:
    """Two frames of two points and one of one, in metres; `changed` replaces or adds members."""
    arrays = {"points": np.arange(15.0).reshape(5, 3) / 100, "offsets": np.array([0, 2, 4, 5]), "time": np.array([0.0, 0.1, 0.2])}
    np.savez(path, **{**arrays, **changed})  # type: ignore[arg-type]


def edit(path: Path, old: str, new: str) -> None:
    """Replaces the one place where `old` stands."""
    text = path.read_text()
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {path.name}"
    path.write_text(text.replace(old, new))
