"""Reads one mutant after another, `kind seed` a line, and answers how each went: outcome, seconds, megabytes, words."""

from __future__ import annotations

import json
import resource
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from random import Random

from tools.mutated_files import literal
from tools.mutated_files.cloud_mutations import mutated_clouds
from tools.mutated_files.sources import SET, TWIN, robot_texts, write_set
from tools.mutated_files.table_mutations import mutated_csv, write_mutated_parquet
from tools.mutated_files.toml_mutations import mutated
from twin.bench import prepare
from twin.errors import TwinError
from twin.measurements import read
from twin.report.robot_page import draw
from twin.robots import load
from twin.storage import read_twin

MOST_ADDRESSES = 16 * 2**30  # bytes: a reader that wants more is stopped by a MemoryError, which is a traceback
LONGEST_MESSAGE = 4000  # characters: twenty things that are wrong, each in a line


def make(kind: str, seed: int, folder: Path) -> Callable[[], Callable[[], None]]:
    """Writes a mutant of `kind` into `folder`; returns what reads it, which returns what checks it."""
    random = Random(f"{kind} {seed}")
    if kind == "robot":
        path = folder / "robot.toml"
        path.write_bytes(mutated(random.choice(robot_texts()), random))
        return lambda: _robot(path)
    if kind == "twin":
        path = folder / "twin.toml"
        path.write_bytes(mutated(TWIN, random))
        return lambda: _twin(path)
    whole = folder / "set"
    parquet = kind == "table" and random.random() < 0.3
    write_set(whole, "parquet" if parquet else "csv")
    if kind == "set":
        (whole / "measurements.toml").write_bytes(mutated(SET.replace("{suffix}", "csv"), random))
    elif kind == "cloud":
        (whole / "a.clouds.npz").write_bytes(mutated_clouds(random))
    elif parquet:
        write_mutated_parquet(whole / "a.parquet", random)
    else:
        (whole / "a.csv").write_bytes(mutated_csv(random))
    return lambda: _set(whole)


def _robot(path: Path) -> Callable[[], None]:
    robot = load(str(path.parent))
    draw(robot)
    return lambda: literal.check_robot(path, robot)


def _twin(path: Path) -> Callable[[], None]:
    twin = read_twin(path)
    body = twin.robot.build(twin.values)
    for effect in twin.effects:
        effect.edit(body)
    body.spec.compile()
    return lambda: literal.check_twin(path, twin)


def _set(folder: Path) -> Callable[[], None]:
    recording = read(folder)
    try:
        prepare(recording, load(recording.robot, folder))
    except TwinError as error:
        _one_line(error)
    return lambda: literal.check_set(folder, recording)


def _one_line(error: TwinError) -> None:
    said = str(error)
    if not said.isprintable() or len(said) > LONGEST_MESSAGE:
        raise AssertionError(f"not one line to print: {said[:200]!r}")


def tried(kind: str, seed: int) -> tuple[str, float, str]:
    """How one mutant went: refused, accepted, traceback or meaning; seconds to read it; and words."""
    folder = Path(tempfile.mkdtemp(prefix="mutated-"))
    start = time.monotonic()
    try:
        reading = make(kind, seed, folder)
        start = time.monotonic()
        try:
            check = reading()
        except TwinError as error:
            _one_line(error)
            return "refused", time.monotonic() - start, str(error)
        seconds = time.monotonic() - start
        try:
            check()
        except Exception as error:
            return "meaning", seconds, f"{type(error).__name__}: {error}"
        return "accepted", seconds, ""
    except Exception:
        return "traceback", time.monotonic() - start, traceback.format_exc()[-600:]
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _peak() -> float:
    """Largest resident memory since the last reset, MB."""
    line = next(each for each in Path("/proc/self/status").read_text().splitlines() if each.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def main() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MOST_ADDRESSES, MOST_ADDRESSES))
    for line in sys.stdin:
        kind, seed = line.split()
        Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
        outcome, seconds, words = tried(kind, int(seed))
        answer = {"kind": kind, "seed": int(seed), "outcome": outcome, "words": words, "seconds": seconds, "MB": _peak()}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
