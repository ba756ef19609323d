"""Linear algebra in one thread: the systems here are small, and trials are solved in parallel instead."""

from contextlib import AbstractContextManager
from functools import cache

import scipy.linalg  # noqa: F401  its BLAS must be loaded before threads are counted
from threadpoolctl import ThreadpoolController


def single_thread() -> AbstractContextManager[object]:
    """Limit linear algebra to one thread inside a `with` block.

    Two threads take tens of times longer on silicone systems on a busy machine, and a tenth longer on a rod's diagnosis.
    """
    return _thread_controller().limit(limits=1)


@cache
def _thread_controller() -> ThreadpoolController:
    return ThreadpoolController()
