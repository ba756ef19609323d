"""Stiffness asymmetry: the body bends more easily in one plane than in the other."""

from __future__ import annotations

from twin.body import Body
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter

# Hinges are in the principal planes, which a change d of e turns by up to d / 2e. A derivative by one Newton step from the shape in
# the planes before is accurate only for a small turn: at e = 0.005 it is off by 8 %, with a step ten times as large by 80 %.
ASYMMETRY_SCALE = 3e-3


class StiffnessAsymmetry(Effect):
    """Principal bending stiffnesses EI (1 + e) and EI (1 - e), the stiff axis turned by alpha from x.

    The parameters are e cos 2 alpha (`along`) and e sin 2 alpha (`across`), which are smooth at e = 0, where alpha is undefined.
    The stiffness about x and y of a body described by EI_x and EI_y becomes

        EI_x (1 + along),    EI_y (1 - along),    between them sqrt(EI_x EI_y) across.

    Source: Kirchhoff rod with K_bt = diag(EI_x, EI_y, GJ). A seam, a flat or a second wire in the body.

    >>> import math
    >>> round(math.hypot(*(StiffnessAsymmetry(along=0.03, across=0.04)[k] for k in ("along", "across"))), 3)
    0.05
    """

    id = "stiffness_asymmetry"
    parameters = (
        Parameter("along", 0.0, "1", -0.6, 0.6, "e cos(2 alpha)", scale=ASYMMETRY_SCALE),
        Parameter("across", 0.0, "1", -0.6, 0.6, "e sin(2 alpha)", scale=ASYMMETRY_SCALE),
    )
    guesses = ({"along": 0.03, "across": 0.03},)
    needs = frozenset({"planes"})
    moves_with = "the direction of bending"
    plot_against = "azimuth"
    hidden_without = frozenset({DataNeed.EVERY_TENDON})

    def edit(self, body: Body) -> None:
        if self["along"] or self["across"]:
            body.set_bending_anisotropy(self["along"], self["across"])
