"""Named points of a robot's body: `points.csv` beside its robot.toml, rows of name, x_mm, y_mm, z_mm, skin (1 on the skin)."""

import csv
from dataclasses import dataclass

import numpy as np

from twin.foundation.errors import DataError
from twin.robots.robot import Robot

POINTS_FILE = "points.csv"


@dataclass(frozen=True)
class NamedPoints:
    """Names, places at rest (P, 3) m, and which are on the skin (P,)."""

    names: tuple[str, ...]
    rest: np.ndarray
    skin: np.ndarray


def named_points(robot: Robot) -> NamedPoints:
    """Read the named points of a robot. Raises DataError where it has none or the file breaks its contract."""
    path = robot.folder / POINTS_FILE
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        rest = np.array([[1e-3 * float(row[f"{a}_mm"]) for a in "xyz"] for row in rows])
        return NamedPoints(tuple(row["name"] for row in rows), rest, np.array([row["skin"] == "1" for row in rows]))
    except FileNotFoundError:
        raise DataError(f"robot {robot.name!r} has no {POINTS_FILE}: its shape has no named points; the finger has") from None
    except (KeyError, TypeError, ValueError) as fault:
        raise DataError(f"{path}: {fault}; rows of name,x_mm,y_mm,z_mm,skin are needed") from None
