"""The report of an MJCF: controls go by the names of their columns, with their units, and experiments begin where they rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.mechanics.mjcf.models import PENDULUM, robot
from twin.diagnosis.explain.next_experiment import menu
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import PreparedRecording, prepare
from twin.report.plots.variables import variables

SERVO = PENDULUM.format(joint=' damping="0.02"', key="").replace("<motor ", '<position kp="8" ')


def day(folder: Path) -> PreparedRecording:
    """A servo that rests at 0.5 rad and goes from there to -0.3 rad at most."""
    made = robot(folder, SERVO)
    time = 0.02 * np.arange(51)
    command = 0.5 - 0.8 * np.sin(np.pi * time) ** 2
    channels = (
        Channel("cmd", "input", "rad", quantity="actuator.push.ctrl"), Channel("joint.hinge.position", "output", "deg", 1e-3),
    )  # fmt: skip
    trials = tuple(Trial(f"{k}.csv", time, {"cmd": command, "joint.hinge.position": command}, start=9.0 * k) for k in range(2))
    return prepare(Recording(str(folder), "made", "simulation", None, channels, trials), made)


def test_axes_name_the_control_and_its_unit(tmp_path: Path) -> None:
    drawn = list(variables(day(tmp_path)))
    titles = {kind: v.title for kind, v in drawn}
    assert (titles["loop"], titles["rate"]) == ("cmd (rad)", "rate of cmd (rad/s)")
    assert next(v.selection for kind, v in drawn if kind == "loop") == "in which cmd moves most"


def test_experiments_begin_where_the_control_rests_and_stay_within_what_was_commanded(tmp_path: Path) -> None:
    trials = menu(day(tmp_path))
    words = [label for label, _ in trials]
    assert any(label.startswith("move cmd to -0.3 rad and release it, slowly") for label in words), words
    for label, inputs in trials:
        assert inputs.command[0, 0] == 0.5, label
        assert -0.3 - 1e-12 <= inputs.command.min() <= inputs.command.max() <= 0.5 + 1e-12, label
        assert not inputs.smooth
