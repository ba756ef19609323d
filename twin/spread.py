"""Independent pieces of work, shared out by joblib: among threads or processes here, or on a cluster's Ray (extra `cluster`).

    from ray.util.joblib import register_ray
    register_ray()
    with joblib.parallel_config(backend="ray"):
        ...

A piece is a whole rollout, a shard of samples, a set to diagnose. What is inside a fit stays in threads: it shares its arrays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Literal

from joblib import Parallel, effective_n_jobs
from joblib.parallel import get_active_backend

Prefer = Literal["threads", "processes"]

EACH = 4  # pieces a worker in a batch: a kill loses so many, and once in so many a worker waits for the others


def as_they_come(work: Iterable[Any], jobs: int, prefer: Prefer = "processes", ordered: bool = False) -> Iterator[Any]:
    """What each piece (`joblib.delayed(...)(...)`) returns, as soon as the backend tells it; with `ordered` in the order of `work`.

    Ray and multiprocessing tell nothing until all is done: there the work goes out in batches.
    """
    chosen: Any = get_active_backend(prefer=prefer)[0]
    if chosen.supports_return_generator:
        way = "generator" if ordered else "generator_unordered"
        yield from Parallel(n_jobs=jobs, prefer=prefer, return_as=way)(work)
        return
    pieces = iter(work)
    with Parallel(n_jobs=jobs, prefer=prefer) as parallel:
        while batch := list(islice(pieces, EACH * effective_n_jobs(jobs))):
            yield from parallel(batch)
