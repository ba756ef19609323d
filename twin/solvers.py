"""Solvers kept for those who ask for the same body again: neighbours in a fit differ mostly in what is done to a robot."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from threading import Lock

from twin.body import Body, Solver

KEPT = 32  # at once, more than a model has neighbours, who are asked for in turn; a backbone's take 1 to 3 MB each

Made = tuple[Body, Solver]
_idle: OrderedDict[Hashable, list[Made]] = OrderedDict()  # least lately used first
_lock = Lock()


@contextmanager
def lent(of: Hashable, make: Callable[[], Made]) -> Iterator[Made]:
    """The body and solver `of` something that says all they are made from, `make`'s or idle ones; the borrower's alone until it
    gives them back at the end."""
    with _lock:
        idle = _idle.get(of)
        found = idle.pop() if idle else None
    made = found or make()
    try:
        yield made
    finally:
        with _lock:
            _idle.setdefault(of, []).append(made)
            _idle.move_to_end(of)
            while sum(map(len, _idle.values())) > KEPT:
                oldest, stack = next(iter(_idle.items()))
                if stack:
                    stack.pop()
                if not stack:
                    del _idle[oldest]
