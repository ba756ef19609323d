"""`twin train`: train an estimator of a finger's shape."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.terminal import out, show_progress


@dataclass(frozen=True)
class Train:
    """Train an estimator of a finger's shape on shapes from `twin generate`. Needs torch (extra `learn`).

    Writes the weights and a description (.json) beside them. After a stop the same command continues from the last whole epoch.
    """

    estimator: Positional[Annotated[str, arg(help="name of the estimator; an unknown name lists those available")]]
    data: Annotated[Path, arg(help="folder of shards")]
    out: Annotated[Path, arg(help="the weights to write; twin shape reads ESTIMATOR.npz beside the robot.toml")]
    robot: Annotated[str, arg(help="a robot's name or the path to its folder")] = "finger"
    epochs: Annotated[int, arg(help="most passes over the data")] = 100
    seed: Annotated[int, arg(help="seed of initial weights, batches and noise")] = 0

    def run(self) -> None:
        from twin.robots import load
        from twin.shape.training.train import TrainingConfig, hash_shards, train_and_write

        way = TrainingConfig(self.estimator, hash_shards(self.data), self.epochs, self.seed)
        with show_progress(f"training {self.estimator} on {self.data}") as progress:
            card = train_and_write(way, load(self.robot), self.data, self.out, progress)
        out.print(f"weights: {self.out}; error on held-out fingers {card['held_out_mm']:.2f} mm", highlight=False, markup=False)
