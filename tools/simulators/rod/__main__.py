"""Write one measurement set:  python -m tools.simulators.rod --out DIR --effect tendon_friction --amplitude 3 --seed 7

Several --effect may be given, each scaled to leave --amplitude sigmas by itself; without any the set has no effect.
"""

import sys
import time
from pathlib import Path

import tyro

from tools.simulators.rod.day import Recipe, make_set


def main(out: Path, recipe: tyro.conf.OmitArgPrefixes[Recipe]) -> None:
    """Write one measurement set into the folder `out`."""
    began = time.perf_counter()

    def progress(what: str) -> None:
        print(f"\r{time.perf_counter() - began:6.1f} s  {what:60s}", end="", file=sys.stderr, flush=True)

    found = make_set(out, recipe, progress)
    print(file=sys.stderr)
    for effect, sigmas in found:
        print(f"{effect.id}: {sigmas:.2f} sigma at strength {effect.strength:.4g}")
    print(out)


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
