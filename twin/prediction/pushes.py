"""Input tensions below zero: the noise or zero offset of a load cell, or a push, of which rods alone are capable."""

import numpy as np

from twin.body import Body
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.robots import Robot, load_family

# How far below zero an input tension of a tendon that cannot push may read: sigmas of its noise, an offset of a load cell (N), or a
# share of the trial's largest reading; the widest of these counts. An offset is data that the diagnosis can name (load_cell_bias).
MAX_SLACK_SIGMAS, ZERO_OFFSET, ZERO_OFFSET_SHARE = 5.0, 0.3, 0.05  # -, N, -
USUAL_NOISE = 0.01  # N
RODS_KEY = "rods"  # of [structure]


def check_pushes(recording: Recording, robot: Robot, body: Body) -> list[str]:
    """Return notices of input tensions that fall below zero by more than noise. Raise DataError, naming the cell, for a push.

    Rods may push.
    """
    notices = []
    for channel in recording.inputs():
        if channel.kind != "tendon_tension" or body.pushes:
            continue
        for trial in recording.trials:
            _refuse_push(recording, trial, channel, robot)
        lowest = min(float(np.nan_to_num(t.values[channel.name]).min()) for t in recording.trials)
        if lowest < -MAX_SLACK_SIGMAS * (channel.noise or USUAL_NOISE):
            notices.append(f"input {channel.name} falls to {lowest:.3g} N, below what its noise explains: a zero offset?")
    return notices


def _refuse_push(recording: Recording, trial: Trial, channel: Channel, robot: Robot) -> None:
    """Raise DataError where a tendon that cannot push does."""
    tension = trial.values[channel.name]
    slack = max(MAX_SLACK_SIGMAS * (channel.noise or 0.0), ZERO_OFFSET, ZERO_OFFSET_SHARE * np.nan_to_num(tension).max())
    below = np.flatnonzero(tension < -slack)
    if not len(below):
        return
    at = int(below[0])
    file = recording.folder / trial.name if recording.folder else trial.name
    row = at + (1 if str(file).lower().endswith(".parquet") else 2)  # a CSV's header is its first
    read = float(f"{channel.scale.from_si(tension[at : at + 1])[0]:.12g}")  # as written: units change the last digits
    ways, robot_file = ["correct the sign", "declare it `missing`"], robot.folder / "robot.toml"
    if RODS_KEY in load_family(robot.family).SCHEMA.structure.model_fields:
        ways.append(f"where the tendons are rods, which push, write {RODS_KEY} = true in [structure] of {robot_file}")
    raise DataError(
        f"{file}, row {row}, column {channel.name}: {read!r} {channel.unit}, a tendon cannot push (down to {-slack:.3g} N passes "
        f"as noise or zero offset); {', or '.join(ways)}"
    )
