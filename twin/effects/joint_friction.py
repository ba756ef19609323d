"""Joint friction: a bearing, a seal or a sheath rubs with a torque of its own, whatever the tendons pull."""

from __future__ import annotations

from twin.effects.effect import Bearing, Effect, Route
from twin.quantities import Parameter


class JointFriction(Effect):
    """The joint that antagonists turn is held back by a torque f = clip(f + F(v) turn / presliding, -F(v), F(v)) after it turned,

        F(v) = torque + breakaway exp(-(v / stribeck)^2) + viscous v,

    v the rate (rad/s) at which its drive would turn it. By the fuller law it rubs more where it hardly moves, until a film carries
    it, and more again where that is sheared fast: only runs at different rates show it. The joint's own rate is the drive's but
    where it sticks.

    Constant, where the capstan's loss (`tendon_friction`) is in proportion to the sum of both tendons' tension. That sum is twice
    the pretension until one of them falls slack, and grows with the load from there: below, data cannot tell one from the other,
    and never both are claimed. A bearing whose friction goes with what presses on it, both tendons together, is the capstan's law.

    Source: Coulomb, with Dahl's pre-sliding (1968) in its linear limit, Stribeck's curve (1902) and viscous friction as
    Armstrong-Helouvry, Dupont and Canudas de Wit (Automatica 30, 1994) write them. Miniature bearings and lip seals: 0.1-10 mN m; a
    wrist's pins and sheath more.

    >>> float(JointFriction(torque=0.01, viscous=0.002).route().bearing.at(3.0).round(3))
    0.016
    """

    id = "joint_friction"
    parameters = (
        Parameter("torque", 0.0, "N*m", 0.0, 1.0, "bearings, seals, pins of a small joint: 0.1-50 mN m", scale=2e-3),
        Parameter("presliding", 1e-2, "rad", 4e-3, 0.3, "turn from sticking to sliding; ours", scale=5e-3),
        Parameter("breakaway", 0.0, "N*m", 0.0, 1.0, "as much again as `torque` at most, of greased bearings; ours", scale=2e-3),
        Parameter("stribeck", 0.2, "rad/s", 0.01, 10.0, "films form at some mm/s; of pulleys of a few mm; ours", scale=0.1),
        Parameter("viscous", 0.0, "N*m*s/rad", 0.0, 1.0, "grease: some of `torque` at some rad/s; ours", scale=5e-4),
    )
    shape = ("presliding", "stribeck")
    richer = ("breakaway", "stribeck", "viscous")
    akin = ("tendon_friction",)
    needs = frozenset({"antagonists"})
    guesses = ({"torque": 0.01},)
    moves_with = "the direction of travel (hysteresis loop), alike at every load"

    def route(self) -> Route:
        bearing = Bearing(self["torque"], self["presliding"], self["breakaway"], self["stribeck"], self["viscous"])
        return Route(bearing=bearing)
