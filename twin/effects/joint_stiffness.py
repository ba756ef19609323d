"""Joint stiffness: an undeclared spring at a joint, such as a cable harness or a flexure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Body, Signals
from twin.body.drives.counts import joint_names
from twin.effects.base.effect import Effect, FitStart
from twin.foundation.parameters import Parameter


class JointStiffness(Effect):
    """Each joint is pushed by tau = preload - stiffness (q - q_0), q_0 its position in the model's reference pose.

    So the spring rests at q_0 + preload / stiffness: a harness is at rest where it was laid, not where a model has its zero.
    Source: statics. Cable harnesses and skins: a hundredth to some tenths of the torque scale of a joint a radian.

    >>> from twin.body import Counts
    >>> JointStiffness(stiffness_hip=0.1, n_tendon=Counts.of(1, ("hip",))).per_joint_values("stiffness")
    (0.1,)
    """

    id = "joint_stiffness"
    per_joint = (
        Parameter("stiffness", 0.0, "N*m/rad", 0.0, 5.0, "cable harness, skin, flexure; ours", scale=2e-3),
        Parameter("preload", 0.0, "N*m", -5.0, 5.0, "the same, bent by up to a radian at q_0; ours", scale=2e-3),
    )
    needs = frozenset({"joints"})
    moves_with = "the angles of the joints"
    plot_against = "position"

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with a spring at every joint, and its preload along."""
        values = {f"{p.name}_{joint}": p.value + p.step for joint in joint_names(n_tendon) for p in cls.per_joint}
        if values:
            yield FitStart(values, tuple(values))

    def edit(self, body: Body) -> None:
        if joint_names(self.n_tendon):
            stiffness, preload = (np.array(self.per_joint_values(name)) for name in ("stiffness", "preload"))
            body.add_joint_springs(stiffness, preload)
