"""Linear algebra by one thread: the systems here are small, and what is worth sharing out is shared out by trials."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def single_thread() -> AbstractContextManager[object]:
    """Until it is left. With two threads silicone's systems take tens of times longer on a busy machine, a rod's diagnosis a tenth
    longer on a quiet one."""
    return _threads().limit(limits=1)


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()
