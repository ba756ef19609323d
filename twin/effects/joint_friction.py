"""Joint friction: a bearing, a seal, a gear or a sheath rubs with a torque that does not depend on any load."""

from __future__ import annotations

from collections.abc import Iterator

from twin.body import Bearing, Route, Rubbing, Signals
from twin.body.drives.counts import joint_names
from twin.effects.base.effect import Effect, FitStart
from twin.foundation.parameters import Parameter


class JointFriction(Effect):
    """The joint that antagonists turn is held back by a torque f = clip(f + F(v) turn / presliding, -F(v), F(v)) after it turned,

        F(v) = torque + breakaway exp(-(v / stribeck)^2) + viscous v,

    v the rate (rad/s) of its drive, which is the joint's own unless it sticks. The extended law has more friction near rest, until
    a lubricating film forms, and again at high rates, where the film is sheared; only runs at different rates show it.

    Each joint of an MJCF has its own torque (a slide's is a force, N); breakaway and viscous parts are in shares of it, the same
    for all. There the slip state follows Dahl's law as it stands: z' = s + (z - s) exp(-|turn| / presliding), f = F(v) z.

    The torque is constant. The capstan's loss (`tendon_friction`) is proportional to the sum of both tensions, which is twice the
    pretension until one tendon is slack, and grows with the load from there. Below that load data cannot separate the two effects,
    and both are never claimed together. A bearing whose friction grows with the tendons' tension follows the capstan's law.

    Source: Coulomb, with Dahl's pre-sliding (1968) in its linear limit, Stribeck's curve (1902) and viscous friction as
    Armstrong-Helouvry, Dupont and Canudas de Wit (Automatica 30, 1994) write them. Miniature bearings and lip seals: 0.1-10 mN m; a
    wrist's pins and sheath more.

    >>> float(JointFriction(torque=0.01, viscous=0.002).route().bearing.friction_torque(3.0).round(3))
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
    per_joint = (
        Parameter("torque", 0.0, "N*m", 0.0, 5.0, "of a joint: bearings 0.1-50 mN m, geared servos 0.05-0.5 N m", scale=2e-3),
    )
    of_joints = (
        Parameter("presliding", 1e-3, "rad", 1e-4, 0.05, "turn from sticking to sliding of gears and bearings; ours", scale=3e-4),
        Parameter("breakaway", 0.0, "1", 0.0, 2.0, "over `torque`, of greased gears: some tenths; ours", scale=0.05),
        Parameter("stribeck", 0.2, "rad/s", 0.01, 10.0, "films form at some mm/s; ours", scale=0.1),
        Parameter("viscous", 0.0, "s/rad", 0.0, 10.0, "over `torque`, of grease; ours", scale=0.02),
    )
    inactive_when_off = ("presliding", "stribeck")
    extended_parameters = ("breakaway", "stribeck", "viscous")
    confusable_with = ("tendon_friction",)
    needs = frozenset({"friction of joints"})
    guesses = ({"torque": 0.01},)
    moves_with = "the direction of travel (hysteresis loop), alike at every load"
    plot_against = "loop"

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        """Return a jaw's parameters, or those of the joints of an MJCF."""
        if not joint_names(n_tendon):
            return super().all_parameters(n_tendon)
        return (*cls.of_joints, *(p for p in super().all_parameters(n_tendon) if p not in cls.parameters))

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start a jaw at its guess, an MJCF with friction in all joints."""
        if joints := joint_names(n_tendon):
            values = {f"torque_{joint}": 5e-3 for joint in joints}
            yield FitStart(values, (*values, "presliding"))
        else:
            yield from super().fit_starts(predicted, n_tendon)

    def route(self) -> Route:
        if torque := self.per_joint_values("torque"):
            more, viscous = (tuple(self[share] * t for t in torque) for share in ("breakaway", "viscous"))
            rubbing = Rubbing(torque, more, (), viscous, self["stribeck"], self["presliding"])
            return Route(rubbing=rubbing if any(torque) else Rubbing())
        bearing = Bearing(self["torque"], self["presliding"], self["breakaway"], self["stribeck"], self["viscous"])
        return Route(bearing=bearing)
