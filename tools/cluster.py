"""What more workers bring: the same sets diagnosed by 1, 2, 4 of them, in joblib's own processes and on a local Ray.

    python -m tools.cluster results/set_* [--workers 1,2,4]        # extra `cluster`

Each set is one piece of work on one core. Prints seconds, how many times faster than one worker, and whether every way gives the
same answers to the last digit; workers are started, and the compiled code fetched from disk, before the clock. More workers than
cores show what sharing costs, not what more cores would bring.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import joblib
from joblib import delayed

from twin.diagnose import Settings, diagnose
from twin.measurements import read
from twin.robots import load
from twin.spread import as_they_come
from twin.twin import Twin

BACKENDS = ("loky", "ray")


@contextmanager
def backend(name: str, workers: int) -> Iterator[None]:
    """joblib's backend; Ray's on the cluster that RAY_ADDRESS names, else on a Ray of so many workers on this machine."""
    if name != "ray":
        with joblib.parallel_config(backend=name):
            yield
        return
    import ray
    from ray.util.joblib import register_ray

    register_ray()
    if "RAY_ADDRESS" in os.environ:
        ray.init(logging_level="ERROR")
    else:
        ray.init(num_cpus=workers, include_dashboard=False, logging_level="ERROR")
    try:
        with joblib.parallel_config(backend="ray"):
            yield
    finally:
        ray.shutdown()


def answer(folder: Path) -> tuple[str, str, tuple[tuple[str, float], ...], float]:
    """Which set, the verdict, the claims and their probabilities, and the error on sealed trials."""
    recording = read(folder)
    found = diagnose(recording, Twin.of(load(recording.robot)), Settings(jobs=1))
    claims = tuple((c.effect, c.probability) for c in found.claims)
    return folder.name, found.verdict, claims, sum(found.errors.after.values())


def timed(name: str, workers: int, sets: Sequence[Path]) -> tuple[float, list[object]]:
    """Seconds for all sets, and the answers in the order of their names."""
    with backend(name, workers):
        list(as_they_come((delayed(answer)(s) for s in sets[:1] * workers), workers))
        began = time.perf_counter()
        found = sorted(as_they_come((delayed(answer)(s) for s in sets), workers))
        return time.perf_counter() - began, found


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("sets", type=Path, nargs="+")
    asked.add_argument("--workers", default="1,2,4")
    said = asked.parse_args()
    print(f"{len(said.sets)} sets, {os.cpu_count()} cores\n")
    print("| workers | backend | seconds | times faster | answers |\n|---|---|---|---|---|")
    first: dict[str, float] = {}
    answers: list[object] = []
    for workers in (int(n) for n in said.workers.split(",")):
        for name in BACKENDS:
            seconds, found = timed(name, workers, said.sets)
            answers = answers or found
            same = "the same" if found == answers else "OTHERS"
            first.setdefault(name, seconds)
            print(f"| {workers} | {name} | {seconds:.0f} | {first[name] / seconds:.2f} | {same} |", flush=True)


if __name__ == "__main__":
    main()
