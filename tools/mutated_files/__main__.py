"""See the package's docstring."""

from __future__ import annotations

import argparse
import json
import queue
import select
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

from tools.mutated_files.sources import KINDS
from tools.mutated_files.worker import make

SLOW = 5.0  # s
PATIENCE = 60.0  # s, making and checking it included, until a worker is given up and its mutant called hung
LARGE = 1024.0  # MB
OUTCOMES = ("refused", "accepted", "traceback", "hang", "memory", "meaning")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder for the files that went wrong")
    args = parser.parse_args()
    answers = judged(args.count, args.seed, args.workers)
    print(table(answers))
    wrong = [a for a in answers if a["outcome"] not in ("refused", "accepted")]
    for a in wrong:
        print(f"{a['kind']} {a['seed']}: {a['outcome']}, {a['seconds']:.1f} s, {a['MB']:.0f} MB: {a['words'].strip()[-300:]}")
        if args.keep:
            folder = args.keep / f"{a['kind']}_{a['seed']}"
            folder.mkdir(parents=True, exist_ok=True)
            make(a["kind"], a["seed"], folder)
    sys.exit(bool(wrong))


def judged(count: int, seed: int, workers: int) -> list[dict[str, Any]]:
    """Answers of `count` mutants, the kinds in turn, from `seed` on."""
    todo: queue.Queue[str] = queue.Queue()
    order = [f"{KINDS[n % len(KINDS)]} {seed + n // len(KINDS)}" for n in range(count)]
    Random(0).shuffle(order)
    for each in order:
        todo.put(each)
    answers: list[dict[str, Any]] = []
    threads = [threading.Thread(target=_work, args=(todo, answers)) for _ in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sorted(answers, key=lambda a: (a["kind"], a["seed"]))


def _work(todo: queue.Queue[str], answers: list[dict[str, Any]]) -> None:
    """Feeds one worker; a worker that dies or hangs is replaced."""
    worker = _started()
    while True:
        try:
            line = todo.get_nowait()
        except queue.Empty:
            worker.kill()
            worker.wait()
            return
        assert worker.stdin is not None
        assert worker.stdout is not None
        worker.stdin.write(line + "\n")
        worker.stdin.flush()
        ready, _, _ = select.select([worker.stdout], [], [], PATIENCE)
        said = worker.stdout.readline() if ready else ""
        if said:
            answers.append(_limited(json.loads(said)))
            continue
        kind, seed = line.split()
        outcome = "traceback" if ready else "hang"
        answers.append(
            {"kind": kind, "seed": int(seed), "outcome": outcome, "words": "the process died", "seconds": PATIENCE, "MB": 0.0}
        )
        worker.kill()
        worker.wait()
        worker = _started()


def _started() -> subprocess.Popen[str]:
    worker = subprocess.Popen(
        [sys.executable, "-m", "tools.mutated_files.worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert worker.stdin is not None
    assert worker.stdout is not None
    worker.stdin.write("set -1\n")  # imports and first use are no mutant's fault
    worker.stdin.flush()
    worker.stdout.readline()
    return worker


def _limited(answer: dict[str, Any]) -> dict[str, Any]:
    if answer["outcome"] in ("refused", "accepted"):
        if answer["seconds"] > SLOW:
            answer["outcome"] = "hang"
        elif answer["MB"] > LARGE:
            answer["outcome"] = "memory"
    return answer


def table(answers: list[dict[str, Any]]) -> str:
    """Counts by kind."""
    counts = {kind: Counter(a["outcome"] for a in answers if a["kind"] == kind) for kind in KINDS}
    counts["all"] = Counter(a["outcome"] for a in answers)
    lines = [f"{'':8}{'files':>8}" + "".join(f"{name:>11}" for name in OUTCOMES)]
    lines += [f"{kind:8}{c.total():8}" + "".join(f"{c[name]:11}" for name in OUTCOMES) for kind, c in counts.items()]
    slowest, largest = (max((a[key] for a in answers), default=0.0) for key in ("seconds", "MB"))
    return "\n".join([*lines, f"slowest {slowest:.1f} s, largest {largest:.0f} MB"])


if __name__ == "__main__":
    main()
