"""Named tuples behind a pointer: compiled code reads and changes the same arrays, gives the tuples back, and frees its memory."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import NamedTuple

import numba
import numpy as np

from twin.foundation.by_reference import by_reference, refer_to


@by_reference
class Inner(NamedTuple):
    """Unlike members."""

    x: np.ndarray
    count: int


@by_reference
class Outer(NamedTuple):
    """A tuple in a tuple."""

    inner: Inner
    y: np.ndarray
    scale: float
    on: bool


@by_reference
class Alike(NamedTuple):
    """Members of one type, which numba keeps as an array."""

    a: np.ndarray
    b: np.ndarray


@numba.njit
def add_to(outer, step):
    outer.inner.x[0] += step
    if outer.on:
        outer.y[1] = outer.scale
    return outer.inner.x.sum() + outer.inner.count


@numba.njit
def give_back(anything):
    return anything


@numba.njit
def built(n):
    inner = refer_to(Inner(np.ones(n), n))
    outer = refer_to(Outer(inner, np.zeros(2), 3.0, True))
    return add_to(outer, 1.0), outer


def example(n: int = 4) -> Outer:
    return Outer(Inner(np.ones(n), n), np.zeros(2), 3.0, True)


def test_compiled_code_changes_the_arrays_of_the_tuple() -> None:
    outer = example()
    assert add_to(outer, 1.0) == 9.0
    assert outer.inner.x.tolist() == [2.0, 1.0, 1.0, 1.0]
    assert outer.y.tolist() == [0.0, 3.0]
    add_to(outer._replace(on=False, y=outer.y * 0.0), 1.0)
    assert outer.inner.x[0] == 3.0


def test_a_tuple_comes_back_with_its_own_arrays() -> None:
    outer = example()
    again = give_back(outer)
    assert isinstance(again, Outer)
    assert isinstance(again.inner, Inner)
    assert again.inner.x is outer.inner.x
    assert again[2:] == (3.0, True)
    alike = give_back(Alike(outer.y, outer.inner.x))
    assert (alike.a is outer.y, alike.b is outer.inner.x) == (True, True)


def test_what_compiled_code_builds_is_what_python_passes() -> None:
    """One compiled `add_to` serves both."""
    total, outer = built(4)
    assert total == 9.0
    assert outer.y.tolist() == [0.0, 3.0]
    add_to(example(), 1.0)
    assert len(add_to.signatures) == 1


def test_no_reference_is_left_behind() -> None:
    outer = example()
    give_back(outer)
    counted = [sys.getrefcount(outer.inner.x), sys.getrefcount(outer.y)]
    for _ in range(100):
        add_to(outer, 1.0)
        give_back(outer)
        built(3)
    assert [sys.getrefcount(outer.inner.x), sys.getrefcount(outer.y)] == counted


def test_what_was_allocated_is_freed() -> None:
    """By numba's own counts, which are off unless asked for."""
    code = (
        "from tests.foundation.test_by_reference import add_to, built, example, give_back\n"
        "from numba.core.runtime import rtsys\n"
        "for _ in range(100): built(3); add_to(example(), 1.0); give_back(example())\n"
        "s = rtsys.get_allocation_stats()\n"
        "assert s.alloc > 300 and (s.alloc, s.mi_alloc) == (s.free, s.mi_free), s"
    )
    environment = {"NUMBA_NRT_STATS": "1", "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
