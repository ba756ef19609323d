"""Stiffness asymmetry: the body bends more easily in one plane than in the other."""

from __future__ import annotations

import math

from twin.effects.effect import Effect
from twin.quantities import Parameter


class StiffnessAsymmetry(Effect):
    """Principal bending stiffnesses EI (1 + e) and EI (1 - e), the stiff axis turned by alpha from x.

    The parameters are e cos 2 alpha (`along`) and e sin 2 alpha (`across`), which are smooth at e = 0 where alpha means nothing.
    The hinges are turned to the principal axes.

    Source: Kirchhoff rod with K_bt = diag(EI_x, EI_y, GJ). A seam, a flat or a second wire in the body.

    >>> round(math.hypot(*(StiffnessAsymmetry(along=0.03, across=0.04)[k] for k in ("along", "across"))), 3)
    0.05
    """

    id = "stiffness_asymmetry"
    parameters = (
        Parameter("along", 0.0, "1", -0.6, 0.6, "e cos(2 alpha)", scale=0.03),
        Parameter("across", 0.0, "1", -0.6, 0.6, "e sin(2 alpha)", scale=0.03),
    )
    guesses = ({"along": 0.03, "across": 0.03},)
    needs = frozenset({"backbone"})
    moves_with = "the direction of bending"

    def edit(self, body) -> None:
        along, across = self["along"], self["across"]
        if along == across == 0.0:
            return
        e, alpha = math.hypot(along, across), 0.5 * math.atan2(across, along)
        # Of the two equivalent descriptions (e, alpha) and (-e, alpha - 90 deg), the one that turns the hinges less.
        if abs(alpha) > math.pi / 4:
            e, alpha = -e, alpha - math.copysign(math.pi / 2, alpha)
        c, s = math.cos(alpha), math.sin(alpha)
        for at in body.joints:
            for name, axis, sign in ((at.bend_x, [c, s, 0], 1.0), (at.bend_y, [-s, c, 0], -1.0)):
                joint = body.spec.joint(name)
                joint.axis = axis
                joint.stiffness = joint.stiffness * (1.0 + sign * e)
                joint.damping = joint.damping * (1.0 + sign * e)
