"""Dense factorisation without pivoting, four pivots at a time. On a symmetric matrix a pivot <= 0 means "not a minimum".

The transpose is factorised, A' = L U. Solving A x = b, U' L' x = b, then goes along rows of the stored factors.
"""

from twin.foundation.compiled import jit_internal

PIVOT_BLOCK = 4  # pivots eliminated together, so that each remaining row is read once for four of them


@jit_internal
def factorise(A):
    """Factorise A' -> L U in place (unit lower L). Return False at the first pivot that is not positive."""
    n = A.shape[0]
    for i in range(n):
        for j in range(i):
            A[i, j], A[j, i] = A[j, i], A[i, j]
    for k in range(0, n, PIVOT_BLOCK):
        end = min(k + PIVOT_BLOCK, n)
        for p in range(k, end):
            if not A[p, p] > 0.0:
                return False
            inverse = 1.0 / A[p, p]
            for i in range(p + 1, n):
                A[i, p] *= inverse
                last = end if i >= end else n
                for j in range(p + 1, last):
                    A[i, j] -= A[i, p] * A[p, j]
        if end - k == PIVOT_BLOCK:
            for i in range(end, n):
                a, b, c, d = A[i, k], A[i, k + 1], A[i, k + 2], A[i, k + 3]
                for j in range(end, n):
                    A[i, j] -= a * A[k, j] + b * A[k + 1, j] + c * A[k + 2, j] + d * A[k + 3, j]
    return True


@jit_internal
def substitute(LU, b):
    """Replace b by A^-1 b, LU the factors of A': four unknowns at a time, then their share in all remaining rows."""
    n = b.size
    whole = n - n % PIVOT_BLOCK
    for k in range(0, whole, PIVOT_BLOCK):
        w = b[k] / LU[k, k]
        x = (b[k + 1] - LU[k, k + 1] * w) / LU[k + 1, k + 1]
        y = (b[k + 2] - LU[k, k + 2] * w - LU[k + 1, k + 2] * x) / LU[k + 2, k + 2]
        z = (b[k + 3] - LU[k, k + 3] * w - LU[k + 1, k + 3] * x - LU[k + 2, k + 3] * y) / LU[k + 3, k + 3]
        b[k], b[k + 1], b[k + 2], b[k + 3] = w, x, y, z
        for i in range(k + PIVOT_BLOCK, n):
            b[i] -= LU[k, i] * w + LU[k + 1, i] * x + LU[k + 2, i] * y + LU[k + 3, i] * z
    for j in range(whole, n):
        b[j] /= LU[j, j]
        for i in range(j + 1, n):
            b[i] -= LU[j, i] * b[j]
    for j in range(n - 1, whole - 1, -1):
        for i in range(j):
            b[i] -= LU[j, i] * b[j]
    for k in range(whole - PIVOT_BLOCK, -1, -PIVOT_BLOCK):
        z = b[k + 3]
        y = b[k + 2] - LU[k + 3, k + 2] * z
        x = b[k + 1] - LU[k + 3, k + 1] * z - LU[k + 2, k + 1] * y
        w = b[k] - LU[k + 3, k] * z - LU[k + 2, k] * y - LU[k + 1, k] * x
        b[k], b[k + 1], b[k + 2] = w, x, y
        for i in range(k):
            b[i] -= LU[k, i] * w + LU[k + 1, i] * x + LU[k + 2, i] * y + LU[k + 3, i] * z


@jit_internal
def dot_n(a, b):
    """Return the dot product of two vectors."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total
