"""Tendon routing: a tendon's holes are at another angle or radius than described."""

from __future__ import annotations

from twin.body import Body
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter


class TendonRouting(Effect):
    """All holes of tendon i are moved: azimuth' = azimuth + angle_i about the backbone, radius' = radius + radius_i.

    Source: geometry. A disk glued on with a twist, a hole drilled at the wrong mark.

    >>> TendonRouting(angle_2=0.05)["angle_2"]
    0.05
    """

    id = "tendon_routing"
    per_tendon = (
        Parameter("angle", 0.0, "rad", -0.8, 0.8, "the holes' azimuth against the description", std=0.15, scale=0.03),
        Parameter("radius", 0.0, "m", -4e-3, 4e-3, "the holes' distance against the description", std=5e-4, scale=2e-4),
    )
    needs = frozenset({"holes"})
    moves_with = "the pull of one tendon"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.EVERY_TENDON, DataNeed.THREE_MARKERS})

    def edit(self, body: Body) -> None:
        for i in range(1, self.n_tendon + 1):
            angle, further = self[f"angle_{i}"], self[f"radius_{i}"]
            if angle or further:
                body.move_tendon_holes(i - 1, angle, further)
