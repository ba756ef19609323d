"""A pool of compiled bodies and solvers: neighbours in a fit differ mostly in what is done to the same robot."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from threading import Lock

from twin.body import Body, Solver

MOST_IDLE_SOLVERS = 32  # more than a model has neighbours, which are used in turn; a backbone's solver takes 1 to 3 MB

BodyAndSolver = tuple[Body, Solver]
_idle: OrderedDict[Hashable, list[BodyAndSolver]] = OrderedDict()  # least lately used first
_lock = Lock()


@contextmanager
def borrow_solver(of: Hashable, make: Callable[[], BodyAndSolver]) -> Iterator[BodyAndSolver]:
    """Borrow a compiled body and solver for `key`, reusing an idle pair or calling `make`; it returns to the pool on exit."""
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
            while sum(map(len, _idle.values())) > MOST_IDLE_SOLVERS:
                oldest, stack = next(iter(_idle.items()))
                if stack:
                    stack.pop()
                if not stack:
                    del _idle[oldest]
