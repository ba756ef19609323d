"""Makes bench days one by one: DIR/sets/day_01 ... and DIR/truth/day_01.json ...

A day that exists is kept, so that a run that was killed goes on where it stopped. What is printed does not tell a day's truth.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from tools.second_bench.plan import plan
from tools.second_bench.write import make_day


def main() -> None:
    asked = argparse.ArgumentParser(
        prog="python -m tools.second_bench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    asked.add_argument("--out", type=Path, required=True, metavar="DIR")
    asked.add_argument("--days", type=int, default=30)
    asked.add_argument("--seed", type=int, default=1)
    said = asked.parse_args()
    for planned in plan(said.days, said.seed):
        began = time.perf_counter()
        line = make_day(said.out, planned, said.seed)
        print(f"{line}, {time.perf_counter() - began:.0f} s" if line else f"day_{planned.number:02d}: kept", flush=True)


if __name__ == "__main__":
    main()
