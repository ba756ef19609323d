"""Run independent tasks in parallel with joblib: in threads or processes, or on a Ray cluster (extra `cluster`); or in one thread.

    from ray.util.joblib import register_ray
    register_ray()
    with joblib.parallel_config(backend="ray"):
        ...

A task is a whole rollout, a shard of samples or a set to diagnose. Work inside a fit stays in threads, which share its arrays.
"""

from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from functools import cache
from itertools import islice
from typing import Any, Literal

import scipy.linalg  # noqa: F401  its BLAS must be loaded before threads are counted
from joblib import Parallel, effective_n_jobs
from joblib.parallel import get_active_backend
from threadpoolctl import ThreadpoolController

Prefer = Literal["threads", "processes"]

TASKS_PER_WORKER = 4  # in a batch: a kill loses one batch, and workers wait for each other once a batch


def run_parallel(work: Iterable[Any], jobs: int, prefer: Prefer = "processes", ordered: bool = False) -> Iterator[Any]:
    """Yield the result of each task (`joblib.delayed(...)(...)`) when it is done; with `ordered` in the order of `work`.

    Ray and multiprocessing return nothing until all tasks are done, so they get the tasks in batches.
    """
    backend: Any = get_active_backend(prefer=prefer)[0]
    if backend.supports_return_generator:
        return_as = "generator" if ordered else "generator_unordered"
        yield from Parallel(n_jobs=jobs, prefer=prefer, return_as=return_as)(work)
        return
    tasks = iter(work)
    with Parallel(n_jobs=jobs, prefer=prefer) as parallel:
        while batch := list(islice(tasks, TASKS_PER_WORKER * effective_n_jobs(jobs))):
            yield from parallel(batch)


def single_thread() -> AbstractContextManager[object]:
    """Limit linear algebra to one thread inside a `with` block: systems here are small, and trials are solved in parallel instead.

    Two threads take tens of times longer on silicone systems on a busy machine, and a tenth longer on a rod's diagnosis.
    """
    return _thread_controller().limit(limits=1)


@cache
def _thread_controller() -> ThreadpoolController:
    return ThreadpoolController()
