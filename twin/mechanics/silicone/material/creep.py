"""Creep of silicone: relaxed stress at each quadrature point.

With S the isochoric second Piola-Kirchhoff stress, C_k the part that element k of creep has taken of it and S_e = S - sum C_k,

    time_k C_k' = amplitude_k S_e - C_k,

which for small strains is `backbone_creep`: under a constant load the strain grows by `amplitude` of the instantaneous one. C_k is
kept in the material frame, so that it turns with the body.

Source: Simo (1987), on a fully three-dimensional finite-strain viscoelastic damage model.
"""

import numpy as np

from twin.effects.backbone_creep import delayed_strain
from twin.foundation.compiled import jit
from twin.mechanics.silicone.material.law import SYMMETRIC_PAIRS, deformation


@jit
def advance_relaxed_stress(u, cells, amplitude, time, dt, relaxed):
    """Advance `relaxed` (k, c, q, 6) Pa by dt (s) at nodal displacements u (n_node, 3)."""
    ne, nq = cells.weight.shape
    F, C, J = np.empty((nq, 9)), np.empty((nq, 9)), np.empty(nq)
    for e in range(ne):
        deformation(u, cells.members[e], cells.gradient[e], cells.drawn[e], F, C, J)
        for q in range(nq):
            x, c = F[q], C[q]
            m0 = cells.shear[e, q] * J[q] ** (-2.0 / 3.0)
            third = (x * x).sum() / 3.0 * m0 / J[q] ** 2
            for s in range(6):
                i, j = SYMMETRIC_PAIRS[s]
                inverse = c[i] * c[j] + c[3 + i] * c[3 + j] + c[6 + i] * c[6 + j]  # of C = F'F, times J^2
                left = (m0 if i == j else 0.0) - third * inverse
                for k in range(amplitude.size):
                    left -= relaxed[k, e, q, s]
                for k in range(amplitude.size):
                    relaxed[k, e, q, s] = delayed_strain(relaxed[k, e, q, s], left, amplitude[k], time[k], dt)
