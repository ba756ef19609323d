"""Contact: the body touches an undeclared obstacle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from twin.effects.effect import Effect, Loads, Signals, Start
from twin.quantities import Parameter

AZIMUTHS = 8
TOUCHED = (0.95, 0.8)  # quantiles of how far the robot reaches, at which a wall may stand


class Contact(Effect):
    """A flat wall, parallel to the straight robot, at `distance` from it in direction `azimuth`. A disk whose centre is p
    beyond it is pushed back with F = stiffness * max(0, p), along the wall's normal and without friction.

    Source: linear penalty contact. An edge of the frame, a hand, the table.

    >>> wall = Contact(azimuth=0.0, distance=0.05, stiffness=200.0).surround(Loads(np.zeros(3))).wall
    >>> [float(v) for v in wall]
    [-1.0, -0.0, 0.0, -0.05, 200.0]
    """

    id = "contact"
    parameters = (
        Parameter("stiffness", 0.0, "N/m", 0.0, 2e4, "per disk; ours: from foam to steel", scale=5.0),
        Parameter("azimuth", 0.0, "rad", -10.0, 10.0, "direction of the wall from the robot", scale=0.1),
        Parameter("distance", 0.05, "m", 2e-3, 0.2, "from the straight robot's axis", scale=1e-3),
    )
    shape = ("azimuth", "distance")
    needs = frozenset({"surface"})
    moves_with = "position: only where the robot reaches beyond a line"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """Walls around the robot, each where the robot would touch it in some samples and not in the others."""
        reached = np.concatenate([s.markers[..., :2] for s in predicted])  # (n, n_marker, 2)
        for azimuth in 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS:
            furthest = (reached @ [np.cos(azimuth), np.sin(azimuth)]).max(axis=1)
            for quantile in TOUCHED:
                distance = float(np.quantile(furthest, quantile))
                if distance > 5e-3:
                    yield Start(
                        {"stiffness": 10.0, "azimuth": azimuth, "distance": distance},
                        tuple(p.name for p in cls.parameters),
                    )

    def surround(self, loads: Loads) -> Loads:
        c, s = np.cos(self["azimuth"]), np.sin(self["azimuth"])
        wall = np.array([-c, -s, 0.0, -self["distance"], self["stiffness"]])
        return replace(loads, wall=wall) if self["stiffness"] > 0.0 else loads
