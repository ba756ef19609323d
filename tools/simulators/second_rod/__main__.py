"""Make days one by one: DIR/sets/day_01 ... and DIR/truth/day_01.json ...

A day that exists is kept, so that a run that was stopped goes on. The lines printed do not reveal a day's truth.
"""

import time
from pathlib import Path

import tyro

from tools.simulators.second_rod.plan import plan
from tools.simulators.second_rod.write import make_day


def main(out: Path, days: int = 30, seed: int = 1) -> None:
    """Make the days that are missing."""
    for planned in plan(days, seed):
        began = time.perf_counter()
        line = make_day(out, planned, seed)
        print(f"{line}, {time.perf_counter() - began:.0f} s" if line else f"day_{planned.number:02d}: kept", flush=True)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
