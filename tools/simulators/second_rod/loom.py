"""A cable loom that the tip drags along: parallel elastic-plastic sliders (Jenkins elements) and a weight.

Each slider's force is k (anchor - tip), no longer than its limit f; beyond, the anchor is dragged after (radial return). Several
with different limits give the rounded loops of a real cable, and nothing changes while the tip stands still.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

SLIDERS = 3


class Loom(NamedTuple):
    """Sliders at the tip; SI units."""

    stiffnesses: np.ndarray  # (SLIDERS,) N/m; 0 for none
    limits: np.ndarray  # (SLIDERS,) N
    mass: float  # carried by the tip, kg


NO_LOOM = Loom(np.zeros(SLIDERS), np.ones(SLIDERS), 0.0)


@njit(cache=True)
def drag(tip, loom, anchors, anchors_next, force):
    """Adds the sliders' force (3,) N; anchors (SLIDERS, 3) m at the last equilibrium, what they become into `anchors_next`."""
    for slider in range(SLIDERS):
        stiffness = loom.stiffnesses[slider]
        square = 0.0
        for axis in range(3):
            square += (stiffness * (tip[axis] - anchors[slider, axis])) ** 2
        held = min(1.0, loom.limits[slider] / np.sqrt(square)) if square > 0 else 1.0
        for axis in range(3):
            stretch = held * (tip[axis] - anchors[slider, axis])
            force[axis] -= stiffness * stretch
            anchors_next[slider, axis] = tip[axis] - stretch
