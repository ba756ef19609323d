"""Joint friction: a bearing, a seal or a sheath rubs with a torque of its own, whatever the tendons pull."""

from __future__ import annotations

from twin.effects.effect import Effect, Route
from twin.quantities import Parameter


class JointFriction(Effect):
    """The joint that antagonists turn is held back by torque b, b = clip(b + turn / presliding, -1, 1) after it turned.

    Constant, where the capstan's loss (`tendon_friction`) is in proportion to the sum of both tendons' tension. That sum is twice
    the pretension until one of them falls slack, and grows with the load from there: below, data cannot tell one from the other,
    and never both are claimed. A bearing whose friction goes with what presses on it, both tendons together, is the capstan's law.

    Source: Coulomb, with Dahl's pre-sliding (1968) in its linear limit. Miniature bearings and lip seals: 0.1-10 mN m; a wrist's
    pins and sheath more.

    >>> JointFriction(torque=0.01).route().bearing
    0.01
    """

    id = "joint_friction"
    parameters = (
        Parameter("torque", 0.0, "N*m", 0.0, 1.0, "bearings, seals, pins of a small joint: 0.1-50 mN m", scale=2e-3),
        Parameter("presliding", 1e-2, "rad", 4e-3, 0.3, "turn from sticking to sliding; ours", scale=5e-3),
    )
    shape = ("presliding",)
    akin = ("tendon_friction",)
    needs = frozenset({"antagonists"})
    guesses = ({"torque": 0.01},)
    moves_with = "the direction of travel (hysteresis loop), alike at every load"

    def route(self) -> Route:
        return Route(bearing=self["torque"], bearing_presliding=self["presliding"])
