"""Schema of family "transmission"."""

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from twin.robots.schema import FULL_TURN, Row, Schema, Structure

MAX_ANGLE = 2.0 * FULL_TURN  # rad


class Transmission(Structure):
    """[structure] of family "transmission"."""

    tendons: Literal[2] = Field(description="two antagonists")
    crossed: bool = Field(False, description="whether the jaw turns against the drum")

    def counts(self) -> dict[str, int]:
        return {"tendon": 2}


def find_conflicts(structure: Transmission, values: Mapping[str, float]) -> list[str]:
    """Return no contradictions: numbers that are valid on their own are valid together."""
    return []


def usual_channels(structure: Transmission) -> list[tuple[str, str, str, float]]:
    """Return the drum's angle and the jaw's torque as inputs, the jaw's angle as output."""
    return [
        ("joint_1_angle", "input", "deg", 0.1), ("joint_2_torque", "input", "N*m", 1e-3), ("joint_2_angle", "output", "deg", 0.1)
    ]  # fmt: skip


TRANSMISSION_ROWS = (
    Row(
        "drum.radius",
        "m",
        "mm",
        "radius of the drum the tendons are wound on; turned by q it pulls tendon 1 in by radius q",
        1e-4,
        1.0,
    ),
    Row("pulley.radius", "m", "mm", "radius of the pulley that turns the jaw", 1e-4, 1.0),
    Row("jaw.rest", "rad", "deg", "angle of the jaw where the drum stands at zero and nothing loads it", -MAX_ANGLE, MAX_ANGLE),
    Row("jaw.length", "m", "mm", "length of the jaw; pictures and inertia", 1e-4, 1.0),
    Row("jaw.mass", "kg", "g", "mass of the jaw; counts in rollouts only", 1e-6, 10.0),
    Row("shaft.length", "m", "mm", "length of the shaft, from drum to pulley; pictures", 1e-3, 10.0),
    Row(
        "tendons.wrap",
        "rad",
        "deg",
        "angle by which each tendon turns over idlers on its way; with friction its tension falls there",
        0.0,
        10.0 * MAX_ANGLE,
    ),
    Row("tendons.stretch", "m/N", "mm/N", "how much longer a tendon gets per newton", 0.0, 1.0),
    Row("tendons.pretension", "N", "N", "tension of both tendons at rest", 0.0, 1e4),
)

TRANSMISSION_DIAGRAM = """\
     drum (joint 1)             shaft, along +z               jaw (joint 2)
       ___   tendon 1  ------------------------------------    ___
      ( o )                                                   ( o )=====>
       ---   tendon 2  ------------------------------------    ---
     x ^
       |
       o----> z    y towards you: the jaw turns about y.
     Turning the drum by q > 0 pulls tendon 1 in; a crossed pair turns the jaw the other way.
"""

TRANSMISSION_SCHEMA = Schema(
    structure=Transmission,
    rows=TRANSMISSION_ROWS,
    accuracy=Row(
        "accuracy", "rad", "deg", "what the description is believed to be good for: no smaller effect is claimed", 1e-9, 1.0
    ),
    find_conflicts=find_conflicts,
    usual_channels=usual_channels,
    diagram=TRANSMISSION_DIAGRAM,
)
