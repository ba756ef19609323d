"""Forces of tendons and contacts at a step's end, all at once: springs and dampers that only push, with Coulomb's friction.

Row i moves at a speed w = w0 + h W f at the end of the step, under the forces f (n,) of all; W (1/kg) is the inverse of the mass
that the rows feel. Its spring and damper, at the step's end, give a force -D e, e the lag of w behind the speed without force:

    tendon:   f = stiffness max(0, stretch - h w) = max(0, -D e),   e = w - stretch / h,   D = stiffness h
    contact:  f = -((w - w_before) / h + b w + k (gap + h w)) / R,  along the normal, where above zero,   R = (1 - d) / d W_nn

with MuJoCo's stiffness k, damping b and impedance d of a contact, and its elliptic cone: across, where k is zero, f is at most mu
of the normal's, and R is `impratio` times smaller. W_nn, which MuJoCo estimates from the masses, is exact here. The forces are the
minimum of a convex function, found by Newton's method with an exact line search.

Source: MuJoCo's documentation, Computation, "Constraint model"; Todorov (2014), convex and analytically-invertible dynamics.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import inner

TURNS, SEARCHED = 50, 30  # at most; a handful do
CLOSE = 1e-9  # of the forces, and of 1 N: what is left of them when they count as found
FLAT = 0.1  # of the slope at its start: what a line search leaves
SLOWEST = 1e-12  # m/s: what slides slower has no direction


class Law(NamedTuple):
    """Of each row its D (n,) kg/s; how many rows are tendons'; of each contact, three rows, its coefficient of friction."""

    D: np.ndarray
    tendons: int
    friction: np.ndarray


@inner
def respond(law, e, f, S):
    """Forces f (n,) N of the lags e (n,) m/s, and their slopes -df/de, S (n, 3) kg/s: a row's own for a tendon, the three within
    its contact for a contact's rows."""
    for i in range(law.tendons):
        pulls = e[i] < 0.0
        f[i] = -law.D[i] * e[i] if pulls else 0.0
        S[i, 0] = law.D[i] if pulls else 0.0
    for c in range(law.friction.size):
        i = law.tendons + 3 * c
        cone(e[i : i + 3], law.D[i], law.D[i + 1], law.friction[c], f[i : i + 3], S[i : i + 3])


@inner
def cone(e, normal, across, mu, f, S):
    """One contact: it is open, sticks, or slides at the edge of the cone."""
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
    D, x, y = normal / (1.0 + steep), e[1] / max(slip, SLOWEST), e[2] / max(slip, SLOWEST)
    f[0] = D * (mu * slip - e[0])
    f[1], f[2] = -mu * f[0] * x, -mu * f[0] * y
    S[0, 0], S[0, 1], S[0, 2] = D, -D * mu * x, -D * mu * y
    S[1, 0], S[2, 0] = S[0, 1], S[0, 2]
    along, aside = D * mu**2, mu * f[0] / max(slip, SLOWEST)
    S[1, 1], S[1, 2] = along * x * x + aside * y * y, (along - aside) * x * y
    S[2, 1], S[2, 2] = S[1, 2], along * y * y + aside * x * x


@inner
def balance(law, G, e0, f):
    """Forces f (n,), from a guess to those that give the lags e0 + G f, G = h W (n, n). False where they are not found."""
    n = f.size
    out, S, e = np.empty(n), np.zeros((n, 3)), e0 + np.dot(G, f)
    for _ in range(TURNS):
        respond(law, e, out, S)
        if np.abs(out - f).max() <= CLOSE * (1.0 + np.abs(out).max()):
            f[:] = out
            return True
        left = out - f
        d = np.linalg.solve(slopes(law, S, G), left)
        move = np.dot(G, d)
        steep, low, high, share = np.dot(move, left), 0.0, 0.0, 1.0
        for _ in range(SEARCHED):
            respond(law, e + share * move, out, S)
            here = np.dot(move, out - f - share * d)
            if abs(here) <= FLAT * steep:
                break
            if here > 0.0:
                low = share
            else:
                high = share
            share = 0.5 * (low + high) if high > 0.0 else 2.0 * share
        f += share * d
        e += share * move
    return False


@inner
def slopes(law, S, G):
    """1 + S G (n, n)."""
    n = S.shape[0]
    A = np.eye(n)
    for i in range(law.tendons):
        if S[i, 0] != 0.0:
            for j in range(n):
                A[i, j] += S[i, 0] * G[i, j]
    for c in range(law.friction.size):
        first = law.tendons + 3 * c
        for i in range(first, first + 3):
            for k in range(3):
                share = S[i, k]
                if share != 0.0:
                    for j in range(n):
                        A[i, j] += share * G[first + k, j]
    return A
