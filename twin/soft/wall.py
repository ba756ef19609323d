"""A soft wall or post that the skin presses: F = stiffness share max(0, depth) at each point of the skin, along its normal there.

The shares of the points around one height add up to one, so that `stiffness` (N/m) is that of one ring pressed all round.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import jit
from twin.effects.contact import touch


class Skin(NamedTuple):
    """Points at rest (m, 3) m, how they move with the free nodes (m, n_free), and their shares (m,)."""

    rest: np.ndarray
    weights: np.ndarray
    share: np.ndarray


@jit
def press(skin, u, wall, scale, r, K, tangent):
    """Take the push of a wall (10,), as in `Loads`, from the residual r (n,) or, with `tangent`, add its tangent to K (n, n); both
    over the body's stiffness, `scale`."""
    x = skin.rest + np.dot(skin.weights, u)
    for m in range(len(x)):
        gap, normal, across, bend = touch(wall, x[m])
        depth = -gap
        if depth <= 0.0:
            continue
        k = wall[4] * skin.share[m] / scale
        for a in range(skin.weights.shape[1]):
            w = skin.weights[m, a]
            if w == 0.0:
                continue
            for i in range(3):
                if not tangent:
                    r[3 * a + i] -= k * depth * w * normal[i]
                    continue
                for b in range(skin.weights.shape[1]):
                    for j in range(3):
                        stiff = normal[i] * normal[j] - depth * bend * across[i] * across[j]
                        K[3 * a + i, 3 * b + j] += k * w * skin.weights[m, b] * stiff
