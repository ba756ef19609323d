"""What a family's builder returns: the MjSpec and the names an effect, a solver or a sensor needs to find its way in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco


@dataclass(frozen=True)
class JointSet:
    """Three hinges at one point of the backbone: bending about two axes and twist.

    `arclength` is the point's fraction of the backbone's length (0 base, 1 tip), `length` the piece of backbone (m)
    whose bending the hinges carry.
    """

    bend_x: str
    bend_y: str
    twist: str
    arclength: float
    length: float


@dataclass(frozen=True)
class Body:
    """A robot as an editable MuJoCo model.

    `tendons[i]` lists the sites tendon i + 1 passes, base to tip; `markers` maps a channel prefix ("disk_3") to its site;
    `disks` lists the sites of the disk centres, base to tip; `tip` is where payload and tip force act.
    """

    spec: mujoco.MjSpec
    joints: tuple[JointSet, ...]
    tendons: tuple[tuple[str, ...], ...]
    markers: dict[str, str]
    disks: tuple[str, ...]
    tip: str
    length: float


def hinge_pairs(body: Body) -> Iterator[tuple[str, str]]:
    """Hinges about the same axis in the two joint sets of each disk interval."""
    for one, other in zip(body.joints[::2], body.joints[1::2], strict=True):
        yield from ((one.bend_x, other.bend_x), (one.bend_y, other.bend_y), (one.twist, other.twist))
