"""`twin simulate`: write a twin's prediction of a set as a measurement set."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from twin.cli.terminal import out, show_progress


@dataclass(frozen=True)
class Simulate:
    """Predict the trials of a measurement set and write the prediction as a new set."""

    twin: Positional[Annotated[str, arg(help="a twin.toml, a report's folder, a robot's name or the path to its folder")]]
    set: Positional[Annotated[Path, arg(help="folder of the measurement set whose inputs drive the twin")]]
    out: Annotated[Path, arg(help="new folder for the simulated set")]
    dynamic: Annotated[bool | None, arg(help="MuJoCo steps, or static equilibria; default: by the rates in the set")] = None

    def run(self) -> None:
        from twin.measurements import read, write
        from twin.prediction.twin_file.storage import read_twin, robot_reference

        twin = read_twin(self.twin)
        recording = read(self.set, least_trials=1)
        with show_progress(f"simulating {recording.title}"):
            predicted = twin.predict(recording, dynamic=self.dynamic)
            write(replace(predicted, robot=robot_reference(twin.robot, self.out)), self.out)
        out.print(f"simulated set: {self.out}", highlight=False, markup=False)
