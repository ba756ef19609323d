"""How often the static solve follows a robot that is held by its lengths and caught by a post.

    python -m tools.snags

Sixty posts drawn at random, 20 mm in radius, 10 to 1,000 N/m, slanted by up to 29 degrees, where the continuum robot sweeps
round a circle of 12.5 mm of cable, 121 samples. Prints on how many every shape is found, and how many samples have none.
"""

from __future__ import annotations

import argparse

import numpy as np

from twin.body import Problem
from twin.effects import Drive, Loads, Route, named
from twin.equilibrium import Equilibrium
from twin.robots import load

POSTS, SAMPLES = 60, 121
CIRCLE, RISE = 12.5e-3, 20  # m of cable; samples in which it is reached


def post(seed: int) -> dict[str, float]:
    """Parameters of `contact`."""
    random = np.random.default_rng(seed)
    return {
        "curvature": 50.0,
        "stiffness": float(10 ** random.uniform(1.0, 3.0)),
        "azimuth": float(random.uniform(0.0, 2.0 * np.pi)),
        "distance": float(random.uniform(0.025, 0.05)),
        "height": float(random.uniform(0.06, 0.1)),
        "slant": float(random.uniform(-0.5, 0.5)),
    }


def missed(solver: Equilibrium, values: dict[str, float]) -> int:
    """Samples without a shape."""
    turn = np.linspace(0.0, 2.0 * np.pi, SAMPLES)
    pull = CIRCLE * np.minimum(1.0, np.arange(SAMPLES) / RISE)
    lengths = pull[:, None] * np.cos(turn[:, None] + 2.0 * np.pi * np.arange(3) / 3)
    loads = named("contact")(values, 3).surround(Loads(np.zeros(3)))
    path = solver.solve(Problem(turn, lengths, loads, Route(), (Drive.DISPLACEMENT,) * 3))
    return int((path.status == 0).sum())


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    solver = Equilibrium(load("continuum").build())
    found = [missed(solver, post(seed)) for seed in range(POSTS)]
    print(
        f"{sum(n == 0 for n in found)} of {POSTS} posts: every shape found; {sum(found)} of {POSTS * SAMPLES} samples without one"
    )


if __name__ == "__main__":
    main()
