"""A slender elastic body as a chain of MuJoCo joints, with the joints' and sites' names for effects and solvers."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from twin.body.body import Body
from twin.foundation.parameters import Size

REFERENCE_SIZE = (0.12, 1.625)  # m, N: length and bending tension of the robot for which effects' numbers are written


@dataclass(frozen=True)
class JointSet:
    """Three hinges at one point of the backbone, bending about two axes and twist; a body that stretches also has a slide.

    `arclength` is the point's fraction of the backbone's length (0 base, 1 tip), `length` the piece of backbone (m) whose bending
    the hinges represent.
    """

    bend_x: str
    bend_y: str
    twist: str
    arclength: float
    length: float
    slide: str | None = None


@dataclass(frozen=True, kw_only=True)
class HingeChain(Body):
    """A body of joint sets, two for each piece of backbone; a disk interval has one or more pieces.

    `disks` lists the sites of the disk centres, base to tip; payload and tip force act at `tip`. With `straight_tendons` the
    tendons are straight between disks and the backbone bows away from them (rods follow it); else they run in channels of the body.
    `stiffening` of a body that stretches goes from 0 (Hooke) to 1 (neo-Hookean).
    """

    joints: tuple[JointSet, ...]
    disks: tuple[str, ...]
    tip: str
    length: float
    straight_tendons: bool = True
    stiffening: float = 0.0

    @property
    def size(self) -> Size:
        """Its length, and the tension at which one tendon bends it by a radian, 1 / (r sum h/EI), over the reference robot's.

        Rounded to two digits: nothing depends on more.
        """
        flexible = sum(1.0 / min(self.spec.joint(n).stiffness[0] for n in (at.bend_x, at.bend_y)) for at in self.joints)
        radius = max(math.hypot(*self.spec.site(holes[0]).pos[:2]) for holes in self.tendon_sites)
        length, force = (
            float(f"{x / one:.2g}") for x, one in zip((self.length, 1.0 / (radius * flexible)), REFERENCE_SIZE, strict=True)
        )
        return Size(length, force)

    def set_bending_anisotropy(self, along: float, across: float) -> None:
        """Change EI_x to EI_x (1 + along), EI_y to EI_y (1 - along), coupled by sqrt(EI_x EI_y) across.

        The hinges are turned to the principal axes.
        """
        for at in self.joints:
            x, y = self.spec.joint(at.bend_x).stiffness[0], self.spec.joint(at.bend_y).stiffness[0]
            about_x, about_y, between = x * (1.0 + along), y * (1.0 - along), math.sqrt(x * y) * across
            mean, half = 0.5 * (about_x + about_y), 0.5 * (about_x - about_y)
            e, alpha = math.hypot(half, between) / mean, 0.5 * math.atan2(between, half)
            # (e, alpha) and (-e, alpha - 90 deg) are equivalent: use the one that turns the hinges less.
            if abs(alpha) > math.pi / 4:
                e, alpha = -e, alpha - math.copysign(math.pi / 2, alpha)
            c, s = math.cos(alpha), math.sin(alpha)
            for name, axis, own, sign in ((at.bend_x, [c, s, 0], x, 1.0), (at.bend_y, [-s, c, 0], y, -1.0)):
                joint = self.spec.joint(name)
                joint.axis = axis
                factor = mean * (1.0 + sign * e) / own
                joint.stiffness = joint.stiffness * factor
                joint.damping = joint.damping * factor

    def set_stiffness_gradient(self, slope: float) -> None:
        """Multiply all stiffnesses by 1 + slope (s/L - 1/2), s the distance from the base."""
        for at in self.joints:
            factor = 1.0 + slope * (at.arclength - 0.5)
            for name in (at.bend_x, at.bend_y, at.twist, *((at.slide,) if at.slide else ())):
                joint = self.spec.joint(name)
                joint.stiffness = joint.stiffness * factor
                joint.damping = joint.damping * factor

    def set_rest_curvature(self, about_x: float, about_y: float, slope: float) -> None:
        """Bend the hinges' rest angles by a curvature (1/m), times 1 + slope (s/L - 1/2), over the pieces they represent."""
        for at in self.joints:
            share = 1.0 + slope * (at.arclength - 0.5)
            for name, curvature in ((at.bend_x, about_x), (at.bend_y, about_y)):
                self.spec.joint(name).springref += share * curvature * at.length

    def move_tendon_holes(self, tendon: int, angle: float, further: float) -> None:
        """Move all holes of a tendon (from 0) about the backbone by `angle` (rad) and away from it by `further` (m)."""
        for name in self.tendon_sites[tendon]:
            site = self.spec.site(name)
            x, y, z = site.pos
            radius, azimuth = math.hypot(x, y) + further, math.atan2(y, x) + angle
            site.pos = [radius * math.cos(azimuth), radius * math.sin(azimuth), z]

    def first_mode_frequency(self) -> float:
        """Return the frequency (Hz) of a uniform cantilever: f = 1.875^2 / (2 pi L^2) sqrt(EI / (m/L)) (Euler-Bernoulli)."""
        model = self.spec.compile()
        first = self.joints[0]
        stiffness = float(model.jnt_stiffness.reshape(model.nv, -1)[model.joint(first.bend_x).id, 0]) * first.length
        per_length = float(model.body_mass.sum()) / self.length
        return 1.875**2 / (2 * math.pi * self.length**2) * math.sqrt(stiffness / per_length)


def hinge_pairs(body: HingeChain) -> Iterator[tuple[str, str]]:
    """Yield the pairs of hinges about the same axis in the two joint sets of each piece of backbone."""
    for one, other in zip(body.joints[::2], body.joints[1::2], strict=True):
        yield from ((one.bend_x, other.bend_x), (one.bend_y, other.bend_y), (one.twist, other.twist))
