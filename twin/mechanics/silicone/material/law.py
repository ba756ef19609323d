"""Nearly incompressible neo-Hookean silicone on the lattice: nodal forces and their tangent.

    W = mu/2 (J^(-2/3) tr F'F - 3) + K/2 (theta - 1)^2,          mu = E / (2 (1 + nu)),  K = E / (3 (1 - 2 nu))

theta is J projected, in each cell, on {1, x, y, z}: with J itself such a coarse cell locks, with one constant a cell it bends far
too easily. The relaxed stress of creep, H (second Piola-Kirchhoff), is subtracted: P = dW/dF - F H. F is taken from the stress-free
state, in which fibres along z may be longer or shorter than drawn, by g: F = (1 + du/dX) diag(1, 1, 1/g).

Source: Simo, Taylor and Pister (1985), variational methods for the volume constraint in finite deformation elasto-plasticity.
"""

from typing import NamedTuple

import numpy as np

from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit, jit_internal

LEAST_VOLUME_RATIO = 0.02  # of J; below it a cell counts as inverted
NEXT, AFTER = (1, 2, 0), (2, 0, 1)  # cyclic indices
SYMMETRIC_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # elements of a symmetric tensor, as stored in H


@by_reference
class Cells(NamedTuple):
    """Arrays of the lattice and the silicone, for forces."""

    members: np.ndarray  # (c, 27) nodes of each cell
    unknowns: np.ndarray  # (c, 81)
    gradient: np.ndarray  # (c, 27, 3 q) 1/m, derivatives by stress-free places
    drawn: np.ndarray  # (c, q) 1/g
    weight: np.ndarray  # (c, q) m^3
    basis: np.ndarray  # (c, q, 4) local coordinates after a one
    inverse: np.ndarray  # (c, 4, 4) of the integrals of their products
    shear: np.ndarray  # (c, q) Pa, mu
    bulk: np.ndarray  # (c,) Pa, K


@by_reference
class Tangent(NamedTuple):
    """Tangent K (n, n) N/m; response of pressures to displacements (c, 4, 81) Pa/m, and the pressures used (c, 4) Pa."""

    K: np.ndarray
    pressure_response: np.ndarray
    pressure: np.ndarray


@jit_internal
def deformation(u, members, gradient, drawn, F, C, J):
    """Fill F and its cofactors (q, 9), and J (q,), of one cell under nodal displacements u (n_node, 3). Return the least J."""
    nq = J.size
    moved = np.empty((3, 27))
    for a in range(27):
        for i in range(3):
            moved[i, a] = u[members[a], i]
    G = np.dot(moved, gradient)  # (3, 3 q)
    least = 1e9
    for q in range(nq):
        x, c = F[q], C[q]
        for i in range(3):
            for j in range(3):
                x[3 * i + j] = G[i, 3 * q + j]
            x[4 * i] += drawn[q] if i == 2 else 1.0
        for i in range(3):
            for j in range(3):
                a, b, m, n = 3 * NEXT[i], 3 * AFTER[i], NEXT[j], AFTER[j]
                c[3 * i + j] = x[a + m] * x[b + n] - x[a + n] * x[b + m]
        J[q] = x[0] * c[0] + x[1] * c[1] + x[2] * c[2]
        least = min(least, J[q])
    return least


@jit_internal
def pressures(cells, e, J, p):
    """Fill coefficients p (4,) Pa of the pressure K (theta - 1) in the cell's basis."""
    moment = np.zeros(4)
    for q in range(J.size):
        for k in range(4):
            moment[k] += cells.weight[e, q] * (J[q] - 1.0) * cells.basis[e, q, k]
    for k in range(4):
        p[k] = 0.0
        for m in range(4):
            p[k] += cells.bulk[e] * cells.inverse[e, k, m] * moment[m]


@jit
def forces(u, cells, H, f, p):
    """Fill internal forces f (n,) N and pressures p (c, 4) Pa. Return the least J; below LEAST_VOLUME_RATIO they are meaningless.

    Displacements u (n_node, 3) m, relaxed stress H (c, q, 6) Pa, or (0, 0, 6) for none.
    """
    ne, nq = cells.weight.shape
    F, C, J, P = np.empty((nq, 9)), np.empty((nq, 9)), np.empty(nq), np.empty((3, 3 * nq))
    f[:] = 0.0
    least = 1e9
    for e in range(ne):
        least = min(least, deformation(u, cells.members[e], cells.gradient[e], cells.drawn[e], F, C, J))
        if least < LEAST_VOLUME_RATIO:
            return least
        pressures(cells, e, J, p[e])
        for q in range(nq):
            x, c, w = F[q], C[q], cells.weight[e, q]
            m0 = cells.shear[e, q] * J[q] ** (-2.0 / 3.0)
            third = m0 * (x * x).sum() / (3.0 * J[q])
            pressure = 0.0
            for k in range(4):
                pressure += p[e, k] * cells.basis[e, q, k]
            for i in range(3):
                for j in range(3):
                    P[i, 3 * q + j] = w * (m0 * x[3 * i + j] + (pressure - third) * c[3 * i + j])
            if H.size > 0:
                subtract_relaxed_stress(x, H[e, q], w, P, q)
        fe = np.dot(P, cells.gradient[e].T)  # (3, 27)
        for a in range(81):
            if cells.unknowns[e, a] >= 0:
                f[cells.unknowns[e, a]] += fe[a % 3, a // 3]
    return least


@jit_internal
def subtract_relaxed_stress(x, h, w, P, q):
    """Subtract w F H from P of point q."""
    for i in range(3):
        a, b, c = x[3 * i], x[3 * i + 1], x[3 * i + 2]
        P[i, 3 * q] -= w * (a * h[0] + b * h[1] + c * h[2])
        P[i, 3 * q + 1] -= w * (a * h[1] + b * h[3] + c * h[4])
        P[i, 3 * q + 2] -= w * (a * h[2] + b * h[4] + c * h[5])


@jit_internal
def moduli(x, c, J, shear, pressure, A):
    """Fill dP/dF (9, 9) Pa of one point at a constant pressure."""
    m0 = shear * J ** (-2.0 / 3.0)
    third = (x * x).sum() / 3.0 * m0
    both, turned, mixed = (2.0 / 3.0 * third + pressure * J) / J**2, (third - pressure * J) / J**2, -2.0 / 3.0 * m0 / J
    for r in range(9):
        i, j = r // 3, r % 3
        for s in range(9):
            k, m = s // 3, s % 3
            A[r, s] = mixed * (x[r] * c[s] + c[r] * x[s]) + both * c[r] * c[s] + turned * c[3 * i + m] * c[3 * k + j]
        A[r, r] += m0


@jit
def stiffness(u, cells, H, tangent):
    """Fill the tangent of `forces` at u, with its own `pressure` in the geometric part. Return the least J.

    With the pressure predicted by the last linear step Newton converges in fewer steps than with that of the present, still wrong,
    volumes.
    """
    ne, nq = cells.weight.shape
    F, C, J, A = np.empty((nq, 9)), np.empty((nq, 9)), np.empty(nq), np.empty((9, 9))
    block = np.empty((6, 3 * nq, 27))
    K = tangent.K
    K[:] = 0.0
    least = 1e9
    for e in range(ne):
        least = min(least, deformation(u, cells.members[e], cells.gradient[e], cells.drawn[e], F, C, J))
        if least < LEAST_VOLUME_RATIO:
            return least
        D = cells.gradient[e]
        g = np.zeros((81, 4))
        block[:] = 0.0
        for q in range(nq):
            c, w, pressure = C[q], cells.weight[e, q], 0.0
            for k in range(4):
                pressure += tangent.pressure[e, k] * cells.basis[e, q, k]
            moduli(F[q], c, J[q], cells.shear[e, q], pressure, A)
            if H.size > 0:
                subtract_relaxed_modulus(H[e, q], A)
            for a in range(27):
                d = (D[a, 3 * q], D[a, 3 * q + 1], D[a, 3 * q + 2])
                fill_blocks(A, d, w, q, a, block)
                for i in range(3):
                    gi = w * (c[3 * i] * d[0] + c[3 * i + 1] * d[1] + c[3 * i + 2] * d[2])
                    for k in range(4):
                        g[3 * a + i, k] += gi * cells.basis[e, q, k]
        pressure_response(cells, e, g, tangent.pressure_response[e])
        volume = np.dot(g, tangent.pressure_response[e])  # (81, 81)
        assemble_cell(D, block, volume, cells.unknowns[e], K)
    return least


@jit_internal
def fill_blocks(A, d, w, q, a, block):
    """Fill w A d of one point and node into the rows of the six blocks of a symmetric tangent."""
    for s in range(6):
        i, k = SYMMETRIC_PAIRS[s]
        for j in range(3):
            block[s, 3 * q + j, a] = w * (
                A[3 * i + j, 3 * k] * d[0] + A[3 * i + j, 3 * k + 1] * d[1] + A[3 * i + j, 3 * k + 2] * d[2]
            )


@jit_internal
def subtract_relaxed_modulus(h, A):
    """Subtract the relaxed stress H from A: d(F H)_ij / dF_im = H_mj."""
    for s in range(6):
        j, m = SYMMETRIC_PAIRS[s]
        for i in range(3):
            A[3 * i + j, 3 * i + m] -= h[s]
            if j != m:
                A[3 * i + m, 3 * i + j] -= h[s]


@jit_internal
def pressure_response(cells, e, g, out):
    """Fill the response (4, 81) of the cell's pressures to its displacements."""
    for k in range(4):
        for a in range(81):
            out[k, a] = 0.0
            for m in range(4):
                out[k, a] += cells.bulk[e] * cells.inverse[e, k, m] * g[a, m]


@jit_internal
def assemble_cell(D, block, volume, unknowns, K):
    """Add the cell's tangent to the whole one."""
    for s in range(6):
        i, k = SYMMETRIC_PAIRS[s]
        part = np.dot(D, block[s])  # (27, 27)
        for a in range(27):
            r = unknowns[3 * a + i]
            if r < 0:
                continue
            for b in range(27):
                t = unknowns[3 * b + k]
                if t < 0:
                    continue
                K[r, t] += part[a, b]
                if i != k:
                    K[t, r] += part[a, b]
    for a in range(81):
        if unknowns[a] >= 0:
            for b in range(81):
                if unknowns[b] >= 0:
                    K[unknowns[a], unknowns[b]] += volume[a, b]
