"""Ten hours of control by shape: is every number finite, every limit kept, and does memory stay?

    python -m tools.benchmarks.control.endurance --hours 10 --out DIR [--seed 1]

Goes on from DIR where it was stopped. Prints a table; ends at once, and with status 1, where a motion is lost or a number is not
finite.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import tyro

from tools.benchmarks.control.endurance.course import MINUTE
from tools.benchmarks.control.endurance.log import MINUTES, begun, line, save, table
from tools.benchmarks.control.endurance.rig import Look, Rig
from tools.benchmarks.table import append_row
from twin.foundation.errors import SolveError
from twin.foundation.threads import single_thread
from twin.tasks import CONTROL_STEP

OF_A_MINUTE = round(MINUTE / CONTROL_STEP)


def minute(rig: Rig, steps: int) -> tuple[list[Look], str]:
    """Return looks at so many steps, and what ended them early, if anything."""
    looks: list[Look] = []
    for _ in range(steps):
        try:
            looks.append(rig.step())
        except SolveError as lost:
            rig.faults["lost"] += 1
            return looks, str(lost)
        if rig.faults["nan"]:
            return looks, f"a number is not finite at t = {rig.time:.2f} s"
    return looks, ""


def endure(folder: Path, hours: float, seed: int, told: Callable[[str], None] = print) -> str:
    """Simulate until so many hours are done in all; return what ended it before, if anything."""
    rig, minutes = begun(folder, seed)
    before, started, ended = minutes[-1]["wall"] if minutes else 0.0, time.monotonic(), ""
    while rig.time < 3600.0 * hours - 0.5 * CONTROL_STEP and not ended:
        left = round((3600.0 * hours - rig.time) / CONTROL_STEP)
        looks, ended = minute(rig, min(left, OF_A_MINUTE))
        minutes.append(line(looks, rig, before + time.monotonic() - started))
        append_row(folder / MINUTES, minutes[-1])
        if not ended:
            save(folder, rig)
    told(table(minutes) if minutes else "nothing was simulated")
    return ended


def main(out: Path, hours: float = 10.0, seed: int = 1) -> None:
    """Simulate until `hours` are simulated in all."""
    with single_thread():
        ended = endure(out, hours, seed)
    if ended:
        raise SystemExit(f"ended: {ended}")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
