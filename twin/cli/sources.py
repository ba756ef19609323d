"""Load the measurement set and the twin of a command."""

from pathlib import Path
from typing import Any

from twin.cli.terminal import out
from twin.foundation.errors import DataError


def load_set_and_twin(folder: Path | None, twin: str | None) -> tuple[Any, Any]:
    """Return the recording, by default the bundled sample, and the twin to compare with it."""
    from twin.measurements import read
    from twin.prediction.twin import Twin
    from twin.prediction.twin_file.storage import read_twin
    from twin.robots import sample

    if folder is None:
        folder = sample("friday")
        out.print("no measurement set given: using the bundled sample (simulated, see its `source`)")
    recording = read(folder)
    return recording, read_twin(twin) if twin else Twin.of_recording(recording)


def load_finger_set(folder: Path | None, twin: str | None) -> tuple[Any, Any]:
    """Return the recording, by default the bundled day with clouds, of one trial or more, and a twin of its robot.

    Raises DataError for a twin of another robot.
    """
    from twin.measurements import read
    from twin.prediction.twin import Twin
    from twin.prediction.twin_file.storage import read_twin
    from twin.robots import load, sample

    if folder is None:
        folder = sample("monday")
        out.print("no measurement set given: using the bundled day with clouds (simulated, see its `source`)")
    recording = read(folder, least_trials=1)
    robot = load(recording.robot, recording.folder)
    found = read_twin(twin) if twin else Twin.of(robot)
    if found.robot.name != robot.name:
        raise DataError(f"{folder} is of robot {robot.name!r}, the twin of {found.robot.name!r}; give the twin of the set's robot")
    return recording, found
