"""`twin rollout`: simulate a twin under given or random controls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from twin.cli.terminal import cpu_count, out, show_progress
from twin.foundation.errors import DataError

if TYPE_CHECKING:
    from twin.measurements import Recording
    from twin.prediction.twin import Twin


@dataclass(frozen=True)
class Rollout:
    """Simulate a twin under given or random controls: MuJoCo steps, or static equilibria for a robot without dynamics.

    Writes a measurement set, which can be diagnosed. The same seed gives the same set for any number of workers.
    """

    twin: Positional[Annotated[str, arg(help="a twin.toml, a report's folder, a robot's name or the path to its folder")]]
    out: Annotated[Path, arg(help="new folder for the simulated set")]
    controls: Annotated[
        Path | None, arg(help="controls: the folder of a measurement set, or a CSV in SI (time, and each drive's channel)")
    ] = None
    random: Annotated[int | None, arg(help="instead of --controls: number of rollouts with random controls")] = None
    seed: Annotated[int, arg(help="seed of the controls and the noise")] = 0
    seconds: Annotated[float, arg(help="length of a random rollout, s")] = 10.0
    rate: Annotated[float, arg(help="samples a second of a random rollout")] = 50.0
    drive: Annotated[Literal["tension", "displacement"], arg(help="quantity of random controls")] = "tension"
    pull: Annotated[
        float | None, arg(help="largest random pull, N, m or a control's unit; default: a bend of about one radian, or ctrlrange")
    ] = None
    noise: Annotated[float, arg(help="standard deviation of the noise of the markers, m")] = 0.0
    dynamic: Annotated[bool | None, arg(help="MuJoCo steps or static equilibria; default: steps if the robot has dynamics")] = None
    jobs: Annotated[int, arg(help="worker threads")] = cpu_count()

    def run(self) -> None:
        from twin.measurements import write
        from twin.prediction.rollout import rollout
        from twin.prediction.twin_file.storage import read_twin, robot_reference

        twin = read_twin(self.twin)
        controls = self._controls(twin)
        with show_progress(f"rolling out {controls.title}") as progress:
            noisy = {"noise": self.noise, "seed": self.seed}
            made = rollout(twin, controls, dynamic=self.dynamic, jobs=self.jobs, progress=progress, **noisy)
            write(replace(made.recording, robot=robot_reference(twin.robot, self.out)), self.out)
        for one in made.lost:
            out.print(f"ended early: {one.why}", highlight=False, markup=False)
        out.print(f"{len(made.recording.trials)} rollouts ({made.recording.source}): {self.out}", highlight=False, markup=False)

    def _controls(self, twin: Twin) -> Recording:
        from twin.body import Drive
        from twin.measurements import read
        from twin.prediction.rollout import Drawing, controls_from_set, controls_from_table, draw_controls

        if (self.controls is None) == (self.random is None):
            raise DataError("the controls are missing: give either --controls FILE or --random N")
        if self.controls is None:
            return draw_controls(twin, self.random or 0, self.seed, Drawing(self.seconds, self.rate, Drive(self.drive), self.pull))
        if self.controls.is_dir():
            return controls_from_set(twin, read(self.controls, least_trials=1))
        return controls_from_table(twin, self.controls)
