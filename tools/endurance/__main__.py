"""Ten hours of control by shape on a finger the controller does not know: nothing that is not finite, no limit broken, no memory
that grows.

    python -m tools.endurance --hours 10 --out DIR [--seed 1]

Goes on from DIR where it was stopped. Prints a table; ends at once, and with status 1, where a motion is lost or a number is not
finite.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tools.endurance.course import MINUTE
from tools.endurance.log import append, begun, line, save, table
from tools.endurance.rig import Look, Rig
from twin.errors import SolveError
from twin.tasks import STEP
from twin.threads import single_thread

OF_A_MINUTE = round(MINUTE / STEP)


def minute(rig: Rig, steps: int) -> tuple[list[Look], str]:
    """Looks at so many steps, and what ended them early, if anything."""
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
    """Until so many hours are simulated in all; what ended it before, if anything."""
    rig, minutes = begun(folder, seed)
    before, started, ended = minutes[-1]["wall"] if minutes else 0.0, time.monotonic(), ""
    while rig.time < 3600.0 * hours - 0.5 * STEP and not ended:
        left = round((3600.0 * hours - rig.time) / STEP)
        looks, ended = minute(rig, min(left, OF_A_MINUTE))
        minutes.append(line(looks, rig, before + time.monotonic() - started))
        append(folder, minutes[-1])
        if not ended:
            save(folder, rig)
    told(table(minutes) if minutes else "nothing was simulated")
    return ended


def main(arguments: Sequence[str] | None = None) -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--hours", type=float, default=10.0, help="simulated, in all")
    asked.add_argument("--out", type=Path, required=True)
    asked.add_argument("--seed", type=int, default=1)
    given = asked.parse_args(arguments)
    with single_thread():
        ended = endure(given.out, given.hours, given.seed)
    if ended:
        raise SystemExit(f"ended: {ended}")


if __name__ == "__main__":
    main()
