"""Forces on disk centres that depend on where the disk is: a wall, a post, an attracting magnet.

A row of the table `fields` (M, 10) is [kind, first disk, point x y z, direction x y z, strength, size]:
  WALL_FIELD    frictionless plane through `point`, outward normal `direction`, a disk counts as a ball of radius `size`
  POST_FIELD    frictionless round post, axis through `point` along `direction`; `size` = post radius + disk radius
  MAGNET_FIELD  attraction to `point`, F = strength d / (|d|^2 + size^2)^2
Wall and post push with stiffness `strength` (N/m); the force grows quadratically over the first ROUNDED_PENETRATION of penetration.
"""

import numpy as np
from numba import njit

WALL_FIELD, POST_FIELD, MAGNET_FIELD = 1, 2, 3
ROUNDED_PENETRATION = 5e-5  # m


@njit(cache=True, error_model="numpy")
def _push(gap, stiffness):
    """Contact force and its slope d(force)/d(gap) for a gap (m, negative = penetration)."""
    d = -gap
    if d <= 0.0:
        return 0.0, 0.0
    if d < ROUNDED_PENETRATION:
        return stiffness * d * d / (2 * ROUNDED_PENETRATION), -stiffness * d / ROUNDED_PENETRATION
    return stiffness * (d - ROUNDED_PENETRATION / 2), -stiffness


@njit(cache=True, error_model="numpy")
def act(fields, disk_r, force, gradient):
    """Add field forces to `force` (N, 3) and their position gradients dF/dr to `gradient` (N, 3, 3); disks 1..N."""
    N = force.shape[0]
    d = np.empty(3)
    for m in range(fields.shape[0]):
        row = fields[m]
        point, axis, strength, size = row[2:5], row[5:8], row[8], row[9]
        for j in range(int(row[1]) - 1, N):
            for c in range(3):
                d[c] = disk_r[j + 1, c] - point[c]
            along = d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2]
            if row[0] == WALL_FIELD:
                f, slope = _push(along - size, strength)
                for c in range(3):
                    force[j, c] += f * axis[c]
                    for e in range(3):
                        gradient[j, c, e] += slope * axis[c] * axis[e]
            elif row[0] == POST_FIELD:
                for c in range(3):
                    d[c] -= along * axis[c]
                rho = np.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
                f, slope = _push(rho - size, strength)
                if f == 0.0:
                    continue
                for c in range(3):
                    force[j, c] += f * d[c] / rho
                    for e in range(3):
                        across = (1.0 if c == e else 0.0) - axis[c] * axis[e] - d[c] * d[e] / rho**2
                        gradient[j, c, e] += slope * d[c] * d[e] / rho**2 + f / rho * across
            else:
                q = d[0] ** 2 + d[1] ** 2 + d[2] ** 2 + size**2
                for c in range(3):
                    force[j, c] -= strength * d[c] / q**2
                    for e in range(3):
                        unit = 1.0 if c == e else 0.0
                        gradient[j, c, e] -= strength * (unit / q**2 - 4 * d[c] * d[e] / q**3)
