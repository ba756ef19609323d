"""A slender elastic body as a chain of MuJoCo joints: the names an effect or a solver needs to find its way in it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from twin.body import Body
from twin.quantities import Size

ONE = (0.12, 1.625)  # m, N: length and strength of the nominal robot, for which effects' numbers are written


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

    @property
    def size(self) -> Size:
        """Its length, and the tension at which one tendon bends it by a radian, 1 / (r sum h/EI), beside the nominal robot's; to
        two digits, since nothing depends on more."""
        flexible = sum(1.0 / min(self.spec.joint(n).stiffness[0] for n in (at.bend_x, at.bend_y)) for at in self.joints)
        radius = max(math.hypot(*self.spec.site(holes[0]).pos[:2]) for holes in self.tendons)
        length, force = (float(f"{x / one:.2g}") for x, one in zip((self.length, 1.0 / (radius * flexible)), ONE, strict=True))
        return Size(length, force)

    def bend_unequally(self, along: float, across: float) -> None:
        """Of EI_x and EI_y make EI_x (1 + along), EI_y (1 - along) and sqrt(EI_x EI_y) across between them: the hinges are turned
        to the principal axes."""
        for at in self.joints:
            x, y = self.spec.joint(at.bend_x).stiffness[0], self.spec.joint(at.bend_y).stiffness[0]
            about_x, about_y, between = x * (1.0 + along), y * (1.0 - along), math.sqrt(x * y) * across
            mean, half = 0.5 * (about_x + about_y), 0.5 * (about_x - about_y)
            e, alpha = math.hypot(half, between) / mean, 0.5 * math.atan2(between, half)
            # Of the two equivalent descriptions (e, alpha) and (-e, alpha - 90 deg), the one that turns the hinges less.
            if abs(alpha) > math.pi / 4:
                e, alpha = -e, alpha - math.copysign(math.pi / 2, alpha)
            c, s = math.cos(alpha), math.sin(alpha)
            for name, axis, own, sign in ((at.bend_x, [c, s, 0], x, 1.0), (at.bend_y, [-s, c, 0], y, -1.0)):
                joint = self.spec.joint(name)
                joint.axis = axis
                factor = mean * (1.0 + sign * e) / own
                joint.stiffness = joint.stiffness * factor
                joint.damping = joint.damping * factor

    def grade(self, slope: float) -> None:
        """All stiffnesses times 1 + slope (s/L - 1/2), s the distance from the base."""
        for at in self.joints:
            factor = 1.0 + slope * (at.arclength - 0.5)
            for name in (at.bend_x, at.bend_y, at.twist, *((at.slide,) if at.slide else ())):
                joint = self.spec.joint(name)
                joint.stiffness = joint.stiffness * factor
                joint.damping = joint.damping * factor

    def precurve(self, about_x: float, about_y: float, slope: float) -> None:
        """Hinges that rest bent by the curvature (1/m) of the piece of backbone they stand for, times 1 + slope (s/L - 1/2)."""
        for at in self.joints:
            share = 1.0 + slope * (at.arclength - 0.5)
            for name, curvature in ((at.bend_x, about_x), (at.bend_y, about_y)):
                self.spec.joint(name).springref += share * curvature * at.length

    def reroute(self, tendon: int, angle: float, further: float) -> None:
        """Move all holes of a tendon (from 0) about the backbone by `angle` (rad) and away from it by `further` (m)."""
        for name in self.tendons[tendon]:
            site = self.spec.site(name)
            x, y, z = site.pos
            radius, azimuth = math.hypot(x, y) + further, math.atan2(y, x) + angle
            site.pos = [radius * math.cos(azimuth), radius * math.sin(azimuth), z]

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
