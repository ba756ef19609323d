"""`twin generate`: simulate shapes of a soft finger to train estimators."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.terminal import cpu_count, out, show_progress


@dataclass(frozen=True)
class Generate:
    """Simulate shapes of a soft finger under random tendon commands and random hands, to train estimators.

    Writes Parquet shards, equal for any number of jobs. Run again to continue after a stop.
    """

    twin: Positional[Annotated[str, arg(help="a robot's name, or a twin.toml, around whose parameters fingers are drawn")]]
    samples: Annotated[int, arg(help="number of shapes")]
    out: Annotated[Path, arg(help="folder for the shards")]
    jobs: Annotated[int, arg(help="worker processes")] = cpu_count()
    seed: Annotated[int, arg(help="seed of all random draws")] = 0
    vary: Annotated[tuple[str, ...], arg(help="further differences between fingers, such as 'tendons.azimuth = 2 deg'")] = ()

    def run(self) -> None:
        from twin.shape.training_data import GenerationOrder, bytes_needed, generate_shards, parse_spreads, uncertain_parameters

        robot, drawn = uncertain_parameters(self.twin)
        also = {p.name: p for p in (*drawn, *parse_spreads(robot, self.vary))}
        drawn = tuple(also.values())
        out.print(
            f"{self.samples} samples take about {bytes_needed(self.samples) / 1e6:.0f} MB in {self.out}",
            highlight=False,
            markup=False,
        )
        with show_progress(f"shapes of {robot.name}") as progress:
            lost = generate_shards(
                GenerationOrder(robot, self.samples, self.seed, drawn), self.out, self.jobs,
                lambda done, rate: progress(f"{done} of {self.samples}, {rate:.0f} a second"),
            )  # fmt: skip
        out.print(f"shapes: {self.out}; without an equilibrium: {lost} of {self.samples}", highlight=False, markup=False)
