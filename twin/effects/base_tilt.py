"""Base tilt: gravity points in another direction than declared."""

from __future__ import annotations

from dataclasses import replace

from scipy.spatial.transform import Rotation

from twin.body import Loads
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter

ROTATION_NAMES = ("about_x", "about_y", "about_z")


class BaseTilt(Effect):
    """Gravity in the base frame turned by the rotation vector (about_x, about_y, about_z): g' = R g.

    A rotation about gravity itself has no effect.

    Source: rigid-body kinematics. A robot clamped by eye is a few degrees off.

    >>> import numpy as np
    >>> tilt = BaseTilt(about_y=0.1)
    >>> [round(float(v), 3) for v in tilt.surround(Loads(gravity=np.array([0.0, 0.0, 9.81]))).gravity]
    [0.979, 0.0, 9.761]
    """

    id = "base_tilt"
    parameters = tuple(
        Parameter(a, 0.0, "rad", -0.6, 0.6, "clamped by eye: a few degrees", std=0.1, scale=0.02) for a in ROTATION_NAMES
    )
    guesses = ({"about_x": 0.02, "about_y": 0.02, "about_z": 0.02},)
    needs = frozenset({"weight"})
    moves_with = "payload"
    plot_against = "payload"
    hidden_without = frozenset({DataNeed.TWO_LOADS, DataNeed.THREE_MARKERS})

    def surround(self, loads: Loads) -> Loads:
        turn = Rotation.from_rotvec([self[a] for a in ROTATION_NAMES]).as_matrix()
        return replace(loads, gravity=turn @ loads.gravity)
