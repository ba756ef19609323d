"""Write one virtual bench day:  python -m tools.bench --out DIR --effect tendon_friction --amplitude 3 --seed 7

Several --effect may be given, each scaled to leave --amplitude sigmas by itself; without any the set has no effect.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tools.bench.day import MISMATCH, make_set
from tools.bench.design import DESIGNS
from tools.bench.effects import all_effects


def main() -> None:
    known = all_effects()
    parser = argparse.ArgumentParser(prog="python -m tools.bench", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder of the measurement set")
    parser.add_argument("--effect", action="append", default=[], choices=sorted(known), help="may be repeated")
    parser.add_argument("--amplitude", type=float, default=3.0, help="sigmas left after refitting, per effect")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--design", default="default", choices=DESIGNS)
    parser.add_argument("--displacement", action="store_true", help="also log tendon displacements")
    parser.add_argument("--ambient", action="store_true", help="also log the ambient temperature")
    parser.add_argument("--coloured", action="store_true", help="marker noise AR(1) 0.4 with Student-t tails, 5 degrees")
    parser.add_argument("--mismatch", default="built", choices=MISMATCH, help="how far the robot is from its description")
    args = parser.parse_args()

    began = time.perf_counter()

    def progress(what: str) -> None:
        print(f"\r{time.perf_counter() - began:6.1f} s  {what:60s}", end="", file=sys.stderr, flush=True)

    found = make_set(
        args.out,
        args.effect,
        args.amplitude,
        args.seed,
        args.design,
        displacement=args.displacement,
        ambient=args.ambient,
        coloured=args.coloured,
        mismatch=args.mismatch,
        progress=progress,
    )
    print(file=sys.stderr)
    for effect, sigmas in found:
        print(f"{effect.id}: {sigmas:.2f} sigma at strength {effect.strength:.4g}")
    print(args.out)


main()
