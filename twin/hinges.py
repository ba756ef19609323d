"""A slender elastic body as a chain of MuJoCo joints: the names an effect or a solver needs to find its way in it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from twin.body import Body


@dataclass(frozen=True)
class JointSet:
    """Three hinges at one point of the backbone: bending about two axes and twist. In a body that stretches also a slide.

    `arclength` is the point's fraction of the backbone's length (0 base, 1 tip), `length` the piece of backbone (m)
    whose bending the hinges carry.
    """

    bend_x: str
    bend_y: str
    twist: str
    arclength: float
    length: float
    slide: str | None = None


@dataclass(frozen=True, kw_only=True)
class HingeChain(Body):
    """A body of joint sets, two a piece of backbone, of which a disk interval has one or more.

    `disks` lists the sites of the disk centres, base to tip; `tip` is where payload and tip force act. `bows`: tendons are straight
    between disks and the backbone bows away from them; else they run in channels of the body. `stiffening`: of a body that
    stretches, from 0 (Hooke) to 1 (neo-Hookean).
    """

    joints: tuple[JointSet, ...]
    disks: tuple[str, ...]
    tip: str
    length: float
    bows: bool = True
    stiffening: float = 0.0

    def first_mode(self) -> float:
        """As a cantilever with all its mass spread: f = 1.875^2 / (2 pi L^2) sqrt(EI / (m/L)) (Euler-Bernoulli)."""
        model = self.spec.compile()
        first = self.joints[0]
        stiffness = float(model.jnt_stiffness.reshape(model.nv, -1)[model.joint(first.bend_x).id, 0]) * first.length
        per_length = float(model.body_mass.sum()) / self.length
        return 1.875**2 / (2 * math.pi * self.length**2) * math.sqrt(stiffness / per_length)


def hinge_pairs(body: HingeChain) -> Iterator[tuple[str, str]]:
    """Hinges about the same axis in the two joint sets of each piece of backbone."""
    for one, other in zip(body.joints[::2], body.joints[1::2], strict=True):
        yield from ((one.bend_x, other.bend_x), (one.bend_y, other.bend_y), (one.twist, other.twist))
