"""Reflected inertia: rotor and gear weigh more on a joint than described."""

from __future__ import annotations

import numpy as np

from twin.body import Body
from twin.body.drives.counts import joint_names
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter


class ReflectedInertia(Effect):
    """The inertia of each joint is I = I_described + inertia: a rotor of J behind a gear of ratio n weighs n^2 J on it.

    It does not hang: gravity is as described, and only fast motion shows it.

    Source: rigid-body dynamics. Servos of 1 to 10 N m: 0.001 to 0.05 kg m^2.

    >>> from twin.body import Counts
    >>> ReflectedInertia(inertia_hip=0.01, n_tendon=Counts.of(1, ("hip",))).per_joint_values("inertia")
    (0.01,)
    """

    id = "reflected_inertia"
    per_joint = (
        Parameter("inertia", 0.0, "kg*m^2", 0.0, 0.05, "n^2 J of a rotor behind a gear", scale=2e-5),
    )  # fmt: skip
    needs = frozenset({"joints"})
    moves_with = "the acceleration of the joints"
    plot_against = "rate"
    hidden_without = frozenset({DataNeed.TWO_RATES})

    def edit(self, body: Body) -> None:
        if joint_names(self.n_tendon):
            body.add_joint_inertia(np.array(self.per_joint_values("inertia")))
