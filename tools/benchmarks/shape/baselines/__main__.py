"""Train a baseline: python -m tools.benchmarks.shape.baselines folding --data shapes/ --epochs 30 --out folding.npz"""

import tyro

import tools.benchmarks.shape.baselines  # noqa: F401  # adds the baselines to the estimators
from twin.cli.finger.train import Train

if __name__ == "__main__":
    tyro.cli(Train).run()
