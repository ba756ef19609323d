"""Where work that is shared out runs: in processes of this machine, or on a Ray cluster (extra `cluster`)."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

import joblib

Backend = Literal["loky", "ray"]


@contextmanager
def backend(name: str, workers: int) -> Iterator[None]:
    """Set joblib's backend: Ray's on the cluster that RAY_ADDRESS names, else on a Ray of so many workers on this machine."""
    if name != "ray":
        with joblib.parallel_config(backend=name):
            yield
        return
    import ray
    from ray.util.joblib import register_ray

    register_ray()
    workers_here = {} if "RAY_ADDRESS" in os.environ else {"num_cpus": workers, "include_dashboard": False}
    ray.init(logging_level="ERROR", **workers_here)
    try:
        with joblib.parallel_config(backend="ray"):
            yield
    finally:
        ray.shutdown()
