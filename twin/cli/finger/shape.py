"""`twin shape`: estimate a finger's shape from its strain sensors."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.sources import load_finger_set
from twin.cli.terminal import out, printable, show_progress


@dataclass(frozen=True)
class Shape:
    """Estimate a soft finger's shape from its strain sensors and tendon displacements, with its standard deviation.

    Writes NAME_time, NAME_vertices, NAME_std, NAME_outside and NAME_cloud of every trial, in metres. Notes say how many frames are
    outside the training, and whether the twin was never aligned or is of another finger.
    """

    twin: Annotated[str, arg(help="an aligned twin: its folder or twin.toml, or a robot's name")]
    out: Annotated[Path, arg(help="the npz file to write")]
    set: Positional[Annotated[Path | None, arg(help="folder of a measurement set; default: the bundled day")]] = None
    estimator: Annotated[str, arg(help="name of the estimator; an unknown name lists those available")] = "modal"

    def run(self) -> None:
        from twin.shape.alignment.report import read_band_widening
        from twin.shape.estimators.estimator import estimator_class
        from twin.shape.predict import predict_shapes, write_shapes

        chosen = estimator_class(self.estimator)
        recording, twin = load_finger_set(self.set, self.twin)
        with show_progress(f"shapes of {recording.title}"):
            arrays, notices = predict_shapes(recording, chosen(twin), read_band_widening(self.twin))
            write_shapes(self.out, arrays)
        for notice in notices:
            out.print(f"note: {printable(notice)}", highlight=False, markup=False)
        out.print(f"shapes: {self.out}", highlight=False, markup=False)
