"""Joint stiffness: an undeclared spring at a joint, such as a cable harness or a flexure."""

from __future__ import annotations

import numpy as np

from twin.body import Body
from twin.body.counts import joint_names
from twin.effects.base.effect import Effect
from twin.foundation.parameters import Parameter


class JointStiffness(Effect):
    """Each joint is pulled back by tau = -stiffness (q - q_0), q_0 its position in the model's reference pose.

    Source: statics. Cable harnesses and skins: a hundredth to some tenths of the torque scale of a joint a radian.

    >>> from twin.body import Counts
    >>> JointStiffness(stiffness_hip=0.1, n_tendon=Counts.of(1, ("hip",))).per_joint_values("stiffness")
    (0.1,)
    """

    id = "joint_stiffness"
    per_joint = (
        Parameter("stiffness", 0.0, "N*m/rad", 0.0, 5.0, "cable harness, skin, flexure; ours", scale=2e-3),
    )  # fmt: skip
    needs = frozenset({"joints"})
    moves_with = "the angles of the joints"
    plot_against = "position"

    def edit(self, body: Body) -> None:
        if joint_names(self.n_tendon):
            body.add_joint_stiffness(np.array(self.per_joint_values("stiffness")))
