"""Schema of family "soft", in the order of the signal: body, silicone, tendons, sensors, markers."""

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from twin.robots.schema import FULL_TURN, Row, Schema
from twin.robots.schemas.motor_rows import MOTOR_ROWS, Motorised, motor_conflicts

Count = Annotated[int, Field(ge=1, le=24)]
Points = Annotated[int, Field(ge=3, le=200)]


class Soft(Motorised):
    """[structure] of family "soft"."""

    cells: Annotated[int, Field(ge=2, le=12)] = Field(5, description="layers of 27-node cells from clamp to tip")
    tendons: Count = Field(description="how many tendons")
    tendon_points: Points = Field(21, description="points of the body that each tendon runs straight between, equally spaced")
    sensors: Count = Field(description="how many strain-sensing cords")
    sensor_points: Points = Field(29, description="points of the body that each cord runs straight between")
    markers: Annotated[int, Field(ge=1, le=200)] = Field(description="how many markers on the skin")

    def counts(self) -> dict[str, int]:
        return {"tendon": self.tendons, "sensor": self.sensors, "marker": self.markers, "motor": len(self.motors or ())}

    def kinds(self) -> frozenset[str]:
        return self.motor_kinds()

    def find_conflicts(self) -> list[str]:
        return self.motor_problems(self.tendons)


def find_conflicts(structure: Soft, values: Mapping[str, float]) -> list[str]:
    """Return the contradictions between numbers that are valid on their own."""
    out = []
    length, clamp = values["body.length"], values["body.clamp"]
    if not clamp < length:
        out.append(f"body.clamp is {1e3 * clamp:g} mm and body.length {1e3 * length:g} mm; some of the body must be free")
    base, tip = values["body.radius_base"], values["body.radius_tip"]
    for kind in ("tendons", "sensors"):
        start, end = values[f"{kind}.start"], values[f"{kind}.end"]
        if not start < end <= length:
            out.append(
                f"{kind} run from {1e3 * start:g} to {1e3 * end:g} mm; a rising way within the body ({1e3 * length:g} mm) is needed"
            )
        for height, name in ((start, "radius_start"), (end, "radius_end")):
            skin = base + (tip - base) * height / length
            if values[f"{kind}.{name}"] > skin:
                out.append(f"{kind}.{name} is {1e3 * values[f'{kind}.{name}']:g} mm; the skin is at {1e3 * skin:.3g} mm there")
    if not clamp < values["tendons.anchor"] < length:
        out.append(f"tendons.anchor is {1e3 * values['tendons.anchor']:g} mm; a height between clamp and tip is needed")
    return out + motor_conflicts(values)


def usual_channels(structure: Soft) -> list[tuple[str, str, str, float]]:
    """Return displacements as inputs, resistances and markers as outputs."""
    pull = [(f"tendon_{i}_displacement", "input", "mm", 0.01) for i in range(1, structure.tendons + 1)]
    if structure.motors:
        pull = [(f"motor_{i}_angle", "input", "deg", 0.1) for i in range(1, len(structure.motors) + 1)]
    return [
        *pull,
        *((f"sensor_{i}_resistance", "output", "ohm", 0.3) for i in range(1, structure.sensors + 1)),
        *((f"marker_{m}_{a}", "output", "mm", 0.2) for m in range(1, structure.markers + 1) for a in "xyz"),
    ]


SOFT_ROWS = (
    Row("body.length", "m", "mm", "length of the cone, from its base face to the tip", 5e-3, 1.0),
    Row("body.radius_base", "m", "mm", "radius at the base face", 1e-3, 0.2),
    Row("body.radius_tip", "m", "mm", "radius at the tip", 1e-3, 0.2),
    Row("body.clamp", "m", "mm", "height up to which all material is held rigidly", 1e-4, 0.9),
    Row("silicone.youngs_modulus", "Pa", "kPa", "Young's modulus E at small strain (neo-Hookean)", 1e3, 1e8),
    Row("silicone.poisson_ratio", "1", "1", "Poisson's ratio nu; silicone hardly changes its volume", 0.4, 0.498),
    Row("silicone.density", "kg/m^3", "kg/m^3", "density", 500.0, 3000.0),
    Row("silicone.damping", "s", "ms", "Rayleigh's coefficient: damping over stiffness, in dynamics", 0.0, 1.0, default=0.01),
    Row(
        "tendons.azimuth",
        "rad",
        "deg",
        "angle of each tendon about the axis, from x towards y",
        -FULL_TURN,
        FULL_TURN,
        ("tendon",),
        one_for_all=False,
    ),
    Row("tendons.start", "m", "mm", "height of the tendons' first point", 0.0, 1.0),
    Row("tendons.end", "m", "mm", "height of their last", 1e-3, 1.0),
    Row("tendons.radius_start", "m", "mm", "distance from the axis of the first point", 1e-4, 0.2),
    Row("tendons.radius_end", "m", "mm", "distance from the axis of the last", 1e-4, 0.2),
    Row("tendons.anchor", "m", "mm", "height from which to the tip a tendon's end pulls at the silicone", 1e-3, 1.0),
    Row(
        "sensors.azimuth", "rad", "deg", "angle of each cord about the axis", -FULL_TURN, FULL_TURN, ("sensor",), one_for_all=False
    ),
    Row("sensors.start", "m", "mm", "height of the cords' first point", 0.0, 1.0),
    Row("sensors.end", "m", "mm", "height of their last", 1e-3, 1.0),
    Row("sensors.radius_start", "m", "mm", "distance from the axis of the first point", 1e-4, 0.2),
    Row("sensors.radius_end", "m", "mm", "distance from the axis of the last", 1e-4, 0.2),
    Row("sensors.resistance", "ohm", "ohm", "R0 of each cord, at no strain", 1e-2, 1e8, ("sensor",)),
    Row("sensors.stretch", "1", "1", "kappa of each cord when stretched: R = R0 (1 + kappa strain)^2", 0.05, 20.0, ("sensor",)),
    Row("sensors.compression", "1", "1", "kappa of each cord when compressed", 0.05, 20.0, ("sensor",)),
    Row("sensors.accuracy", "1", "1", "what the cords' strains are believed to be good for, as `accuracy`", 0.0, 0.1, default=0.0),
    Row(
        "mounting.angle",
        "rad",
        "deg",
        "by which the finger is turned about z against the base frame, counter-clockwise seen from +z",
        -FULL_TURN,
        FULL_TURN,
        default=0.0,
    ),
    Row(
        "markers.azimuth",
        "rad",
        "deg",
        "angle of each marker on the skin about the axis",
        -FULL_TURN,
        FULL_TURN,
        ("marker",),
        one_for_all=False,
    ),
    Row("markers.height", "m", "mm", "height of each marker on the skin", 0.0, 1.0, ("marker",), one_for_all=False),
)

SOFT_DIAGRAM = """\
     clamp |  tendon (azimuth 0)  x x x x x x x x x x   anchor
     ======|---------------------------------------------.
           |  sensor cord   - - - - - - - - -             |
     o-----|----------------------------------------------|---> z
           |                                              |
     ======|----------------------------------------------'
     x up; azimuth 90 deg is y, out of the page. Origin in the centre of the base face.
"""

SOFT_SCHEMA = Schema(
    structure=Soft,
    rows=(*SOFT_ROWS, *MOTOR_ROWS),
    accuracy=Row("accuracy", "m", "mm", "what the description is believed to be good for: no smaller effect is claimed", 1e-9, 0.1),
    find_conflicts=find_conflicts,
    usual_channels=usual_channels,
    diagram=SOFT_DIAGRAM,
)
