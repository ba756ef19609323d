"""How wide the band of the `physics` estimator must be to hold 90 % of the points of held-out factory fingers that a hand pushes.

    twin generate finger --samples 60000 --seed 1 --out shapes/
    python -m tools.shape_band shapes/ [--fingers 30]

Prints the value for BAND in twin/shape/physics.py, and coverage by how wide the band is and how far the points moved. The trained
estimators find theirs when they are trained, on the same fingers. No bench day plays a part.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from twin.factory.draw import LENGTH
from twin.robots import load
from twin.shape.estimator import Z90, Felt, own_error
from twin.shape.lesson import disturbed
from twin.shape.lesson import load as samples
from twin.shape.physics import BAND, Physics
from twin.twin import Twin


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.shape_band", description=__doc__)
    parser.add_argument("shapes", type=Path)
    parser.add_argument("--fingers", type=int, default=30, help="of each kind")
    args = parser.parse_args()
    robot = load("finger")
    data, law, rng = samples(args.shapes, robot), Physics(Twin.of(robot)), np.random.default_rng(5)
    ratio, push, way = [], [], []
    for kind in ("pushed", "both"):
        rows = np.flatnonzero(data.held & (data.kind == kind))
        for chain in np.array_split(rows, len(rows) // LENGTH)[: args.fingers]:
            strain, displacement = disturbed(rng, data, chain, dead=0.0)
            shapes = law.estimate(Felt(strain, displacement))
            true = np.einsum("pn,bnc->bpc", data.weights, data.nodes[chain].reshape(len(chain), -1, 3))
            away = np.linalg.norm(shapes.moved - true, axis=2)
            spread = np.sqrt(np.maximum(shapes.std**2 - own_error(shapes.moved) ** 2, 1e-14))
            ratio.append(away / spread)
            push.append(spread.mean(axis=1))
            way.append(np.linalg.norm(shapes.moved, axis=2).mean(axis=1))
    ratios = np.concatenate(ratio)
    print(f"BAND = {BAND * np.quantile(ratios, 0.9) / Z90:.2f} (now {BAND}); now it holds {100 * (ratios < Z90).mean():.1f} %")
    for words, sizes in (("std", np.concatenate(push)), ("displacement", np.concatenate(way))):
        part = np.digitize(sizes, np.quantile(sizes, [0.2, 0.4, 0.6, 0.8]))
        held = [f"{100 * (ratios[part == k] < Z90).mean():.0f} % at {1e3 * np.median(sizes[part == k]):.2g} mm" for k in range(5)]
        print(f"  by mean {words}: {', '.join(held)}")


if __name__ == "__main__":
    main()
