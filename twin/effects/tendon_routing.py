"""Tendon routing: a tendon's holes, or its via points, are elsewhere than described."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from twin.body import Body, Signals
from twin.body.drives.counts import crossing_tendons, of_a_model
from twin.effects.base.effect import DataNeed, Effect, FitStart, each_then_all
from twin.foundation.parameters import Parameter


class TendonRouting(Effect):
    """All holes of tendon i are moved: azimuth' = azimuth + angle_i about the backbone, radius' = radius + radius_i.

    On an MJCF the via points of a tendon are moved: x' = x + out n, n the unit vector away from the axis of the nearest hinge that
    the tendon crosses, perpendicular to that axis and to the tendon where it crosses it, in the reference pose. The tendon's lever
    at that hinge grows by `out` (m). It is for tendons over sites; those that wrap around geoms have their levers from these. What
    else is at such a site (a marker, a payload) is not meant: give that a site of its own.

    Source: geometry. A disk glued on with a twist, a hole drilled at the wrong mark; a guide printed beside its place.

    >>> TendonRouting(angle_2=0.05)["angle_2"]
    0.05
    >>> from twin.body.drives.counts import Counts
    >>> TendonRouting(out_flexor=1e-3, n_tendon=Counts.of(1, ("hip",), ("flexor",), crossing=("flexor",)))["out_flexor"]
    0.001
    """

    id = "tendon_routing"
    per_tendon = (
        Parameter("angle", 0.0, "rad", -0.8, 0.8, "the holes' azimuth against the description", std=0.15, scale=0.03),
        Parameter("radius", 0.0, "m", -4e-3, 4e-3, "the holes' distance against the description", std=5e-4, scale=2e-4),
    )
    of_models = (Parameter("out", 0.0, "m", -4e-3, 4e-3, "a guide at the wrong mark: a millimetre", std=1e-3, scale=2e-4),)
    needs = frozenset({"holes"})
    moves_with = "the pull of one tendon"
    plot_against = "tension"
    hidden_without = frozenset({DataNeed.EVERY_TENDON, DataNeed.THREE_MARKERS})

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        """Return the parameters of holes, or of the tendons of an MJCF that cross a hinge."""
        if not of_a_model(n_tendon):
            return super().all_parameters(n_tendon)
        return tuple(replace(cls.of_models[0], name=f"out_{name}") for name in crossing_tendons(n_tendon))

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start as usual, or with each tendon of an MJCF alone and with all: to first order the sign does not matter."""
        if not of_a_model(n_tendon):
            yield from super().fit_starts(predicted, n_tendon)
            return
        yield from each_then_all([{p.name: p.step} for p in cls.all_parameters(n_tendon)])

    def edit(self, body: Body) -> None:
        if of_a_model(self.n_tendon):
            out = np.array(list(self.values.values()))
            if out.any():
                body.move_tendon_sites(out)
            return
        for i in range(1, self.n_tendon + 1):
            angle, further = self[f"angle_{i}"], self[f"radius_{i}"]
            if angle or further:
                body.move_tendon_holes(i - 1, angle, further)
