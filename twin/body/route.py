"""Properties of tendons between drive and body (friction, stretch, play), and the delayed strain of creep."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Bearing:
    """Friction of the joint that antagonists turn."""

    torque: float = 0.0  # N m, at every rate
    presliding: float = 1e-2  # rad, from sticking to sliding
    breakaway: float = 0.0  # N m, added at rest
    stribeck: float = 0.2  # rad/s, beyond which the breakaway torque fades
    viscous: float = 0.0  # N m s/rad

    def friction_torque(self, rate: np.ndarray | float) -> np.ndarray:
        """Return the friction torque (n,) N m at rates (n,) rad/s of either sign."""
        rate = np.abs(rate)
        return self.torque + self.breakaway * np.exp(-((rate / self.stribeck) ** 2)) + self.viscous * rate


@dataclass(frozen=True)
class Rubbing:
    """Friction of the joints of an MJCF, (n_joint,) each, in N m of a hinge and N of a slide; () is none.

    The friction of joint j is F_j(v) = torque + breakaway exp(-(v / stribeck)^2) + load |load through it|, of either sign, with a
    pre-sliding turn; viscous friction v `viscous` comes beside it.
    """

    torque: tuple[float, ...] = ()
    breakaway: tuple[float, ...] = ()
    load: tuple[float, ...] = ()  # 1
    viscous: tuple[float, ...] = ()  # N m s/rad
    stribeck: float = 0.2  # rad/s
    presliding: float = 1e-3  # rad

    def beside(self, other: Rubbing) -> Rubbing:
        """Return the friction of both; rate and pre-sliding are those of the first that has any."""

        def both(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
            return tuple(x + y for x, y in zip(a, b, strict=True)) if a and b else a or b

        leads = self if any((self.torque, self.load)) else other
        return Rubbing(
            both(self.torque, other.torque), both(self.breakaway, other.breakaway), both(self.load, other.load),
            both(self.viscous, other.viscous), leads.stribeck, leads.presliding,
        )  # fmt: skip


@dataclass(frozen=True)
class Bumpers:
    """Soft stops of the joints of an MJCF: at a joint's end they push by tau = (r + loss r') / give, r >= 0 the way into it."""

    give: float = 0.0  # rad/(N m); 0: as the model has its stops
    loss: float = 2e-3  # s
    joints: tuple[bool, ...] = ()  # which are soft


@dataclass(frozen=True)
class Route:
    """The properties of the tendons between drive and body, as the effects in force set them."""

    mu: float = 0.0  # friction coefficient
    presliding: float = 4e-4  # m of travel, from sticking to sliding
    stretch: float = 0.0  # m/N
    bedding: float = 0.0  # m by which a tendon beds in
    bedding_tension: float = 1.0  # N over which it beds in
    bearing: Bearing = field(default_factory=Bearing)
    rest_bend_share: float = 0.0  # of its rest bend that the body had when SMA springs were put on
    stall_tension: float = np.inf  # N at which a motor that holds a tendon at a length gives way
    initial_stretch_share: float = 0.0  # of the stretch under the springs' first tension that was there when they were put on
    mu_shares: tuple[float, ...] = ()  # of the tendons of an MJCF, in shares of mu; () is 1 for all
    rubbing: Rubbing = field(default_factory=Rubbing)
    bumpers: Bumpers = field(default_factory=Bumpers)
    backlash: tuple[float, ...] = ()  # m each way of each tendon before its SMA spring follows
    crossing_travel: tuple[float, ...] = (1e-4,)  # m over which the backlash is crossed: each tendon's, or one for all

    def elongation(self, tension: np.ndarray) -> np.ndarray:
        """Return the elongation (m) of a tendon under a tension (N)."""
        return self.stretch * tension + self.bedding * -np.expm1(-tension / self.bedding_tension)


@dataclass(frozen=True)
class Creep:
    """Delayed strain: amplitude (delayed over instant strain) and retardation time (s) of each element."""

    amplitude: tuple[float, ...] = ()
    time: tuple[float, ...] = ()
