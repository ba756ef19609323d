"""Pre-curvature: the body is bent at rest."""

from __future__ import annotations

from collections.abc import Iterator

from twin.body import Body, Route, Signals
from twin.effects.base.effect import DataNeed, Effect, FitStart
from twin.foundation.parameters import Parameter


class BackbonePrecurvature(Effect):
    """A rest curvature u* = (about_x, about_y) in the body frame: m = EI (u - u*).

    With `slope` it changes along the body as u* (1 + slope (s/L - 1/2)), s the distance from the base. Each hinge's spring rests at
    u* h, h the piece of backbone it represents; unstressed silicone fibres along z are 1 + u_x* y - u_y* x times as long. Positive
    about_y bends the tip towards +x. SMA springs of equal length were put on the body while it was bent (`mounted` 1) or held
    straight (0).

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
    inactive_when_off = ("slope", "mounted")
    extended_parameters = ("slope",)
    needs = frozenset({"rest shape"})
    moves_with = "nothing: it is there at zero tension, and fades as load grows"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.TWO_LOADS, DataNeed.THREE_MARKERS})

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with both ways of mounting springs, where springs pull."""
        for mounted in (0.0, 1.0) if any(s.driven_by_current.any() for s in predicted) else (0.0,):
            yield FitStart({"about_x": 0.1, "about_y": 0.1, "mounted": mounted}, ("about_x", "about_y"))

    def route(self) -> Route:
        return Route(rest_bend_share=self["mounted"])

    def edit(self, body: Body) -> None:
        body.set_rest_curvature(self["about_x"], self["about_y"], self["slope"])
