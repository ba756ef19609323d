"""Joint stop: a joint ends earlier than described."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Body, Bumpers, Route, Signals
from twin.body.drives.counts import joint_names
from twin.effects.base.effect import DataNeed, Effect, FitStart, each_then_all
from twin.foundation.parameters import Parameter

NO_STOP = 10.0  # rad or m: farther than any joint of one axis goes
STARTING_SHARE = 0.8  # of a joint's travel: where stops stand from which fits start
ENDS = {"upper": 1.0, "lower": -1.0}


class JointStop(Effect):
    """Each joint stays between two hard stops that push and never pull: lower <= q <= upper, and at the upper one (the lower alike)

        tau >= 0,    tau (upper - q) = 0,

    tau the torque (N m; N of a slide) by which the stop pushes back. It neither gives way nor throws back. The extended law has
    bumpers, alike at all of its stops (Kelvin and Voigt):

        tau = max(0, (r + loss r') / give),    r = q - upper >= 0.

    Where the description has a stop as well, the nearer one holds. The drive does not give way: a servo pushes on.

    Source: unilateral contact. A knuckle that meets the palm, a cable at its end, a bracket on the wrong side, a printed stop.

    >>> from twin.body import Counts
    >>> JointStop(upper_hip=0.7, n_tendon=Counts.of(1, ("hip",))).per_joint_values("upper")
    (0.7,)
    """

    id = "joint_stop"
    parameters = (
        Parameter("give", 0.0, "rad/(N*m)", 0.0, 10.0, "of bumpers and brackets: a degree under a usual load; ours", scale=0.02),
        Parameter("loss", 2e-3, "s", 1e-4, 0.1, "damping over stiffness: bumpers ring a few times; ours", scale=1e-3),
    )
    per_joint = (
        Parameter("upper", NO_STOP, "rad", -NO_STOP, NO_STOP, "where it ends on the positive side", scale=0.02),
        Parameter("lower", -NO_STOP, "rad", -NO_STOP, NO_STOP, "where it ends on the negative side", scale=0.02),
    )
    inactive_when_off = ("loss",)
    extended_parameters = ("give", "loss")
    needs = frozenset({"stops"})
    moves_with = "the ends of the joints' travel"
    plot_against = "position"
    hidden_without = frozenset({DataNeed.EVERY_TENDON})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with a stop that cuts the last fifth off a joint's travel: each end alone, and the same end of all joints."""
        joints = joint_names(n_tendon)
        travelled = [s.others["joints"] for s in predicted if "joints" in s.others]
        if not joints or not travelled:
            return
        low, high = (extreme(np.concatenate(travelled), axis=0) for extreme in (np.nanmin, np.nanmax))
        for end, sign in ENDS.items():
            near, far = (low, high) if sign > 0.0 else (high, low)
            moved = [k for k in range(len(joints)) if abs(far[k] - near[k]) > cls.per_joint[0].step]
            yield from each_then_all([{f"{end}_{joints[k]}": float(near[k] + STARTING_SHARE * (far[k] - near[k]))} for k in moved])

    def edit(self, body: Body) -> None:
        if joint_names(self.n_tendon):
            body.limit_joints(np.array(self.per_joint_values("lower")), np.array(self.per_joint_values("upper")))

    def route(self) -> Route:
        if self["give"] == 0.0:
            return Route()
        ends = zip(self.per_joint_values("lower"), self.per_joint_values("upper"), strict=True)
        return Route(bumpers=Bumpers(self["give"], self["loss"], tuple(low > -NO_STOP or high < NO_STOP for low, high in ends)))
