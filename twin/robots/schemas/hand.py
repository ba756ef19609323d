"""Schema of family "hand": the numbers of its silicone fingers, and the palm's."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from twin.robots.schema import Row, Schema, Structure
from twin.robots.schemas import soft
from twin.robots.schemas.soft import Points


class Hand(Structure):
    """[structure] of family "hand"."""

    fingers: Annotated[int, Field(ge=2, le=8)] = Field(description="how many fingers, evenly around the palm")
    cells: Annotated[int, Field(ge=2, le=12)] = Field(5, description="layers of 27-node cells of each, from clamp to tip")
    tendons: Annotated[int, Field(ge=2, le=96)] = Field(description="how many tendons all fingers have together")
    tendon_points: Points = Field(21, description="points of a finger that each tendon runs straight between, equally spaced")
    sensors: Annotated[int, Field(ge=2, le=96)] = Field(description="how many strain-sensing cords all fingers have together")
    sensor_points: Points = Field(29, description="points of a finger that each cord runs straight between")
    markers: Annotated[int, Field(ge=2, le=400)] = Field(description="how many markers all fingers have together")

    def counts(self) -> dict[str, int]:
        one = self.finger()
        every = {"finger": self.fingers, "tendon": self.tendons, "sensor": self.sensors}
        return every | {f"{kind} of a finger": n for kind, n in one.counts().items()}

    def finger(self) -> soft.Soft:
        """Return the structure of one finger."""
        n = self.fingers
        return soft.Soft(
            cells=self.cells, tendons=self.tendons // n, tendon_points=self.tendon_points, sensors=self.sensors // n,
            sensor_points=self.sensor_points, markers=self.markers // n, motors=None,
        )  # fmt: skip

    def find_conflicts(self) -> list[str]:
        kinds = {"tendons": self.tendons, "sensors": self.sensors, "markers": self.markers}
        uneven = [f"{k} = {n}" for k, n in kinds.items() if n % self.fingers]
        return [f"structure: {', '.join(uneven)} cannot be shared evenly by {self.fingers} fingers"] if uneven else []


def finger_values(k: int, structure: Hand, values: Mapping[str, float]) -> dict[str, float]:
    """Return finger k's values (from 0) of the hand's, with the names of a single finger's."""
    one, own = structure.finger().counts(), {}
    for row in soft.SOFT_ROWS:
        kind = row.shape[0] if row.shape else ""
        if row.name in PER_FINGER:
            own[row.name] = values.get(f"{row.name}_{k + 1}", values.get(row.name, row.default or 0.0))
        elif row.name in values:
            own[row.name] = values[row.name]
        else:
            first = k * one[kind] if row.name in PER_SENSOR else 0
            own |= {f"{row.name}_{i + 1}": values[f"{row.name}_{first + i + 1}"] for i in range(one[kind])}
    return own


def find_conflicts(structure: Hand, values: Mapping[str, float]) -> list[str]:
    """Return the contradictions between numbers that are valid on their own."""
    out = soft.find_conflicts(structure.finger(), finger_values(0, structure, values))
    palm, base = values["palm.radius"], values["body.radius_base"]
    if palm < base:
        out.append(f"palm.radius is {1e3 * palm:g} mm; the fingers' bases ({1e3 * base:g} mm) would meet on the axis")
    return out


def usual_channels(structure: Hand) -> list[tuple[str, str, str, float]]:
    """Return a finger's usual channels for each finger."""
    fingers = range(1, structure.fingers + 1)
    return [(f"finger_{k}_{name}", *rest) for k in fingers for name, *rest in soft.usual_channels(structure.finger())]  # type: ignore[misc]


PER_FINGER = {"silicone.youngs_modulus", "mounting.angle"}
PER_SENSOR = {"sensors.resistance", "sensors.stretch", "sensors.compression"}


def _row(row: Row) -> Row:
    """Return a finger's row for the hand: with a number for each finger, for each sensor, or for all fingers alike."""
    if row.name in PER_FINGER:
        return replace(row, shape=("finger",))
    if row.name in PER_SENSOR or not row.shape:
        return row
    return replace(row, shape=tuple(f"{kind} of a finger" for kind in row.shape))


HAND_DIAGRAM = """\
        y ^      finger 2
          |     o
          |
          |   ( palm )     o  finger 1 ----> x
          |
          |     o
                 finger 3        z and the fingers come towards you; each finger's tendon 1 is on its side of the palm's axis
"""

HAND_SCHEMA = Schema(
    structure=Hand,
    rows=(
        Row("palm.radius", "m", "mm", "distance of the fingers' axes from the palm's axis", 5e-3, 1.0),
        *(_row(row) for row in soft.SOFT_ROWS),
    ),
    accuracy=soft.SOFT_SCHEMA.accuracy,
    find_conflicts=find_conflicts,
    usual_channels=usual_channels,
    diagram=HAND_DIAGRAM,
)
