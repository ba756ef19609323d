"""How wide the band of the `physics` estimator must be to hold 90 % of the points of held-out factory fingers that a hand pushes.

    twin generate finger --samples 60000 --seed 1 --out shapes/
    python -m tools.benchmarks.shape.band shapes/ [--fingers 30]

Prints the value for BAND_FACTOR in twin/shape/estimators/physics.py, and coverage by how wide the band is and how far the points
moved. The trained estimators find theirs when they are trained, on the same fingers. No simulated day plays a part.
"""

from pathlib import Path

import numpy as np
import tyro

from twin.prediction.twin import Twin
from twin.robots import load
from twin.shape.estimators.estimator import Z90, SensorReadings, twin_error
from twin.shape.estimators.physics import BAND_FACTOR, PhysicsEstimator
from twin.shape.training.samples import disturb, load_samples
from twin.shape.training_data.draw import CHAIN_LENGTH


def main(shapes: tyro.conf.Positional[Path], fingers: int = 30) -> None:
    """Print the band and its coverage, over so many fingers of each kind."""
    robot = load("finger")
    data, law, rng = load_samples(shapes, robot), PhysicsEstimator(Twin.of(robot)), np.random.default_rng(5)
    ratio, push, way = [], [], []
    for kind in ("pushed", "both"):
        rows = np.flatnonzero(data.held_out & (data.kind == kind))
        for chain in np.array_split(rows, len(rows) // CHAIN_LENGTH)[:fingers]:
            strain, displacement = disturb(rng, data, chain, dead=0.0)
            found = law.estimate(SensorReadings(strain, displacement))
            true = np.einsum("pn,bnc->bpc", data.point_weights, data.nodes[chain].reshape(len(chain), -1, 3))
            away = np.linalg.norm(found.displacements - true, axis=2)
            spread = np.sqrt(np.maximum(found.std**2 - twin_error(found.displacements) ** 2, 1e-14))
            ratio.append(away / spread)
            push.append(spread.mean(axis=1))
            way.append(np.linalg.norm(found.displacements, axis=2).mean(axis=1))
    ratios = np.concatenate(ratio)
    wanted, holds = BAND_FACTOR * np.quantile(ratios, 0.9) / Z90, 100 * (ratios < Z90).mean()
    print(f"BAND_FACTOR = {wanted:.2f} (now {BAND_FACTOR}); now it holds {holds:.1f} %")
    for words, sizes in (("std", np.concatenate(push)), ("displacement", np.concatenate(way))):
        part = np.digitize(sizes, np.quantile(sizes, [0.2, 0.4, 0.6, 0.8]))
        held = [f"{100 * (ratios[part == k] < Z90).mean():.0f} % at {1e3 * np.median(sizes[part == k]):.2g} mm" for k in range(5)]
        print(f"  by mean {words}: {', '.join(held)}")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
