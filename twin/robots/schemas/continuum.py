"""Schema of family "continuum", in the order of the signal: backbone, disks, tendons, markers, frame, springs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from twin.body.drives.spring import SPRING_PREFIX
from twin.foundation.parameters import parameter_array
from twin.robots.schema import FULL_TURN, Row, Schema
from twin.robots.schemas.motor_rows import MOTOR_ROWS, Motorised, motor_conflicts
from twin.robots.schemas.spring_rows import SPRING_ROWS, spring_conflicts

Disk = Annotated[int, Field(ge=1, le=200)]
WIRE, CAST = frozenset({'body = "wire"'}), frozenset({'body = "cast"'})
ROUND_SECTION, OTHER_SECTION = frozenset({'section = "round"'}), frozenset({'section = "other"'})
ON_DISKS, LISTED = frozenset({'markers = "disk"'}), frozenset({"markers = [disk, ...]"})
MIN_FREE_SHARE = 0.02  # of a pitch between disks' faces that must be free to bend
LENGTH_TOLERANCE = 5e-3  # of the length: pitches written with three digits may add up to as much more or less
MAX_JOINT_SETS = 400  # of a robot: a tangent of 1,200 by 1,200, factorised in tenths of a second


class Continuum(Motorised):
    """[structure] of family "continuum"."""

    body: Literal["wire", "cast"] = Field(
        "wire",
        description='"wire": a slender rod through disks that does not stretch; "cast": elastomer around its tendons, which does',
    )
    section: Literal["round", "other"] = Field(
        "round",
        description='of the wire: "round", which bends alike in all directions, or "other", described by its stiffnesses',
    )
    disks: Disk = Field(description="how many disks (of a cast body: places where the tendons' channels are followed)")
    tendons: Annotated[int, Field(ge=1, le=24)] = Field(description="how many tendons")
    rods: bool = Field(False, description="true: the tendons are rods, which push as well as pull (push rods, further backbones)")
    tendons_end: Disk | list[Disk] | None = Field(
        None, description="the disk at which all tendons end, or a list of one a tendon (segments); left out: the last"
    )
    pieces: Annotated[int, Field(ge=1, le=20)] | list[Annotated[int, Field(ge=1, le=20)]] = Field(
        1,
        description="of the wire: how many pieces each disk interval is divided into, or a list of one a disk. A piece has two "
        "joint sets; where one bends by half a radian the tip is off by 0.2 % of the length",
    )
    markers: Literal["disk"] | list[Disk] = Field(
        "disk",
        description='"disk": a marker disk_K in the centre of every disk; or a list of disks that carry marker_1, marker_2, ...',
    )

    imus: list[Disk] = Field([], description="a list of disks that carry imu_1, imu_2, ..., turned by `imus.turn`")

    def counts(self) -> dict[str, int]:
        return {
            "disk": self.disks,
            "tendon": self.tendons,
            "marker": len(self.markers),
            "motor": len(self.motors or ()),
            "imu": len(self.imus),
        }

    def kinds(self) -> frozenset[str]:
        body = CAST if self.body == "cast" else WIRE | (ROUND_SECTION if self.section == "round" else OTHER_SECTION)
        return body | self.motor_kinds() | (ON_DISKS if self.markers == "disk" else LISTED)

    def ends(self) -> list[int]:
        """Return the disk at which each tendon ends."""
        if isinstance(self.tendons_end, list):
            return self.tendons_end
        return [self.tendons_end or self.disks] * self.tendons

    def divided(self) -> list[int]:
        """Return the number of pieces of each disk interval."""
        return self.pieces if isinstance(self.pieces, list) else [self.pieces] * self.disks

    def find_conflicts(self) -> list[str]:
        out = self.motor_problems(self.tendons)
        if len(self.ends()) != self.tendons or max(self.ends()) > self.disks:
            one = f"a disk from 1 to {self.disks} is needed, or a list of {self.tendons}, one a tendon"
            out.append(f"structure: tendons_end is {self.tendons_end}; {one}")
        if self.markers != "disk" and not (self.markers and max(map(int, self.markers)) <= self.disks):
            out.append(f'structure: markers is {self.markers}; "disk" or a list of disks from 1 to {self.disks} is needed')
        if self.imus and max(map(int, self.imus)) > self.disks:
            out.append(f"structure: imus is {self.imus}; a list of disks from 1 to {self.disks} is needed")
        if len(self.divided()) != self.disks or 2 * sum(self.divided()) > MAX_JOINT_SETS:
            most = f"not more than {MAX_JOINT_SETS // 2} pieces together"
            out.append(f"structure: pieces is {self.pieces}; a number is needed, or a list of {self.disks}, one a disk, {most}")
        if self.body == "cast":
            if self.section != "round":
                out.append('structure: section is "other" and body is "cast"; a cast body is round here, leave section out')
            if max(self.divided()) > 1:
                out.append("structure: pieces is of a wire; divide a cast body by more disks, which its channels then follow")
        return out


def hole_places(structure: Continuum, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance from the axis (m) and the angle (rad) of all holes, (n_tendon, n_disk + 1), base plate first."""
    n, nt = structure.disks, structure.tendons
    at = np.concatenate([[0.0], np.cumsum(parameter_array(values, "disks.pitch", n))])
    outward, turn = (np.pad(parameter_array(values, f"holes.{key}", nt, n), ((0, 0), (1, 0))) for key in ("outward", "turn"))
    radius = values["tendons.radius"] + values.get("tendons.slope", 0.0) * at
    return radius + outward, parameter_array(values, "tendons.angle", nt)[:, None] + turn


def disk_masses(values: Mapping[str, float], n: int) -> np.ndarray:
    """Return the masses (n,) kg of n disks."""
    return np.full(n, values["disks.mass"] / n) if "disks.mass" in values else parameter_array(values, "disks.mass", n)


def find_conflicts(structure: Continuum, values: Mapping[str, float]) -> list[str]:
    """Return the contradictions between numbers that are valid on their own."""
    out = []
    pitch = parameter_array(values, "disks.pitch", structure.disks)
    z = np.concatenate([[0.0], np.cumsum(pitch)])
    stated = values.get("backbone.length")  # only checked: the robot is built from the pitches
    if stated is not None and abs(stated - z[-1]) > LENGTH_TOLERANCE * z[-1]:
        out.append(f"backbone.length is {1e3 * stated:g} mm and the pitches add up to {1e3 * z[-1]:g} mm; correct one of them")
    radius = hole_places(structure, values)[0]
    used = [(radius[t, k], t + 1, k) for t, end in enumerate(structure.ends()) for k in range(end + 1)]
    if structure.body == "wire":
        out += _wire_conflicts(structure, values, used, pitch)
    else:
        out += _cast_conflicts(values, z, min(used)[0])
    if structure.rods and any(name.startswith(SPRING_PREFIX) for name in values):
        out.append("structure: rods is true and there are SMA springs, which only pull; leave out rods or the springs")
    return out + motor_conflicts(values) + spring_conflicts(values)


def _wire_conflicts(
    structure: Continuum, values: Mapping[str, float], used: list[tuple[float, int, int]], pitch: np.ndarray
) -> list[str]:
    out = []
    rim, wire = values["disks.radius"], values["backbone.radius"]
    for hole, t, k in (min(used), max(used)):
        if not wire < hole <= rim:
            unequal = any(name.startswith("holes.outward_") for name in values)
            which = (
                f"the hole of tendon {t} at {f'disk {k}' if k else 'the base plate'} lies at" if unequal else "tendons.radius is"
            )
            out.append(
                f"{which} {1e3 * hole:g} mm; holes lie between the backbone ({1e3 * wire:g} mm) and the rim of the "
                f"disks (disks.radius, {1e3 * rim:g} mm)"
            )
            break
    thickness = np.concatenate([[0.0], parameter_array(values, "disks.thickness", structure.disks)])
    free = pitch - 0.5 * (thickness[:-1] + thickness[1:])
    if free.min() < MIN_FREE_SHARE * pitch[k := int(free.argmin())]:
        out.append(
            f"disks.thickness leaves {1e3 * free[k]:g} mm of the {1e3 * pitch[k]:g} mm before disk {k + 1} free to bend; "
            "thinner disks or a longer disks.pitch are needed"
        )
    return out


def _cast_conflicts(values: Mapping[str, float], z: np.ndarray, nearest: float) -> list[str]:
    out = []
    n, m = (sum(name.startswith(f"backbone.{key}_") for name in values) for key in ("station", "radius"))
    if n != m:
        return [f"backbone.station has {n} numbers and backbone.radius {m}; a radius for each station is needed"]
    at = parameter_array(values, "backbone.station", n)
    if not np.all(np.diff(at) > 0.0):
        out.append("backbone.station does not rise; write stations from base to tip")
    elif at[0] > LENGTH_TOLERANCE * z[-1] or at[-1] < (1.0 - LENGTH_TOLERANCE) * z[-1]:
        out.append(
            f"backbone.station runs from {1e3 * at[0]:g} to {1e3 * at[-1]:g} mm; the body, from 0 to the sum of the pitches, "
            f"{1e3 * z[-1]:g} mm, must lie between"
        )
    if nearest <= 0.0:
        out.append("tendons.radius + tendons.slope s + holes.outward falls to zero before the tendons' end")
    return out


ROD_STIFFNESS_RANGE = (1e-10, 1e4)  # N m^2, from a carbon fibre to a steel pipe of 10 cm


@dataclass(frozen=True)
class _Rows:
    """Maker of rows with the same kinds and shape."""

    only: frozenset[str] = frozenset()
    shape: tuple[str, ...] = ()

    def row(self, name: str, units: str, meaning: str, low: float, high: float, **more: object) -> Row:
        """Return a row; `units` are the SI unit and, after a space, the usual one."""
        si, _, usual = units.partition(" ")
        return replace(Row(name, si, usual or si, meaning, low, high, for_kinds=self.only, shape=self.shape), **more)  # type: ignore[arg-type]


_all, _wire, _cast, _round, _other = _Rows(), _Rows(WIRE), _Rows(CAST), _Rows(ROUND_SECTION), _Rows(OTHER_SECTION)
_disk, _tendon, _station = _Rows(shape=("disk",)), _Rows(shape=("tendon",)), _Rows(CAST, ("station",))
_on_wire, _hole = _Rows(WIRE, ("disk",)), _Rows(shape=("tendon", "disk"))
_glued = _Rows(LISTED, ("marker",))
CONTINUUM_ROWS = (
    _wire.row(
        "backbone.length",
        "m mm",
        "length from base plate to last disk; only checked, against the sum of `disks.pitch`",
        1e-3,
        10.0,
        checked_only=True,
    ),
    _wire.row(
        "backbone.radius",
        "m mm",
        "radius of the wire, in the middle of its length (other sections: of pictures and inertia)",
        1e-5,
        0.1,
    ),
    _wire.row("backbone.mass", "kg g", "mass of the whole wire", 1e-6, 10.0),
    _Rows(ROUND_SECTION | CAST).row(
        "backbone.youngs_modulus", "Pa GPa", "Young's modulus E of the backbone (of a cast body at small strain)", 1e3, 2e12
    ),
    _round.row(
        "backbone.poisson_ratio", "1", "Poisson's ratio nu; enters the stiffness in twist, G = E / (2 (1 + nu))", -0.99, 0.5
    ),
    _round.row(
        "backbone.radius_taper",
        "1",
        "(radius at the base - radius at the tip) / radius; above zero: thinner towards the tip",
        -1.0,
        1.0,
        default=0.0,
    ),
    *(
        _other.row(
            f"backbone.bending_{a}",
            "N*m^2 N*mm^2",
            f"bending stiffness EI about {a}: against bends in the plane of z and {b}",
            *ROD_STIFFNESS_RANGE,
        )
        for a, b in ("xy", "yx")
    ),
    _other.row("backbone.twisting", "N*m^2 N*mm^2", "stiffness GJ in twist", *ROD_STIFFNESS_RANGE),
    _station.row(
        "backbone.station",
        "m mm",
        "places from the base along the body, rising, between which its radius is linear",
        0.0,
        10.0,
        one_for_all=False,
    ),
    _station.row("backbone.radius", "m mm", "outer radius of the body at each station", 1e-5, 1.0, one_for_all=False),
    _cast.row("backbone.density", "kg/m^3", "density of the cast material", 10.0, 3e4),
    _cast.row("backbone.stiffening", "1", "law of the elastomer: from 0, Hooke's, to 1, neo-Hookean", 0.0, 1.0, default=0.0),
    _on_wire.row(
        "disks.mass", "kg g", "mass of each disk; one number alone is that of all disks together, spread evenly", 1e-6, 100.0
    ),
    _wire.row("disks.radius", "m mm", "outer radius of the disks; enters rotary inertia and pictures", 1e-4, 1.0),
    _disk.row(
        "disks.pitch", "m mm", "distance of each disk from the one before, base to tip; the first from the base plate", 1e-4, 1.0
    ),
    _on_wire.row(
        "disks.thickness",
        "m mm",
        "thickness of each disk, its centre where the pitches say; the wire bends between disks only, tendons pass them straight",
        0.0,
        1.0,
        default=0.0,
    ),
    _all.row(
        "tendons.radius", "m mm", "distance of the holes' centres from the backbone's axis (of a cast body at the base)", 1e-4, 1.0
    ),
    _cast.row(
        "tendons.slope",
        "1",
        "change of that distance per length; below zero: closer to the axis towards the tip",
        -1.0,
        1.0,
        default=0.0,
    ),
    _tendon.row(
        "tendons.angle",
        "rad deg",
        "angle of each tendon's holes about +z, from +x towards +y",
        -2 * FULL_TURN,
        2 * FULL_TURN,
        one_for_all=False,
    ),
    _hole.row(
        "holes.turn",
        "rad deg",
        "angle of a tendon's hole in a disk beyond `tendons.angle`; a helical tendon's grows from disk to disk",
        -10 * FULL_TURN,
        10 * FULL_TURN,
        default=0.0,
    ),
    _hole.row(
        "holes.outward",
        "m mm",
        "how much farther from the axis than `tendons.radius` it is; below zero: closer, as of tendons that converge",
        -1.0,
        1.0,
        default=0.0,
    ),
    _Rows(ON_DISKS, ("disk",)).row(
        "markers.axial_offset",
        "m mm",
        "how far beyond the disk's centre its marker sits, along the disk's axis, towards the tip",
        -0.5,
        0.5,
        default=0.0,
    ),
    *(
        _glued.row(
            f"markers.offset_{a}",
            "m mm",
            f"where each marker sits from its disk's centre on the straight robot, along {a} of the base frame",
            -1.0,
            1.0,
            default=0.0,
        )
        for a in "xyz"
    ),
    *(
        rows.row(
            f"{what}.turn_{a}",
            "rad deg",
            f"{a} component of the rotation vector of {whose} axes against the base frame's on the straight robot",
            -2 * FULL_TURN,
            2 * FULL_TURN,
            default=0.0,
        )
        for rows, what, whose in (
            (_Rows(ON_DISKS, ("disk",)), "markers", "each marker's"),
            (_glued, "markers", "each marker's"),
            (_Rows(shape=("imu",)), "imus", "each IMU's"),
        )
        for a in "xyz"
    ),
    *(
        _all.row(
            f"frame.turn_{a}",
            "rad deg",
            f"{a} component of the rotation vector R from base to markers' frame: reported = R x + shift",
            -2 * FULL_TURN,
            2 * FULL_TURN,
            default=0.0,
        )
        for a in "xyz"
    ),
    *(
        _all.row(f"frame.shift_{a}", "m mm", f"{a} component of the shift from base to markers' frame", -10.0, 10.0, default=0.0)
        for a in "xyz"
    ),
    _all.row("damping.time", "s ms", "damping over stiffness (Rayleigh): the shape follows tensions that late", 0.0, 10.0),
    *MOTOR_ROWS,
    *SPRING_ROWS,
)


def usual_channels(structure: Continuum) -> list[tuple[str, str, str, float]]:
    """Return tensions, or motors' angles, as inputs, marker positions as outputs."""
    pull = [(f"tendon_{i}_tension", "input", "N", 0.01) for i in range(1, structure.tendons + 1)]
    if structure.motors:
        pull = [(f"motor_{i}_angle", "input", "deg", 0.1) for i in range(1, len(structure.motors) + 1)]
    marker, n = ("disk", structure.disks) if structure.markers == "disk" else ("marker", len(structure.markers))
    return pull + [(f"{marker}_{k}_{a}", "output", "mm", 0.2) for k in range(1, n + 1) for a in "xyz"]


CONTINUUM_DIAGRAM = """\
            base plate                                   tip
    z = 0       |  pitch_1    disk 1   pitch_2    disk 2 ...
                |-----------o|-----------------o|       hole of tendon 1, at tendons.radius from the axis
    x ^         |            |                  |       and tendons.angle about z
      |         |============|==================|=====  backbone
      o----> z  |            |                  |
     y towards you: angles run from +x towards +y. The straight robot lies along +z.
     Gravity is a vector in this frame: a robot that hangs has [0, 0, 9.81].
     A tendon's holes differ from disk to disk by holes.turn and holes.outward: two tendons through four disks, the first a helix
     of 30 degrees a disk, the second straight, have holes.turn = [[30, 60, 90, 120], [0, 0, 0, 0]] deg.
     A robot of two segments: tendons_end = [4, 4, 4, 8, 8, 8]; beyond disk 4 only the last three tendons pull.
     Tension is positive; displacement is positive where a tendon is pulled in at the base.
"""

CONTINUUM_SCHEMA = Schema(
    structure=Continuum,
    rows=CONTINUUM_ROWS,
    accuracy=Row("accuracy", "m", "mm", "what the description is believed to be good for: no smaller effect is claimed", 1e-9, 0.1),
    find_conflicts=find_conflicts,
    usual_channels=usual_channels,
    diagram=CONTINUUM_DIAGRAM,
)
