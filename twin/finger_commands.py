"""Commands of soft fingers: `twin generate`, `train`, `align`, `shape`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from twin.errors import DataError
from twin.terminal import command_line, cores, out, plain, working


@dataclass(frozen=True)
class Generate:
    """Make shapes of a soft finger under random tendon commands and random hands, for what is learned from them.

    Parquet shards in a folder; the same whatever the number of jobs; run again to go on after a stop.
    """

    twin: Positional[Annotated[str, arg(help="a robot's name, or a twin.toml, whose numbers are then drawn around")]]
    samples: Annotated[int, arg(help="how many shapes")]
    out: Annotated[Path, arg(help="folder for the shards")]
    jobs: Annotated[int, arg(help="worker processes")] = cores()
    seed: Annotated[int, arg(help="draws everything")] = 0
    vary: Annotated[tuple[str, ...], arg(help="what else differs between fingers, as 'tendons.azimuth = 2 deg'")] = ()

    def run(self) -> None:
        from twin.factory import Order, doubts, generate, need, varied

        robot, drawn = doubts(self.twin)
        also = {p.name: p for p in (*drawn, *varied(robot, self.vary))}
        drawn = tuple(also.values())
        out.print(
            f"{self.samples} samples take about {need(self.samples) / 1e6:.0f} MB in {self.out}", highlight=False, markup=False
        )
        with working(f"shapes of {robot.name}") as progress:
            lost = generate(
                Order(robot, self.samples, self.seed, drawn), self.out, self.jobs,
                lambda done, rate: progress(f"{done} of {self.samples}, {rate:.0f} a second"),
            )  # fmt: skip
        out.print(f"shapes: {self.out}; without an equilibrium: {lost} of {self.samples}", highlight=False, markup=False)


@dataclass(frozen=True)
class Train:
    """Train an estimator of a finger's shape on shapes that `twin generate` made. Needs torch (extra `learn`).

    Writes the weights and, beside them, a card (.json). After a stop the same command goes on from the last whole epoch.
    """

    estimator: Positional[Annotated[str, arg(help="which estimator; a wrong name lists those there are")]]
    data: Annotated[Path, arg(help="folder of shards")]
    out: Annotated[Path, arg(help="the weights to write; they ship beside a robot's robot.toml as ESTIMATOR.npz")]
    robot: Annotated[str, arg(help="a robot's name or the path to its folder")] = "finger"
    epochs: Annotated[int, arg(help="passes over the data, at most")] = 100
    seed: Annotated[int, arg(help="draws first weights, batches and noise")] = 0

    def run(self) -> None:
        from twin.robots import load
        from twin.shape.training import Way, digest, write_trained

        way = Way(self.estimator, digest(self.data), self.epochs, self.seed)
        with working(f"training {self.estimator} on {self.data}") as progress:
            card = write_trained(way, load(self.robot), self.data, self.out, progress)
        out.print(f"weights: {self.out}; error on held-out fingers {card['held_out_mm']:.2f} mm", highlight=False, markup=False)


@dataclass(frozen=True)
class Align:
    """Align a soft finger's twin to a built one from the clouds of a set: mounting angle, R0 and kappa of its strain sensors.

    Writes twin.toml, alignment.json and alignment.txt.
    """

    set: Positional[Annotated[Path, arg(help="folder of a measurement set with clouds, one trial of them without a hand")]]
    out: Annotated[Path, arg(help="folder for the aligned twin")]
    twin: Annotated[str | None, arg(help="where to start: a twin.toml or a robot's name; default: the robot the set names")] = None

    def run(self) -> None:
        from twin import report
        from twin.diagnose import Settings
        from twin.shape.align_report import lines, write_alignment

        recording, twin = _fingers(self.set, self.twin)
        from twin.shape.align import align

        if self.out.exists() and not self.out.is_dir():
            raise DataError(f"{self.out} is a file; give a folder for the aligned twin with --out")
        with working(f"aligning to {recording.title}") as progress:
            aligned = align(recording, twin, progress)
            write_alignment(aligned, self.out, report.provenance(recording, Settings(), command_line()))
        out.print("\n".join(lines(aligned)), highlight=False, markup=False)
        out.print(f"twin: {self.out / 'twin.toml'}", highlight=False, markup=False)


@dataclass(frozen=True)
class Shape:
    """Estimate a soft finger's shape from its strain sensors and tendon displacements, with an error bar.

    Writes NAME_time, NAME_vertices, NAME_std, NAME_outside and NAME_cloud of every trial, in metres.
    """

    set: Positional[Annotated[Path, arg(help="folder of a measurement set")]]
    twin: Annotated[str, arg(help="an aligned twin: its folder or twin.toml, or a robot's name")]
    out: Annotated[Path, arg(help="the npz file to write")]
    estimator: Annotated[str, arg(help="which estimator; a wrong name lists those there are")] = "modal"

    def run(self) -> None:
        from twin.shape.align_report import bands_of
        from twin.shape.estimator import estimator
        from twin.shape.predict import predict, write

        law = estimator(self.estimator)
        recording, twin = _fingers(self.set, self.twin)
        with working(f"shapes of {recording.title}"):
            arrays, notices = predict(recording, law(twin), bands_of(self.twin))
            write(self.out, arrays)
        for notice in notices:
            out.print(f"note: {plain(notice)}", highlight=False, markup=False)
        out.print(f"shapes: {self.out}", highlight=False, markup=False)


def _fingers(folder: Path, twin: str | None) -> tuple[Any, Any]:
    """The recording, one trial or more, and the twin to read it with, which must be of its robot."""
    from twin.measurements import read
    from twin.robots import load
    from twin.storage import read_twin
    from twin.twin import Twin

    recording = read(folder, least_trials=1)
    robot = load(recording.robot, recording.folder)
    found = read_twin(twin) if twin else Twin.of(robot)
    if found.robot.name != robot.name:
        raise DataError(f"{folder} is of robot {robot.name!r}, the twin of {found.robot.name!r}; give the twin of the set's robot")
    return recording, found
