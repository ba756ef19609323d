"""Work that is shared out gives the same answers on every backend of joblib, also on a Ray of two workers (extra `cluster`)."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from itertools import count

import joblib
import numpy as np
import pytest
from joblib import delayed

from tools.benchmarks.cluster import backend
from twin.foundation.parallel import TASKS_PER_WORKER, run_parallel
from twin.prediction.rollout import draw_controls, rollout
from twin.prediction.rollout.controls import Drawing
from twin.prediction.twin import Twin


def piece(k: int) -> tuple[int, int]:
    """Which it is, the first being the slowest, and whose process did it."""
    time.sleep(0.5 if k == 0 else 0.01)
    return k, os.getpid()


def test_what_is_done_first_comes_first_unless_the_order_is_asked_for() -> None:
    work = [delayed(piece)(k) for k in range(6)]
    assert [k for k, _ in run_parallel(work, 2, "threads", ordered=True)] == list(range(6))
    came = [k for k, _ in run_parallel(work, 2, "threads")]
    assert sorted(came) == list(range(6))
    assert came[0] != 0


def test_where_results_come_together_work_goes_out_in_batches() -> None:
    """Work without end is asked for by the batch only, and each batch is given out before the next is begun."""
    asked = []

    def endless() -> Iterator[object]:
        for k in count():
            asked.append(k)
            yield delayed(piece)(k)

    with joblib.parallel_config(backend="multiprocessing"):
        came = run_parallel(endless(), 2)
        assert [next(came)[0] for _ in range(2 * TASKS_PER_WORKER)] == list(range(2 * TASKS_PER_WORKER))
        assert len(asked) == 2 * TASKS_PER_WORKER
        came.close()  # type: ignore[attr-defined]


def test_two_workers_of_ray_do_all_work_and_roll_out_what_threads_do() -> None:
    pytest.importorskip("ray", reason="extra `cluster`")
    twin = Twin.of("continuum")
    controls = draw_controls(twin, 4, seed=4, drawing=Drawing(seconds=1.0, rate=25.0))
    here = rollout(twin, controls, noise=1e-4, seed=4, jobs=2).recording
    with backend("ray", 2):
        came = list(run_parallel((delayed(divmod)(k, 5) for k in range(3 * TASKS_PER_WORKER)), 2))
        workers = set(run_parallel((delayed(os.getpid)() for _ in range(TASKS_PER_WORKER)), 2))
        there = rollout(twin, controls, noise=1e-4, seed=4, jobs=2).recording
    assert came == [divmod(k, 5) for k in range(3 * TASKS_PER_WORKER)]
    assert os.getpid() not in workers
    for a, b in zip(here.trials, there.trials, strict=True):
        for name, values in a.values.items():
            assert np.array_equal(values, b.values[name], equal_nan=True)
