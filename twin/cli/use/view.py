"""`twin view`: show a robot, a replay or trials of a task in a browser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from twin.cli.sources import load_set_and_twin
from twin.cli.terminal import out, show_progress
from twin.foundation.errors import DataError

if TYPE_CHECKING:
    from twin.measurements import Recording
    from twin.prediction.twin import Twin
    from twin.viewer.panel import MakePanel


@dataclass(frozen=True)
class View:
    """Show a robot in a browser.

    Under sliders, replaying a measurement set beside the prediction, or in recorded trials of a hand's tasks.
    """

    what: Positional[
        Annotated[
            tuple[str, ...],
            arg(
                help="a robot, a twin.toml or a report's folder, or two of these side by side; a measurement set to replay; or a "
                "folder made by twin demonstrate; default: the bundled sample"
            ),
        ]
    ] = ()
    port: Annotated[int, arg(help="port to serve on; if it is taken, the next free one")] = 8080
    host: Annotated[str, arg(help="address to serve on; any but 127.0.0.1 lets others on the network look and move things")] = (
        "127.0.0.1"
    )
    film: Annotated[Path | None, arg(help="write a GIF of the replay to this file, drawn by headless Chromium, and end")] = None
    trial: Annotated[str | None, arg(help="trial of the film, or of a task to show first; default: the first")] = None
    speed: Annotated[float, arg(help="speed of the film, times real time")] = 1.0

    def run(self) -> None:
        if self.film is None:
            self._serve()
        else:
            self._take_film(self.film)

    def _serve(self) -> None:
        from twin.viewer import serve
        from twin.viewer.address import free_port, opening_words

        free_port(self.host, self.port)  # before the work of reading and drawing
        name, make, _ = self._task_panel() or self._twin_panel()

        def announce(port: int) -> None:
            for line in opening_words(self.host, port):
                out.print(line, highlight=False, markup=False, soft_wrap=True)

        serve(make, name, self.host, self.port, announce)

    def _take_film(self, path: Path) -> None:
        from twin.viewer import take_film

        _, make, trial = self._task_panel() or self._twin_panel()
        if not self.speed > 0.0:
            raise DataError(f"--speed {self.speed:g}: the speed of a film must be above 0")
        if not path.absolute().parent.is_dir():
            raise DataError(f"{path.absolute().parent} is no folder; make it, or give another file with --film")
        with show_progress("taking a film") as progress:
            take_film(make, trial, self.speed, path, progress)
        out.print(f"film: {path}", highlight=False, markup=False)

    def _task_panel(self) -> tuple[str, MakePanel, str | None] | None:
        """Return a name, the panel of recorded task trials, and None, as the panel shows the trial; None without such a folder."""
        folders = [Path(w) for w in self.what if _holds_task_trials(Path(w))]
        if not folders:
            return None
        if len(self.what) > 1:
            raise DataError(f"{' and '.join(self.what)}: trials of tasks cannot be combined with anything else; give one folder")
        if self.trial is not None and not self.trial.isdecimal():
            raise DataError(f"--trial {self.trial}: trials of tasks have numbers, from 0 on")
        from twin.viewer import TaskPanel

        number = None if self.trial is None else int(self.trial)
        return folders[0].name, lambda server: TaskPanel(server, folders[0], number), None

    def _twin_panel(self) -> tuple[str, MakePanel, str | None]:
        """Return the name, the panel of twins, and the trial of the film."""
        from twin.viewer import TwinPanel

        twins, recording = self._load_twins()
        if self.film is not None and recording is None:
            raise DataError("a film shows a replay: give a measurement set as well")
        return twins[0][1].robot.name, lambda server: TwinPanel(server, twins, recording), self.trial

    def _load_twins(self) -> tuple[list[tuple[str, Twin]], Recording | None]:
        """Return the twins by name, and the set to replay with them."""
        from twin.prediction.twin_file.storage import read_twin

        sets = [w for w in self.what if (Path(w) / "measurements.toml").is_file()]
        named = [w for w in self.what if w not in sets]
        if len(sets) > 1 or len(named) > 2:
            raise DataError(f"{len(named)} twins and {len(sets)} sets were given; give at most two twins and one set")
        if not sets and named:
            return [(Path(w).name, read_twin(w)) for w in named], None
        recording, first = load_set_and_twin(Path(sets[0]) if sets else None, named[0] if named else None)
        names = [Path(w).name for w in named] or [first.robot.name]
        return list(zip(names, [first, *(read_twin(w) for w in named[1:])], strict=True)), recording


def _holds_task_trials(folder: Path) -> bool:
    """Return whether the folder holds demonstrations or trials of tasks, or is one set of such trials."""
    from twin.tasks.imitation.demonstrate import ATTEMPTS_FILE
    from twin.tasks.imitation.episode_store import EPISODES_FOLDER

    one = folder.is_dir() and folder.resolve().parent.name == EPISODES_FOLDER
    return one or (folder / ATTEMPTS_FILE).is_file() or (folder / EPISODES_FOLDER).is_dir()
