"""Functions compiled to machine code: one decorator, so that all inner loops share their floating-point rules and disk cache."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

# No flag that lets the compiler assume finite numbers: a diverging step must be seen as such.
_FAST = {"contract", "reassoc", "nsz", "arcp"}


def jit(function: Callable[..., Any]) -> Any:
    """Compile to machine code, without the GIL, kept on disk between runs."""
    return numba.njit(nogil=True, fastmath=_FAST, error_model="numpy", cache=True)(function)


@jit
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def assign(target, source):
    """target[:] = source for 1-D arrays of one length, without the shape check (which takes seconds to compile)."""
    for i in range(target.size):
        target[i] = source[i]


@jit
def put(target, v):
    """target[:] = v for three-vectors."""
    target[0], target[1], target[2] = v[0], v[1], v[2]
