"""Forces of tendons and contacts at a step's end, all at once: springs and dampers that only push, with Coulomb friction.

Row i moves at a speed w = w0 + h W f at the end of the step, under the forces f (n,) of all; W (1/kg) is the inverse effective mass
of the rows. Its spring and damper, at the step's end, give a force -D e, e the lag of w behind the speed without force:

    tendon:   f = stiffness max(0, stretch - h w) = max(0, -D e),   e = w - stretch / h,   D = stiffness h
    contact:  f = -((w - w_before) / h + b w + k (gap + h w)) / R,  along the normal, where above zero,   R = (1 - d) / d W_nn

with MuJoCo's stiffness k, damping b and impedance d of a contact, and its elliptic cone: across, where k is zero, f is at most mu
of the normal's, and R is `impratio` times smaller. W_nn, which MuJoCo estimates from the masses, is exact here. The forces minimise
a convex function; Newton's method with an exact line search finds them.

Source: MuJoCo's documentation, Computation, "Constraint model"; Todorov (2014), convex and analytically-invertible dynamics.
"""

from typing import NamedTuple

import numpy as np

from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit_internal

MOST_CONTACT_ITERATIONS, MOST_LINE_SEARCH_STEPS = 50, 30  # a handful usually suffice
FORCE_TOLERANCE = 1e-9  # residual, relative to 1 N plus the largest force
LINE_SEARCH_SLOPE = 0.1  # slope at the end of a line search, relative to its start
SLOWEST_SLIP = 1e-12  # m/s; slower slip has no direction


@by_reference
class RowLaw(NamedTuple):
    """Force law of the rows: D of each, the number of tendons' rows, the contacts' friction coefficients."""

    D: np.ndarray  # (n,) kg/s
    n_tendon_row: int
    friction: np.ndarray  # (c,)


@jit_internal
def row_forces(law, e, f, S):
    """Fill forces f (n,) N for the lags e (n,) m/s, and slopes -df/de, S (n, 3) kg/s.

    S has a row's own slope for a tendon, the three within its contact for a contact's rows.
    """
    for i in range(law.n_tendon_row):
        pulls = e[i] < 0.0
        f[i] = -law.D[i] * e[i] if pulls else 0.0
        S[i, 0] = law.D[i] if pulls else 0.0
    for c in range(law.friction.size):
        i = law.n_tendon_row + 3 * c
        cone_force(e[i : i + 3], law.D[i], law.D[i + 1], law.friction[c], f[i : i + 3], S[i : i + 3])


@jit_internal
def cone_force(e, normal, across, mu, f, S):
    """Fill force and slopes of one contact: open, sticking, or sliding at the edge of the cone."""
    slip = np.sqrt(e[1] ** 2 + e[2] ** 2)
    steep = mu**2 * normal / across
    f[:] = 0.0
    S[:] = 0.0
    if e[0] >= mu * slip:
        return
    if steep * e[0] + mu * slip <= 0.0:
        f[0], f[1], f[2] = -normal * e[0], -across * e[1], -across * e[2]
        S[0, 0], S[1, 1], S[2, 2] = normal, across, across
        return
    D, x, y = normal / (1.0 + steep), e[1] / max(slip, SLOWEST_SLIP), e[2] / max(slip, SLOWEST_SLIP)
    f[0] = D * (mu * slip - e[0])
    f[1], f[2] = -mu * f[0] * x, -mu * f[0] * y
    S[0, 0], S[0, 1], S[0, 2] = D, -D * mu * x, -D * mu * y
    S[1, 0], S[2, 0] = S[0, 1], S[0, 2]
    along, aside = D * mu**2, mu * f[0] / max(slip, SLOWEST_SLIP)
    S[1, 1], S[1, 2] = along * x * x + aside * y * y, (along - aside) * x * y
    S[2, 1], S[2, 2] = S[1, 2], along * y * y + aside * x * x


@jit_internal
def solve_row_forces(law, G, e0, f):
    """Solve for the forces f (n,), from a guess. Return False on failure.

    They give the lags e0 + G f, G = h W (n, n).
    """
    n = f.size
    out, S, e = np.empty(n), np.zeros((n, 3)), e0 + np.dot(G, f)
    for _ in range(MOST_CONTACT_ITERATIONS):
        row_forces(law, e, out, S)
        if np.abs(out - f).max() <= FORCE_TOLERANCE * (1.0 + np.abs(out).max()):
            f[:] = out
            return True
        left = out - f
        d = np.linalg.solve(newton_matrix(law, S, G), left)
        move = np.dot(G, d)
        steep, low, high, share = np.dot(move, left), 0.0, 0.0, 1.0
        for _ in range(MOST_LINE_SEARCH_STEPS):
            row_forces(law, e + share * move, out, S)
            here = np.dot(move, out - f - share * d)
            if abs(here) <= LINE_SEARCH_SLOPE * steep:
                break
            if here > 0.0:
                low = share
            else:
                high = share
            share = 0.5 * (low + high) if high > 0.0 else 2.0 * share
        f += share * d
        e += share * move
    return False


@jit_internal
def newton_matrix(law, S, G):
    """Return 1 + S G (n, n)."""
    n = S.shape[0]
    A = np.eye(n)
    for i in range(law.n_tendon_row):
        if S[i, 0] != 0.0:
            for j in range(n):
                A[i, j] += S[i, 0] * G[i, j]
    for c in range(law.friction.size):
        first = law.n_tendon_row + 3 * c
        for i in range(first, first + 3):
            for k in range(3):
                share = S[i, k]
                if share != 0.0:
                    for j in range(n):
                        A[i, j] += share * G[first + k, j]
    return A
