"""A soft flat wall that the skin presses: F = stiffness share max(0, depth) at each point of the skin, along the wall's normal.

The shares of the points around one height add up to one, so that `stiffness` (N/m) is that of one ring pressed all round.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import jit


class Skin(NamedTuple):
    """Points at rest (m, 3) m, how they move with the free nodes (m, n_free), and their shares (m,)."""

    rest: np.ndarray
    weights: np.ndarray
    share: np.ndarray


@jit
def press(skin, u, wall, scale, r, K, tangent):
    """Take the wall's push (5,): normal, offset (m), stiffness (N/m), from the residual r (n,) or, with `tangent`, add its tangent
    to K (n, n); both over the body's stiffness, `scale`."""
    x = skin.rest + np.dot(skin.weights, u)
    for m in range(len(x)):
        depth = wall[3] - (x[m, 0] * wall[0] + x[m, 1] * wall[1] + x[m, 2] * wall[2])
        if depth <= 0.0:
            continue
        k = wall[4] * skin.share[m] / scale
        for a in range(skin.weights.shape[1]):
            w = skin.weights[m, a]
            if w == 0.0:
                continue
            for i in range(3):
                if not tangent:
                    r[3 * a + i] -= k * depth * w * wall[i]
                    continue
                for b in range(skin.weights.shape[1]):
                    for j in range(3):
                        K[3 * a + i, 3 * b + j] += k * w * wall[i] * skin.weights[m, b] * wall[j]
