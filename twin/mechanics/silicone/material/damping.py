"""Effective mass of a body within a step: M + h b K, its mass and its silicone's damping, taken at the step's end.

K is the neo-Hookean law's tangent at rest, cell by cell, in a frame that turns with the cell (the polar rotation of its middle); b
is Rayleigh's coefficient. Nodes are numbered by height and a cell reaches over three levels, so that the Cholesky factor stays
within that band.
"""

from typing import NamedTuple

import numpy as np

from twin.foundation.by_reference import by_reference
from twin.foundation.compiled import jit, jit_internal
from twin.mechanics.silicone.material.lattice import NODES_PER_CELL, Lattice, shape_functions
from twin.mechanics.silicone.material.law import Cells, Tangent, stiffness
from twin.mechanics.silicone.newton import BodyArrays

POLAR_STEPS = 12  # most Newton steps to a polar rotation; strains of tens of per cent need six
ROTATION_TOLERANCE = 1e-12  # change of its elements


@by_reference
class EffectiveMass(NamedTuple):
    """Effective mass of a body: its parts, and the upper triangle of the sum, or of its factor."""

    mass: np.ndarray  # (n,) kg
    damping: np.ndarray  # (c, 81, 81) kg, h b K of the cells
    gradient: np.ndarray  # (c, 27, 3) 1/m, of the shape functions in the cells' middles
    end: np.ndarray  # (n,) end of the unknowns that each is coupled to
    upper: np.ndarray  # (n, n) upper triangle of the effective mass, or of its factor


def effective_mass(grid: Lattice, body: BodyArrays, mass: np.ndarray, weight: float) -> EffectiveMass:
    """Return the effective mass of a body whose unknowns have `mass` (n,) kg; `weight` (s^2) is h b."""
    unknowns, n = body.cells.unknowns, mass.size
    end = np.zeros(n, int)
    for own in unknowns:
        end[own[own >= 0]] = own.max() + 1
    gradient = shape_functions(np.zeros(3))[1] / grid.half[:, None]
    return EffectiveMass(mass, weight * _tangents_at_rest(body), gradient, end, np.zeros((n, n)))


def _tangents_at_rest(body: BodyArrays) -> np.ndarray:
    """Return the cells' tangents at rest, (c, 81, 81) N/m."""
    cells, K = body.cells, []
    for e in range(len(cells.members)):
        one = slice(e, e + 1)
        alone = Cells(
            np.arange(NODES_PER_CELL)[None], np.arange(3 * NODES_PER_CELL)[None], cells.gradient[one], cells.drawn[one],
            cells.weight[one], cells.basis[one], cells.inverse[one], cells.shear[one], cells.bulk[one],
        )  # fmt: skip
        tangent = Tangent(
            np.empty((3 * NODES_PER_CELL, 3 * NODES_PER_CELL)), np.zeros((1, 4, 3 * NODES_PER_CELL)), np.zeros((1, 4))
        )
        stiffness(np.zeros((NODES_PER_CELL, 3)), alone, np.empty((0, 0, 6)), tangent)
        K.append(0.5 * (tangent.K + tangent.K.T))
    return np.stack(K)


@jit_internal
def polar_rotation(u, members, gradient, R):
    """Fill the rotation R (3, 3) nearest to the deformation of a cell's middle, under nodal displacements u (n_node, 3)."""
    F, C = np.zeros((3, 3)), np.empty((3, 3))
    for a in range(27):
        for i in range(3):
            for j in range(3):
                F[i, j] += u[members[a], i] * gradient[a, j]
    for i in range(3):
        F[i, i] += 1.0
    for _ in range(POLAR_STEPS):
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            for j in range(3):
                c, d = (j + 1) % 3, (j + 2) % 3
                C[i, j] = F[a, c] * F[b, d] - F[a, d] * F[b, c]
        J = F[0, 0] * C[0, 0] + F[0, 1] * C[0, 1] + F[0, 2] * C[0, 2]
        change = 0.0
        for i in range(3):
            for j in range(3):
                R[i, j] = 0.5 * (F[i, j] + C[i, j] / J)
                change = max(change, abs(R[i, j] - F[i, j]))
        F[:] = R
        if change < ROTATION_TOLERANCE:
            break


@jit_internal
def assemble_mass(effective, cells, u):
    """Assemble the effective mass at nodal displacements u (n_node, 3) into `effective.upper`."""
    A, R, half = effective.upper, np.empty((3, 3)), np.empty((3, 3))
    n = effective.mass.size
    for i in range(n):
        A[i, i : effective.end[i]] = 0.0
        A[i, i] = effective.mass[i]
    for e in range(cells.members.shape[0]):
        polar_rotation(u, cells.members[e], effective.gradient[e], R)
        own, K = cells.unknowns[e], effective.damping[e]
        for a in range(27):
            r = own[3 * a]
            if r < 0:
                continue
            for b in range(27):
                s = own[3 * b]
                if s < 0 or s < r:
                    continue
                for i in range(3):
                    for j in range(3):
                        half[i, j] = (
                            R[i, 0] * K[3 * a, 3 * b + j] + R[i, 1] * K[3 * a + 1, 3 * b + j] + R[i, 2] * K[3 * a + 2, 3 * b + j]
                        )
                for i in range(3):
                    for j in range(3):
                        A[r + i, s + j] += half[i, 0] * R[j, 0] + half[i, 1] * R[j, 1] + half[i, 2] * R[j, 2]


@jit_internal
def factorise_mass(effective):
    """Replace the effective mass by its Cholesky factor U, A = U' U, with the inverse of its diagonal. Three rows at a time."""
    U, n = effective.upper, effective.mass.size
    for p in range(0, n, 3):
        end, x, y, z = effective.end[p], U[p], U[p + 1], U[p + 2]
        for i in range(3):
            row = U[p + i]
            for k in range(i):
                above = U[p + k]
                share = above[p + i]
                for j in range(p + i, end):
                    row[j] -= share * above[j]
            row[p + i] = 1.0 / np.sqrt(row[p + i])
            for j in range(p + i + 1, end):
                row[j] *= row[p + i]
        for i in range(p + 3, end):
            row, a, b, c = U[i], x[i], y[i], z[i]
            for j in range(i, end):
                row[j] -= a * x[j] + b * y[j] + c * z[j]


@jit
def update_mass(effective, cells, u):
    """Assemble and factorise the effective mass at nodal displacements u (n_node, 3), into `effective.upper`."""
    assemble_mass(effective, cells, u)
    factorise_mass(effective)


@jit_internal
def solve_transposed(effective, columns):
    """Solve U' X = columns (n, m) in place."""
    U, m = effective.upper, columns.shape[1]
    for p in range(effective.mass.size):
        row, x = U[p], columns[p]
        for k in range(m):
            x[k] *= row[p]
        for i in range(p + 1, effective.end[p]):
            y, share = columns[i], row[i]
            for k in range(m):
                y[k] -= share * x[k]


@jit_internal
def solve_upper(effective, x):
    """Solve U y = x (n,) in place."""
    U = effective.upper
    for p in range(effective.mass.size - 1, -1, -1):
        row, sum = U[p], x[p]
        for j in range(p + 1, effective.end[p]):
            sum -= row[j] * x[j]
        x[p] = sum * row[p]
