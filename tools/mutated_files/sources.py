"""Whole files of each kind, from which mutants are made."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from twin.robots import available, load
from twin.robots.robot import models_folder
from twin.robots.starter import robot_text

KINDS = ("robot", "twin", "set", "table", "cloud")

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
"""

SET = """\
format  = "twin-measurements/1"
robot   = "continuum"
title   = "Bench test"
source  = "hardware"
gravity = [0.0, 0.0, 9.81]

[[channel]]
name = "tendon_1_tension"
role = "input"
unit = "gf"
noise = 2.0

[[channel]]
name = "tendon_2_tension"
role = "input"
unit = "N"

[[channel]]
name = "tendon_3_tension"
role = "input"
unit = "N"

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

[[trial]]
file = "a.{suffix}"
start = 0.0
tip_payload = "10 g"
cloud = "a.clouds.npz"

[[trial]]
file = "b.csv"
start = 60
tip_force = "[0, 0, 0.1] N"
"""

COLUMNS = {
    "time": [0.0, 0.1, 0.2, 0.3],
    "tendon_1_tension": [0.0, 100.0, 200.0, 300.0],
    "tendon_2_tension": [0.0, 0.5, 0.25, 0.125],
    "tendon_3_tension": [1.0, 0.5, 0.25, 0.125],
    "tip_x": [0.1, 1.2, None, 3.5],
    "ambient_temperature": [23.0, 23.0, 23.0, 23.5],
}


@cache
def robot_texts() -> tuple[str, ...]:
    """Every shipped robot's file, and every starter's, without what a mistake would not show in: comments, empty lines, sources."""
    shipped = [(models_folder() / name / "robot.toml").read_text("utf-8") for name in available()]
    whole = shipped + [robot_text("mine", load(name)) for name in ("continuum", "cable_tool")]
    bare = (re.sub(r'source = "[^"]*"', 'source = "x"', re.sub(r"(?m)(^|\s+)#.*$", "", text)) for text in whole)
    return tuple(re.sub(r"\n{2,}", "\n", text) for text in bare)


def csv_text() -> str:
    rows = zip(*COLUMNS.values(), strict=True)
    cells = [",".join(COLUMNS), *(",".join("" if v is None else repr(v) for v in row) for row in rows)]
    return "\n".join(cells) + "\n"


def clouds() -> dict[str, np.ndarray]:
    return {"points": np.arange(15.0).reshape(5, 3) / 100, "offsets": np.array([0, 2, 4, 5]), "time": np.array([0.0, 0.1, 0.2])}


def write_set(folder: Path, suffix: str) -> None:
    """A whole measurement set whose first trial is a CSV or Parquet file."""
    folder.mkdir(parents=True)
    (folder / "measurements.toml").write_text(SET.replace("{suffix}", suffix))
    (folder / "b.csv").write_text(csv_text())
    if suffix == "parquet":
        pyarrow.parquet.write_table(pa.table(COLUMNS), folder / "a.parquet")
    else:
        (folder / "a.csv").write_text(csv_text())
    np.savez(folder / "a.clouds.npz", **clouds())  # type: ignore[arg-type]
