"""The data factory under random kills: one order made at once, and made by a process killed again and again, compared bit for bit.

    python -m tools.factory_kills OUT [--samples 4000] [--kills 20] [--longest 90] [--seed 0]

A kill (SIGKILL to the whole process group, workers too) comes a random time after a start, up to `--longest` s; then the same
command goes on. Prints how many shards the killed one had at each kill, and whether both folders hold the same bytes; each run says
how many samples found no equilibrium.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np


def command(folder: Path, samples: int, jobs: int) -> list[str]:
    return [
        sys.executable, "-m", "twin.cli", "generate", "finger", "--samples", str(samples), "--seed", "11", "--jobs", str(jobs),
        "--out", str(folder),
    ]  # fmt: skip


def killed(order: list[str], after: float) -> bool:
    """Whether a run was killed `after` seconds; it may have been done before."""
    process = subprocess.Popen(order, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        process.wait(after)
    except subprocess.TimeoutExpired:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return True
    if process.returncode:
        raise SystemExit(f"{' '.join(order)} ended with {process.returncode}")
    return False


def digest(folder: Path) -> str:
    parts = [p.name.encode() + p.read_bytes() for p in sorted(folder.glob("*.parquet"))]
    return hashlib.sha256(b"".join(parts)).hexdigest()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--samples", type=int, default=4000)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--longest", type=float, default=90.0, help="s from a start to its kill")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng, torn = np.random.default_rng(given.seed), given.out / "killed"
    order, kills = command(torn, given.samples, given.jobs), 0
    for _ in range(given.kills):
        if not killed(order, float(rng.uniform(0.5, given.longest))):
            break
        kills += 1
        print(
            f"kill {kills}: {len(list(torn.glob('*.parquet')))} shards, {len(list(torn.glob('*.part')))} half-written", flush=True
        )
    subprocess.run(order, check=True)
    subprocess.run(command(given.out / "whole", given.samples, given.jobs), check=True)
    same = digest(torn) == digest(given.out / "whole")
    print(f"{kills} kills, {given.samples} samples: {'the same bytes' if same else 'DIFFERENT'}")
    raise SystemExit(0 if same and kills == given.kills else 1)


if __name__ == "__main__":
    main()
