"""Decorators that compile functions with numba, with one set of floating-point rules and one disk cache."""

import hashlib
import os
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

import numba
from numba.core import caching, event

# No flag lets the compiler assume finite numbers: a diverging step must be noticed.
_FASTMATH_FLAGS = {"contract", "reassoc", "nsz", "arcp"}


def _source_digest(package: Path) -> str:
    """Return a digest of all modules of a package that compile functions."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if b"twin.foundation.compiled import" in text or path.name in ("compiled.py", "by_reference.py"):
            digest.update(text)
    return digest.hexdigest()


_SOURCE_DIGEST = _source_digest(Path(__file__).parent.parent)


class CodeCache(caching.IndexDataCacheFile):
    """The machine code of one function on disk.

    Numba's own cache differs in two ways. It ignores changes in other files whose functions were compiled into this one, and it
    numbers its files, so two processes that compile at the same time may use one number for two signatures.
    """

    def _data_name(self, number: int) -> str:
        return super()._data_name(uuid4().int)

    def save(self, key: Any, data: Any) -> None:
        if not self._load_index():
            for stale in Path(self._cache_path).glob(Path(self._index_name).stem + ".*.nbc"):
                stale.unlink(missing_ok=True)  # another process that misses its file compiles it again
        super().save(key, data)


class CacheWarning(UserWarning):
    """Compiled code cannot be written to its cache."""


def _warn(words: str) -> None:
    warnings.warn(f"{words}; set NUMBA_CACHE_DIR to a folder you may write to", CacheWarning, stacklevel=3)


def _private_temporary_folder() -> Path:
    """Return a temporary folder that only this user can write, the same in every run where possible."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"twin-compiled-{user}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    if stat.S_ISDIR(found.st_mode) and found.st_uid == user and not found.st_mode & 0o077:
        return folder
    return Path(tempfile.mkdtemp(prefix="twin-compiled-"))


def _use_temporary_cache() -> None:
    """Make numba write its cache to a temporary folder, in worker processes too, and warn."""
    folder = str(_private_temporary_folder())
    os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = folder  # type: ignore[attr-defined]
    _warn(f"numba can write its cache of compiled code neither beside the program nor in your home; it is now in {folder}")


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function under the common rules, with a cache on disk. Warns once where the usual cache cannot be written."""
    compiler = numba.njit(nogil=True, fastmath=_FASTMATH_FLAGS, error_model="numpy", cache=True, **options)
    try:
        dispatcher: Any = compiler(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        _use_temporary_cache()
        dispatcher = compiler(function)
    cache = dispatcher._cache
    stamp = (cache._impl.locator.get_source_stamp(), _SOURCE_DIGEST)
    cache._cache_file = CodeCache(cache._cache_path, cache._impl.filename_base, stamp)
    save = cache.save_overload

    def save_or_warn(signature: Any, data: Any) -> None:
        try:
            save(signature, data)
        except OSError as error:
            _warn(f"compiled code cannot be kept in {cache._cache_path} ({error.strerror or error})")

    cache.save_overload = save_or_warn
    return dispatcher


def jit(function: Callable[..., Any]) -> Any:
    """Compile a function to machine code that runs without the GIL and is cached on disk."""
    return _compiled(function)


def jit_internal(function: Callable[..., Any]) -> Any:
    """Compile a function that only compiled code calls: `jit` without the wrappers for Python, a tenth of the compile time."""
    return _compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def jit_inline(function: Callable[..., Any]) -> Any:
    """Inline a function into the compiled functions that call it.

    Otherwise numba optimises it again, with all that it calls, in every caller: near the root of a deep call tree each level costs
    seconds. Not for recursive functions, nor for functions that Python calls.
    """
    return numba.njit(nogil=True, fastmath=_FASTMATH_FLAGS, error_model="numpy", inline="always")(function)


class _CompilationListener(event.Listener):
    def __init__(self, callback: Callable[[bool], None]) -> None:
        self.callback, self.depth = callback, 0

    def on_start(self, event: event.Event) -> None:
        self.depth += 1
        self.callback(True)

    def on_end(self, event: event.Event) -> None:
        self.depth -= 1
        self.callback(self.depth > 0)


@contextmanager
def report_compiling(callback: Callable[[bool], None]) -> Iterator[None]:
    """Call `callback` with True when a compilation starts and with False when the last one ends. Cached functions do not count."""
    listener = _CompilationListener(callback)
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)


@jit_internal
def cross(a, b):
    """Return the cross product of two three-vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit_internal
def dot(a, b):
    """Return the dot product of two three-vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit_internal
def assign(target, source):
    """Set target[:] = source for 1-D arrays of one length, without numba's shape check, which takes seconds to compile."""
    for i in range(target.size):
        target[i] = source[i]


@jit_internal
def assign_vector3(target, v):
    """Set target[:] = v for three-vectors."""
    target[0], target[1], target[2] = v[0], v[1], v[2]
