"""Load-dependent friction: gears or bearings rub in proportion to the torque that goes through them."""

from __future__ import annotations

from twin.body import Route, Rubbing
from twin.body.drives.counts import joint_names
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter


class LoadDependentFriction(Effect):
    """Each joint with a gear is held back by f = share |tau| z, tau the torque through it (N m; N of a slide), z its slip state,

        z' = s + (z - s) exp(-|turn| / presliding),    s the direction of the turn.

    It grows with payload and outstretched poses, where `joint_friction` stays as it is. A joint has a gear where an actuator turns
    it by itself; what a tendon turns has none, and the tendon's own friction grows with its tension (`tendon_friction`).

    Source: geared servos, Duclusaud, Passault, Padois and Ly (BAM, ICRA 2025): 5-20 % of the torque through the gear; Dahl (1968).

    >>> from twin.body import Counts
    >>> LoadDependentFriction(share=0.1, n_tendon=Counts.of(1, ("hip",))).route().rubbing.load
    (0.1,)
    """

    id = "load_dependent_friction"
    parameters = (
        Parameter("share", 0.0, "1", 0.0, 0.9, "of the torque through a gear; BAM: 0.05-0.2", scale=0.02),
        Parameter("presliding", 1e-3, "rad", 1e-4, 0.05, "turn from sticking to sliding; ours", scale=3e-4),
    )
    inactive_when_off = ("presliding",)
    needs = frozenset({"load friction"})
    guesses = ({"share": 0.05},)
    moves_with = "the direction of travel (hysteresis loop), more under load"
    plot_against = "loop"
    hidden_without = frozenset({DataNeed.REVERSALS, DataNeed.TWO_LOADS})

    def route(self) -> Route:
        loads = tuple(self["share"] for _ in joint_names(self.n_tendon))
        return Route(rubbing=Rubbing(load=loads, presliding=self["presliding"]) if any(loads) else Rubbing())
