"""Write one virtual day of the soft finger:  python -m tools.simulators.finger --out DIR --effect tendon_friction --seed 7

--effect may be given several times, or --effects a,b; without any the set has no effect. --shape writes a day for shape sensing;
with --edges, two sharp edges hold the finger in its tests where else a hand pushes.
"""

import argparse
import sys
import time
from pathlib import Path

from tools.simulators.finger.day import make_set
from tools.simulators.finger.effects import all_effects


def main() -> None:
    known = sorted(all_effects())
    parser = argparse.ArgumentParser(prog="python -m tools.simulators.finger", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder of the set, not there yet")
    parser.add_argument("--effect", action="append", default=[], choices=known, help="may be repeated")
    parser.add_argument("--effects", default="", help="the same, with commas: " + ", ".join(known))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--shape", action="store_true", help="trials to align a shape estimator by and to test it on")
    parser.add_argument("--edges", action="store_true", help="of a shape day: two sharp edges hold the finger in its tests")
    args = parser.parse_args()
    names = args.effect + [name for name in args.effects.split(",") if name]
    if strange := sorted(set(names) - set(known)):
        parser.error(f"unknown effect {', '.join(strange)}; known: {', '.join(known)}")
    if args.out.exists():
        parser.error(f"{args.out} exists; give a new folder")
    began = time.perf_counter()

    def progress(what: str) -> None:
        print(f"{time.perf_counter() - began:6.1f} s  {what}", file=sys.stderr, flush=True)

    for effect in make_set(args.out, names, args.seed, args.shape, progress, args.edges):
        print(effect)
    print(args.out)


if __name__ == "__main__":
    main()
