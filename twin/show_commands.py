"""Commands that put a twin to use: roll it out, look at it; and the set and twin that a command is given."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from twin.errors import DataError
from twin.terminal import cores, out, working

if TYPE_CHECKING:
    from twin.measurements import Recording
    from twin.twin import Twin
    from twin.viewer.panel import Make

SAMPLE = "*/samples/friday"


@dataclass(frozen=True)
class Rollout:
    """Roll a twin out under given or drawn controls: MuJoCo steps, or static equilibria for a robot without dynamics.

    Writes a measurement set, which can be diagnosed again. The same seed gives the same set, whatever the number of workers.
    """

    twin: Positional[Annotated[str, arg(help="a twin.toml, a report's folder, a robot's name or the path to its folder")]]
    out: Annotated[Path, arg(help="new folder for the rolled-out set")]
    controls: Annotated[
        Path | None, arg(help="what drives: the folder of a measurement set, or a CSV in SI (time, tendon_1_tension, ...)")
    ] = None
    random: Annotated[int | None, arg(help="instead: how many rollouts of drawn controls")] = None
    seed: Annotated[int, arg(help="draws the controls and the noise")] = 0
    seconds: Annotated[float, arg(help="length of a drawn rollout")] = 10.0
    rate: Annotated[float, arg(help="samples a second of a drawn rollout")] = 50.0
    drive: Annotated[Literal["tension", "displacement"], arg(help="what drawn controls say of each tendon")] = "tension"
    pull: Annotated[float | None, arg(help="the most drawn, N or m; default: what bends the robot by some one radian")] = None
    noise: Annotated[float, arg(help="one standard deviation of noise on the markers, m")] = 0.0
    dynamic: Annotated[bool | None, arg(help="MuJoCo steps or static equilibria; default: steps where the robot has them")] = None
    jobs: Annotated[int, arg(help="worker threads")] = cores()

    def run(self) -> None:
        from twin.measurements import write
        from twin.rollout import rollout
        from twin.storage import read_twin, robot_reference

        twin = read_twin(self.twin)
        controls = self._controls(twin)
        with working(f"rolling out {controls.title}") as progress:
            noisy = {"noise": self.noise, "seed": self.seed}
            made = rollout(twin, controls, dynamic=self.dynamic, jobs=self.jobs, progress=progress, **noisy)
            write(replace(made.recording, robot=robot_reference(twin.robot, self.out)), self.out)
        for one in made.ended:
            out.print(f"ended early: {one.why}", highlight=False, markup=False)
        out.print(f"{len(made.recording.trials)} rollouts ({made.recording.source}): {self.out}", highlight=False, markup=False)

    def _controls(self, twin: Twin) -> Recording:
        from twin.effects import Drive
        from twin.measurements import read
        from twin.rollout import Drawing, drawn, from_set, from_table

        if (self.controls is None) == (self.random is None):
            raise DataError("say what drives the rollouts: either --controls FILE or --random N")
        if self.controls is None:
            return drawn(twin, self.random or 0, self.seed, Drawing(self.seconds, self.rate, Drive(self.drive), self.pull))
        if self.controls.is_dir():
            return from_set(twin, read(self.controls, least_trials=1))
        return from_table(twin, self.controls)


@dataclass(frozen=True)
class View:
    """Look at a robot in a browser: under sliders, or as it moved in a measurement set, beside what was measured; or at the trials
    of a hand's tasks, of persons and of policies."""

    what: Positional[
        Annotated[
            tuple[str, ...],
            arg(
                help="a robot, twin.toml or report's folder, or two side by side; a measurement set; default: the bundled sample; "
                "or a folder that twin demonstrate made"
            ),
        ]
    ] = ()
    port: Annotated[int, arg(help="where to serve on 127.0.0.1; the next one that is free if it is taken")] = 8080
    film: Annotated[Path | None, arg(help="write a GIF of the set's replay here, drawn by Chromium unseen, and end")] = None
    trial: Annotated[str | None, arg(help="which trial the film is of, or of a task is shown; default: the first")] = None
    speed: Annotated[float, arg(help="trial seconds a second, of the film")] = 1.0

    def run(self) -> None:
        from twin.viewer import serve, take_film

        name, make, trial = self._of_tasks() or self._of_twins()
        if self.film is None:
            with working(f"drawing {name}"):
                pass
            serve(make, name, self.port, lambda address: out.print(f"open {address} (Ctrl-C ends it)", highlight=False))
            return
        if not self.speed > 0.0:
            raise DataError(f"--speed {self.speed:g}: a film needs one above 0")
        if not self.film.absolute().parent.is_dir():
            raise DataError(f"{self.film.absolute().parent} is no folder; make it, or give another file with --film")
        with working("taking a film") as progress:
            take_film(make, trial, self.speed, self.film, progress)
        out.print(f"wrote {self.film}", highlight=False, markup=False)

    def _of_tasks(self) -> tuple[str, Make, str | None] | None:
        """A name, the panel of trials that were kept, and the trial a film is of where it is not the panel's; None where no such
        folder is given."""
        folders = [Path(w) for w in self.what if _holds_trials(Path(w))]
        if not folders:
            return None
        if len(self.what) > 1:
            raise DataError(f"{' and '.join(self.what)}: trials of tasks are shown alone; give one folder")
        if self.trial is not None and not self.trial.isdecimal():
            raise DataError(f"--trial {self.trial}: trials of tasks have numbers, from 0 on")
        from twin.viewer import Trials

        number = None if self.trial is None else int(self.trial)
        return folders[0].name, lambda server: Trials(server, folders[0], number), None

    def _of_twins(self) -> tuple[str, Make, str | None]:
        """As above, of twins."""
        from twin.viewer import App

        twins, recording = self._shown()
        if self.film is not None and recording is None:
            raise DataError("a film is of a replay: give a measurement set as well")
        return twins[0][1].robot.name, lambda server: App(server, twins, recording), self.trial

    def _shown(self) -> tuple[list[tuple[str, Twin]], Recording | None]:
        """The twins by name, and the set to replay with them."""
        from twin.storage import read_twin

        sets = [w for w in self.what if (Path(w) / "measurements.toml").is_file()]
        named = [w for w in self.what if w not in sets]
        if len(sets) > 1 or len(named) > 2:
            raise DataError(f"{len(named)} twins and {len(sets)} sets were given; at most two twins and one set are shown")
        if not sets and named:
            return [(Path(w).name, read_twin(w)) for w in named], None
        recording, first = loaded(Path(sets[0]) if sets else None, named[0] if named else None)
        names = [Path(w).name for w in named] or [first.robot.name]
        return list(zip(names, [first, *(read_twin(w) for w in named[1:])], strict=True)), recording


def _holds_trials(folder: Path) -> bool:
    """Whether tasks were shown or done there, or it is one set of their trials."""
    from twin.learn.demonstrate import ATTEMPTS
    from twin.learn.kept import FOLDER

    one = folder.is_dir() and folder.resolve().parent.name == FOLDER
    return one or (folder / ATTEMPTS).is_file() or (folder / FOLDER).is_dir()


def loaded(folder: Path | None, twin: str | None) -> tuple[Any, Any]:
    """The recording (the bundled sample if no folder is given) and the twin to hold against it."""
    from twin.measurements import read
    from twin.robots import load
    from twin.robots.robot import models_folder
    from twin.storage import read_twin
    from twin.twin import Twin

    if folder is None:
        folder = next(models_folder().glob(SAMPLE))
        out.print("no measurement set given: diagnosing the bundled sample (a simulated bench day, see its `source`)")
    recording = read(folder)
    return recording, read_twin(twin) if twin else Twin.of(load(recording.robot, recording.folder))
