"""Stiffness asymmetry: the body bends more easily in one plane than in the other."""

from __future__ import annotations

import math

from twin.effects.effect import Effect
from twin.quantities import Parameter


class StiffnessAsymmetry(Effect):
    """Principal bending stiffnesses EI (1 + e) and EI (1 - e), the stiff axis turned by alpha from x.

    The parameters are e cos 2 alpha (`along`) and e sin 2 alpha (`across`), which are smooth at e = 0 where alpha means nothing.
    The hinges are turned to the principal axes. Of a body described by EI_x and EI_y the stiffness about x and y becomes

        EI_x (1 + along),    EI_y (1 - along),    between them sqrt(EI_x EI_y) across.

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
        for at in body.joints:
            x, y = body.spec.joint(at.bend_x).stiffness[0], body.spec.joint(at.bend_y).stiffness[0]
            about_x, about_y, between = x * (1.0 + along), y * (1.0 - along), math.sqrt(x * y) * across
            mean, half = 0.5 * (about_x + about_y), 0.5 * (about_x - about_y)
            e, alpha = math.hypot(half, between) / mean, 0.5 * math.atan2(between, half)
            # Of the two equivalent descriptions (e, alpha) and (-e, alpha - 90 deg), the one that turns the hinges less.
            if abs(alpha) > math.pi / 4:
                e, alpha = -e, alpha - math.copysign(math.pi / 2, alpha)
            c, s = math.cos(alpha), math.sin(alpha)
            for name, axis, own, sign in ((at.bend_x, [c, s, 0], x, 1.0), (at.bend_y, [-s, c, 0], y, -1.0)):
                joint = body.spec.joint(name)
                joint.axis = axis
                factor = mean * (1.0 + sign * e) / own
                joint.stiffness = joint.stiffness * factor
                joint.damping = joint.damping * factor
