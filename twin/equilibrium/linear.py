"""Dense factorisation without pivoting, four pivots at a time: on a symmetric matrix a pivot <= 0 means "not a minimum"."""

from __future__ import annotations

from twin.compiled import inner

BLOCK = 4  # pivots eliminated together, so that each row of the rest is read once for four of them


@inner
def factorise(A):
    """A -> L U in place (unit lower L). Returns False at the first pivot that is not positive."""
    n = A.shape[0]
    for k in range(0, n, BLOCK):
        end = min(k + BLOCK, n)
        for p in range(k, end):
            if not A[p, p] > 0.0:
                return False
            inverse = 1.0 / A[p, p]
            for i in range(p + 1, n):
                A[i, p] *= inverse
                last = end if i >= end else n
                for j in range(p + 1, last):
                    A[i, j] -= A[i, p] * A[p, j]
        if end - k == BLOCK:
            for i in range(end, n):
                a, b, c, d = A[i, k], A[i, k + 1], A[i, k + 2], A[i, k + 3]
                for j in range(end, n):
                    A[i, j] -= a * A[k, j] + b * A[k + 1, j] + c * A[k + 2, j] + d * A[k + 3, j]
    return True


@inner
def substitute(LU, b):
    """b -> (L U)^-1 b in place."""
    n = b.size
    for i in range(n):
        for j in range(i):
            b[i] -= LU[i, j] * b[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= LU[i, j] * b[j]
        b[i] /= LU[i, i]
