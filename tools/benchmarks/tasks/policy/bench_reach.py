"""`twin/ContinuumReach-v0` on a robot of the virtual bench: the same actions, observations and noise, another robot behind them.

A policy brings the scales of its own twin (full pull, travel, length), as it would to a real bench. Goals are tips of this very
robot at rest, without friction and creep, under pulls drawn as the environment draws them and scaled by the described robot's full
pull: they are the same for every policy, and within reach.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import numpy as np

from tools.simulators.rod.effects import all_effects
from tools.simulators.rod.live import LiveRobot
from tools.simulators.rod.march import NoEquilibrium
from tools.simulators.rod.nuisance import built
from twin.env.continuum import ContinuumReach
from twin.env.plants.rod_plant import RodPlant, RodReadings
from twin.foundation.errors import SolveError
from twin.prediction.rollout import full_pull
from twin.prediction.twin import Twin


def robot_of(day: Path) -> LiveRobot:
    """The robot that a bench day was measured on. Raises ValueError for a day on a robot of another kind."""
    truth = json.loads((day / "truth.json").read_text("utf-8"))
    if truth["mismatch"] != "built":
        raise ValueError(f"{day}: its robot is {truth['mismatch']!r}; a day with --mismatch built is needed")
    seed, known = truth["seed"], all_effects()
    laws, effects = np.random.default_rng([seed, 3]), []
    for entry in truth["effects"]:
        drawn = known[entry["id"]].draw(laws)
        effects.append(type(drawn)(**{**vars(drawn), "strength": entry["parameters"]["strength"]}))
    return LiveRobot(built(np.random.default_rng([seed, 0])), effects)


class BenchPlant:
    """A live robot as an environment's plant."""

    def __init__(self, robot: LiveRobot, interval: float) -> None:
        self.robot, self.interval = robot, interval
        robot.rest()

    def step(self, command: np.ndarray) -> RodReadings:
        try:
            self.robot.pull(command, self.interval)
        except NoEquilibrium as fault:
            raise SolveError(str(fault)) from None
        return self.readings()

    def readings(self) -> RodReadings:
        robot = self.robot
        return RodReadings(robot.load_cells(), robot.displacement(), robot.markers(), robot.disks[-1])


class BenchReach(ContinuumReach):
    """`twin` is the policy's own, for its scales alone."""

    def __init__(self, robot: LiveRobot, twin: str | Path | Twin, **options: Any) -> None:
        super().__init__(twin, **options)
        self._robot, self._described = robot, full_pull(Twin.of("continuum"))

    def _draw_plant(self) -> RodPlant:
        return cast(RodPlant, BenchPlant(self._robot, self.interval))

    def _rest_tips(self, bend: np.ndarray, angle: np.ndarray) -> np.ndarray:
        F = self._described
        pulls = (bend[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])) @ F.towards.T
        return np.array([self._robot.rest_tip(np.maximum(pull, 0.0) * F.tension) for pull in pulls])
