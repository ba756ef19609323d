"""Pre-curvature: the body is bent at rest."""

from __future__ import annotations

from twin.effects.effect import Effect
from twin.quantities import Parameter


class BackbonePrecurvature(Effect):
    """A rest curvature u* = (about_x, about_y) in the body frame: m = EI (u - u*); with `slope` it changes along the body as
    u* (1 + slope (s/L - 1/2)), s the distance from the base.

    Each hinge's spring rests at u* h, h the piece of backbone the hinge stands for. Positive about_y bends the tip towards +x.

    Source: Kirchhoff rod with a curved reference (Rucker and Webster 2011). A coiled NiTi wire straightened by hand keeps
    curvature radii of 0.2-5 m.

    >>> BackbonePrecurvature(about_x=0.5)["about_x"]
    0.5
    """

    id = "backbone_precurvature"
    parameters = (
        Parameter("about_x", 0.0, "1/m", -8.0, 8.0, "rest curvature about x; wire from a spool", scale=0.1),
        Parameter("about_y", 0.0, "1/m", -8.0, 8.0, "rest curvature about y", scale=0.1),
        Parameter("slope", 0.0, "1", -2.0, 2.0, "relative change of the rest curvature from base to tip", scale=0.2),
    )
    shape = ("slope",)
    richer = ("slope",)
    guesses = ({"about_x": 0.1, "about_y": 0.1},)
    needs = frozenset({"backbone"})
    moves_with = "nothing: it is there at zero tension, and fades as load grows"

    def edit(self, body) -> None:
        for at in body.joints:
            share = 1.0 + self["slope"] * (at.arclength - 0.5)
            for name, curvature in ((at.bend_x, self["about_x"]), (at.bend_y, self["about_y"])):
                body.spec.joint(name).springref += share * curvature * at.length
