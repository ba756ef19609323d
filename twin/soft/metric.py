"""What resists a body's change of speed within a step: M + h b K, its mass and its silicone's damping, taken at the step's end.

K is the neo-Hookean law's tangent at rest, cell by cell, in a frame that turns with the cell (the polar rotation of its middle);
b is Rayleigh's coefficient. Nodes count by height, a cell reaches over three levels: the Cholesky factor stays within that band.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from twin.compiled import inner, jit
from twin.soft.lattice import NODES, Lattice, shape_functions
from twin.soft.newton import Parts
from twin.soft.silicone import Cells, Tangent, stiffness

POLAR = 12  # Newton steps to a polar rotation; strains of tens of per cent take six
TURNED = 1e-12  # change of a rotation that counts as none


class Metric(NamedTuple):
    """mass (n,) kg; h b K of the cells (c, 81, 81) kg; derivatives (c, 27, 3) 1/m of the shape functions in the cells' middles;
    where the unknowns (n,) end that each is coupled to; and the upper triangle (n, n) of the metric, or of its factor."""

    mass: np.ndarray
    damping: np.ndarray
    slope: np.ndarray
    end: np.ndarray
    upper: np.ndarray


def metric(grid: Lattice, parts: Parts, mass: np.ndarray, weight: float) -> Metric:
    """Of a body whose unknowns have `mass` (n,) kg; `weight` (s^2) is h b."""
    unknowns, n = parts.cells.unknowns, mass.size
    end = np.zeros(n, int)
    for own in unknowns:
        end[own[own >= 0]] = own.max() + 1
    slope = shape_functions(np.zeros(3))[1] / grid.half[:, None]
    return Metric(mass, weight * _at_rest(parts), slope, end, np.zeros((n, n)))


def _at_rest(parts: Parts) -> np.ndarray:
    """(c, 81, 81) N/m: tangents of the cells at rest."""
    cells, K = parts.cells, []
    for e in range(len(cells.members)):
        one = slice(e, e + 1)
        alone = Cells(
            np.arange(NODES)[None], np.arange(3 * NODES)[None], cells.gradient[one], cells.drawn[one], cells.weight[one],
            cells.basis[one], cells.inverse[one], cells.shear[one], cells.bulk[one],
        )  # fmt: skip
        tangent = Tangent(np.empty((3 * NODES, 3 * NODES)), np.zeros((1, 4, 3 * NODES)), np.zeros((1, 4)))
        stiffness(np.zeros((NODES, 3)), alone, np.empty((0, 0, 6)), tangent)
        K.append(0.5 * (tangent.K + tangent.K.T))
    return np.stack(K)


@inner
def rotation(u, members, slope, R):
    """The rotation R (3, 3) next to the deformation of a cell's middle, under nodal displacements u (n_node, 3)."""
    F, C = np.zeros((3, 3)), np.empty((3, 3))
    for a in range(27):
        for i in range(3):
            for j in range(3):
                F[i, j] += u[members[a], i] * slope[a, j]
    for i in range(3):
        F[i, i] += 1.0
    for _ in range(POLAR):
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
        if change < TURNED:
            break


@inner
def assemble(at, cells, u):
    """The metric at nodal displacements u (n_node, 3), into `at.upper`."""
    A, R, half = at.upper, np.empty((3, 3)), np.empty((3, 3))
    n = at.mass.size
    for i in range(n):
        A[i, i : at.end[i]] = 0.0
        A[i, i] = at.mass[i]
    for e in range(cells.members.shape[0]):
        rotation(u, cells.members[e], at.slope[e], R)
        own, K = cells.unknowns[e], at.damping[e]
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


@inner
def factor(at):
    """The metric's Cholesky factor U, A = U' U, in its place, but for the diagonal: there its inverse. Three rows at a time."""
    U, n = at.upper, at.mass.size
    for p in range(0, n, 3):
        end, x, y, z = at.end[p], U[p], U[p + 1], U[p + 2]
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
def weighed(at, cells, u):
    """The metric's factor at nodal displacements u (n_node, 3), into `at.upper`."""
    assemble(at, cells, u)
    factor(at)


@inner
def halfway(at, columns):
    """Solve U' X = columns (n, m) in place."""
    U, m = at.upper, columns.shape[1]
    for p in range(at.mass.size):
        row, x = U[p], columns[p]
        for k in range(m):
            x[k] *= row[p]
        for i in range(p + 1, at.end[p]):
            y, share = columns[i], row[i]
            for k in range(m):
                y[k] -= share * x[k]


@inner
def back(at, x):
    """Solve U y = x (n,) in place."""
    U = at.upper
    for p in range(at.mass.size - 1, -1, -1):
        row, sum = U[p], x[p]
        for j in range(p + 1, at.end[p]):
            sum -= row[j] * x[j]
        x[p] = sum * row[p]
