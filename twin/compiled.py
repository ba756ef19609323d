"""Functions compiled to machine code: one decorator, so that all inner loops share their floating-point rules and disk cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.core import event

# No flag that lets the compiler assume finite numbers: a diverging step must be seen as such.
_FAST = {"contract", "reassoc", "nsz", "arcp"}


def jit(function: Callable[..., Any]) -> Any:
    """Compile to machine code, without the GIL, kept on disk between runs."""
    return numba.njit(nogil=True, fastmath=_FAST, error_model="numpy", cache=True)(function)


def inner(function: Callable[..., Any]) -> Any:
    """As `jit`, for what compiled code alone calls: without the wrappers that take arguments from Python, which cost a tenth of the
    time to compile."""
    bare: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return numba.njit(nogil=True, fastmath=_FAST, error_model="numpy", cache=True, **bare)(function)


def part(function: Callable[..., Any]) -> Any:
    """A piece of a larger compiled function, put into it before that is compiled.

    A function of its own is optimised again, with all that it calls, in every function that calls it: near the root of a deep tree
    of calls each level costs seconds. Not for recursion, nor for what Python calls.
    """
    return numba.njit(nogil=True, fastmath=_FAST, error_model="numpy", inline="always")(function)


class _Compiling(event.Listener):
    def __init__(self, told: Callable[[bool], None]) -> None:
        self.told, self.depth = told, 0

    def on_start(self, event: event.Event) -> None:
        self.depth += 1
        self.told(True)

    def on_end(self, event: event.Event) -> None:
        self.depth -= 1
        self.told(self.depth > 0)


@contextmanager
def compiling(told: Callable[[bool], None]) -> Iterator[None]:
    """Tell whether anything is being compiled, whenever that may have changed; what lies in the disk cache is not."""
    listener = _Compiling(told)
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)


@inner
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def assign(target, source):
    """target[:] = source for 1-D arrays of one length, without the shape check (which takes seconds to compile)."""
    for i in range(target.size):
        target[i] = source[i]


@inner
def put(target, v):
    """target[:] = v for three-vectors."""
    target[0], target[1], target[2] = v[0], v[1], v[2]
