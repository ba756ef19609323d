"""Functions compiled to machine code: one decorator, so that all inner loops share their floating-point rules and disk cache."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

import numba
from numba.core import caching, event

# No flag that lets the compiler assume finite numbers: a diverging step must be seen as such.
_FAST = {"contract", "reassoc", "nsz", "arcp"}


def _compiled(package: Path) -> str:
    """A digest of all modules of a package that compile functions."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if b"twin.compiled import" in text or path == Path(__file__):
            digest.update(text)
    return digest.hexdigest()


_SOURCES = _compiled(Path(__file__).parent)


class Kept(caching.IndexDataCacheFile):
    """Machine code of one function on disk.

    Numba's own takes it for fresh while the function's file is, though functions of other files were compiled into it; and numbers
    it, so that two processes that compile at once may take one number for two signatures.
    """

    def _data_name(self, number: int) -> str:
        return super()._data_name(uuid4().int)

    def save(self, key: Any, data: Any) -> None:
        if not self._load_index():
            for stale in Path(self._cache_path).glob(Path(self._index_name).stem + ".*.nbc"):
                stale.unlink(missing_ok=True)  # were it another process's: what is not found is compiled again
        super().save(key, data)


def _kept(dispatcher: Any) -> Any:
    cache = dispatcher._cache
    stamp = (cache._impl.locator.get_source_stamp(), _SOURCES)
    cache._cache_file = Kept(cache._cache_path, cache._impl.filename_base, stamp)
    return dispatcher


def jit(function: Callable[..., Any]) -> Any:
    """Compile to machine code, without the GIL, kept on disk between runs."""
    return _kept(numba.njit(nogil=True, fastmath=_FAST, error_model="numpy", cache=True)(function))


def inner(function: Callable[..., Any]) -> Any:
    """As `jit`, for what compiled code alone calls: without the wrappers that take arguments from Python, which cost a tenth of the
    time to compile."""
    bare: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return _kept(numba.njit(nogil=True, fastmath=_FAST, error_model="numpy", cache=True, **bare)(function))


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
