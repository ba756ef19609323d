"""Runs a trial on a built robot with its faults and gives what perfect instruments would log, channel by channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tools.simulators.articulated.dynamics import SETTLE, STEP, march, rest_state
from tools.simulators.articulated.effects import Columns, Effect
from tools.simulators.articulated.plant import plant
from tools.simulators.articulated.robots import Drive, Robot, Winch

DECIMALS = 4  # of a logged command


@dataclass(frozen=True)
class Trial:
    """A log: its commands (rows, drives) in SI at `rate` Hz, the payload in kg, its start in s of the session."""

    name: str
    command: np.ndarray
    rate: int
    payload: float = 0.0
    start: float = 0.0

    @property
    def time(self) -> np.ndarray:
        """Seconds from the log's start."""
        return np.arange(len(self.command)) / self.rate


@dataclass(frozen=True)
class Channel:
    """One output column: what it is, which instrument reads it and with what it shares a floor."""

    name: str
    quantity: str
    instrument: str
    kind: str


def channels(robot: Robot, camera: bool) -> list[Channel]:
    """Return the output columns of a robot in the order in which they are written."""
    found = [Channel(f"{w.target}_motor", f"actuator.{w.name}.position", "motor", "motor") for w in robot.winches]
    if robot.force == "tension":
        found += [Channel(f"{w.target}_tension", f"tendon.{w.target}.tension", "tension", "tension") for w in robot.winches]
    else:
        found += [Channel(f"{w.target}_force", f"actuator.{w.name}.force", "tension", "force") for w in robot.winches]
    found += [Channel(f"{joint}_angle", f"joint.{joint}.position", "angle", "angle") for joint in robot.encoders]
    found += [Channel(f"{s.target}_torque", f"actuator.{s.name}.force", "torque", "torque") for s in robot.servos]
    if camera:
        found += [Channel(f"{robot.tip}_{axis}", f"site.{robot.tip}.{axis}", "tip", robot.tip) for axis in "xyz"]
    return found


def command_unit(drive: Drive) -> tuple[str, float]:
    """Return the unit in which a command is logged and how many make one SI unit."""
    return ("mm", 1e3) if isinstance(drive, Winch) else ("deg", 180.0 / np.pi)


def observe(robot: Robot, effects: Sequence[Effect], trial: Trial, step: float = STEP) -> Columns:
    """Integrate a trial and return every output without noise, in its instrument's unit."""
    made = plant(robot, trial.payload)
    for effect in effects:
        made = effect.on_plant(made, trial.start)
    start = np.array([joint.start for joint in robot.joints])
    rows = march(made, rest_state(made, start, trial.command[0]), trial.command, 1.0 / trial.rate, SETTLE, step)
    if not np.all(np.isfinite(rows)):
        raise ArithmeticError(f"{robot.name}, trial {trial.name}: the integration diverged; ask for a weaker effect")
    n, t = len(robot.joints), len(robot.winches)
    columns: Columns = {}
    for i, winch in enumerate(robot.winches):
        columns[f"{winch.target}_motor"] = rows[:, 2 * n + 2 + t + i]
        pull = rows[:, 2 * n + 2 + i]
        columns[f"{winch.target}_{robot.force}"] = pull if robot.force == "tension" else -pull
    columns |= {f"{name}_angle": rows[:, robot.joint(name)] for name in robot.encoders}
    columns |= {f"{s.target}_torque": rows[:, n + robot.joint(s.target)] for s in robot.servos}
    for axis, values in zip("xyz", (rows[:, 2 * n], np.zeros(len(rows)), rows[:, 2 * n + 1]), strict=True):
        columns[f"{robot.tip}_{axis}"] = values
    for channel in channels(robot, camera=True):
        columns[channel.name] = columns[channel.name] * robot.instruments[channel.instrument].scale
    for effect in effects:
        columns = effect.on_columns(columns, trial.start + trial.time)
    return columns
