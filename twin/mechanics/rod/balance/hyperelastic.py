"""A soft body that stretches as it bends: an incompressible neo-Hookean rod, to second order in bending and twist.

A fibre stretched by lambda holds W = E/6 (lambda^2 + 2/lambda - 3) per volume. Across a section that is stretched by lambda,
shrinks sideways by lambda^(-1/2) and bends by kappa per unit of rest length, a fibre at x has lambda + kappa x lambda^(-1/2).
Integrated over the section, per unit of rest length,

    w = EA/6 (lambda^2 + 2/lambda - 3) + EI/2 b(lambda) kappa^2 + GJ/2 t(lambda) tau^2,
    b = (1 + 2/lambda^3) / (3 lambda),   t = 1/lambda.

Compressed to 0.8 of its length silicone bends 2.0 times as hard as at rest. In the limit lambda -> 1 this is the linear rod with
EA, EI and GJ. Source: neo-Hookean law with G = E/3 (Treloar 1943); b and t are its expansion for a slender rod, as in the papers on
stretched and bent elastomer beams (e.g. Lestringant and Audoly 2020, J. Elasticity 140).

The tendons' channels move with the section that shrinks or spreads. A tendon under T whose path bending shortens by A phi at rest
therefore has the additional energy

    E = T (lambda^(-1/2) - 1) A phi

to first order in bending, as A is. A body may be neo-Hookean in part: `stiffening` 0 is the rod that stretches and bends by Hooke's
law with a constant section, 1 the one above.
"""

from typing import NamedTuple

import numpy as np

from twin.foundation.compiled import jit_internal

LEAST_STRETCH_RATIO = 0.1  # of the rest length; a step to a shorter one is refused
REFUSED_RESIDUAL = 1e300  # of such a step


@jit_internal
def axial_force(stretch, share):
    """Return axial force over EA and its slope.

    They are (lambda - lambda^-2) / 3 for the neo-Hookean `share`, lambda - 1 for the Hookean rest.
    """
    inverse = 1.0 / stretch
    force, slope = (stretch - inverse * inverse) / 3.0, (1.0 + 2.0 * inverse * inverse * inverse) / 3.0
    return share * force + (1.0 - share) * (stretch - 1.0), share * slope + 1.0 - share


@jit_internal
def bending_factor(stretch, share):
    """Return 1 + share (b - 1), its first and second derivative."""
    a = 1.0 / stretch
    a2 = a * a
    b = (a + 2.0 * a2 * a2) / 3.0
    return 1.0 + share * (b - 1.0), -share * (a2 + 8.0 * a2 * a2 * a) / 3.0, share * (2.0 * a2 * a + 40.0 * a2 * a2 * a2) / 3.0


@jit_internal
def twisting_factor(stretch, share):
    """Return 1 + share (t - 1), its first and second derivative."""
    a = 1.0 / stretch
    return 1.0 + share * (a - 1.0), -share * a * a, 2.0 * share * a * a * a


class BentChain(NamedTuple):
    """The chain as it is bent: angles and rest shape, rotation vectors phi and dphi/dq, stiffness K, moment m."""

    q: np.ndarray  # (nv,)
    rest: np.ndarray  # (nv,)
    phi: np.ndarray  # (nv,)
    D: np.ndarray  # (n_set, 3, 3)
    K: np.ndarray  # (nv,)
    m: np.ndarray  # (nv,)


@jit_internal
def channel_spread(stretch, share):
    """Return share (lambda^(-1/2) - 1), by which channels move away from the axis, its first and second derivative."""
    a = 1.0 / stretch
    root = np.sqrt(a)
    return share * (root - 1.0), -0.5 * share * a * root, 0.75 * share * a * a * root


@jit_internal
def add_stretch_forces(j, chain, tension, bent, bowing, r, J):
    """Add the effects of stretch in set j: the slide's own force, and that of bending, twist and tendon channels along it.

    On entry bent.K and bent.m are stiffness and moment of the linear rod, on return those at the set's stretch. Writes r and,
    unless J is empty, J of the slide's rows and columns, and adds the spreading of the channels to bowing (n_tendon,) m.
    """
    q, rest, phi, D, K, m = bent.q, bent.rest, bent.phi, bent.D, bent.K, bent.m
    i, first = chain.slide[j], chain.first_bend[j]
    h = chain.unit[i]
    stretch = 1.0 + (q[i] - rest[i]) / h
    if stretch < LEAST_STRETCH_RATIO:
        r[i] = REFUSED_RESIDUAL
        return
    force, slope = axial_force(stretch, chain.stiffening)
    r[i], slope = chain.stiffness[i] * h * force, chain.stiffness[i] * slope
    g, g1, g2 = channel_spread(stretch, chain.stiffening)
    for c in range(3):
        k = first + c
        out = phi[k] - rest[k]
        own = K[k]
        f, f1, f2 = twisting_factor(stretch, chain.stiffening) if chain.is_twist[k] else bending_factor(stretch, chain.stiffening)
        K[k] = own * f
        m[k] = own * f * out
        pull = 0.0
        for t in range(tension.size):
            pull += tension[t] * chain.channel_lever[t, k]
            bowing[t] += g * chain.channel_lever[t, k] * phi[k]
        m[k] += g * pull
        r[i] += (0.5 * own * f1 * out * out + g1 * pull * phi[k]) / h
        slope += (0.5 * own * f2 * out * out + g2 * pull * phi[k]) / (h * h)
        if J.size:
            for b in range(3):
                cross = (own * f1 * out + g1 * pull) * D[j, c, b] / h
                J[i, first + b] += cross
                J[first + b, i] += cross
    if J.size:
        J[i, i] += slope
