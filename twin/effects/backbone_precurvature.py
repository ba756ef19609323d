"""Pre-curvature: the body is bent at rest."""

from __future__ import annotations

from collections.abc import Iterator

from twin.effects.effect import Effect, Route, Signals, Start
from twin.quantities import Parameter


class BackbonePrecurvature(Effect):
    """A rest curvature u* = (about_x, about_y) in the body frame: m = EI (u - u*); with `slope` it changes along the body as
    u* (1 + slope (s/L - 1/2)), s the distance from the base.

    Each hinge's spring rests at u* h, h the piece of backbone the hinge stands for; in silicone fibres along z are without stress
    1 + u_x* y - u_y* x times as long. Positive about_y bends the tip towards +x.
    Where SMA springs pull, it counts how they were put on: all as long while the body stood bent (`mounted` 1) or straight (0).

    Source: Kirchhoff rod with a curved reference (Rucker and Webster 2011). A coiled NiTi wire straightened by hand keeps
    curvature radii of 0.2-5 m. Silicone that has taken a set: F = F_e G (Rodriguez, Hoger and McCulloch 1994).

    >>> BackbonePrecurvature(about_x=0.5)["about_x"]
    0.5
    """

    id = "backbone_precurvature"
    parameters = (
        Parameter("about_x", 0.0, "1/m", -8.0, 8.0, "rest curvature about x; wire from a spool", scale=0.1),
        Parameter("about_y", 0.0, "1/m", -8.0, 8.0, "rest curvature about y", scale=0.1),
        Parameter("slope", 0.0, "1", -4.0, 4.0, "relative change of the rest curvature from base to tip", scale=0.2),
        Parameter("mounted", 0.0, "1", 0.0, 1.0, "share of the rest bend the body had when its springs were put on", scale=1.0),
    )
    shape = ("slope", "mounted")
    richer = ("slope",)
    needs = frozenset({"rest shape"})
    moves_with = "nothing: it is there at zero tension, and fades as load grows"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Either way of putting springs on, where springs pull."""
        ways = (0.0, 1.0) if any(s.by_current.any() for s in predicted) else (0.0,)
        for mounted in ways:
            yield Start({"about_x": 0.1, "about_y": 0.1, "mounted": mounted}, ("about_x", "about_y"))

    def route(self) -> Route:
        return Route(mounted=self["mounted"])

    def edit(self, body) -> None:
        body.precurve(self["about_x"], self["about_y"], self["slope"])
