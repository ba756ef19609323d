"""Small MJCFs and their trials, written for the closed forms that they have."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from twin.body import Drive, Loads, Problem, Route, Solution, Start
from twin.mechanics.mjcf import ModelBody
from twin.robots import Robot, load

PENDULUM = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <body name="rod">
      <inertial pos="0 0 -0.2" mass="0.5" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="hinge" axis="0 1 0"{joint}/>
      <site name="tip" pos="0 0 -0.2"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="hinge"/></actuator>
  {key}
</mujoco>"""

CAPSTAN = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <site name="winch" pos="-0.1 0 0"/>
    <site name="corner" pos="0 0 0"/>
    <body name="slider" pos="0 0 -0.1">
      <inertial pos="0 0 0" mass="0.2" diaginertia="1e-5 1e-5 1e-5"/>
      <joint name="slide" type="slide" axis="0 0 1" stiffness="200" damping="4"/>
      <site name="end"/>
    </body>
  </worldbody>
  <tendon><spatial name="cord"><site site="winch"/><site site="corner"/><site site="end"/></spatial></tendon>
  <actuator><motor name="pull" tendon="cord" gear="-1"/></actuator>
</mujoco>"""

TOML = """
format = "twin-robot/1"
family = "mjcf"
title = "made for a test"
accuracy = {{ value = 0.1, unit = "mm", source = "made" }}
[structure]
model = "model.xml"
timestep = {step}
{parameters}
"""


def robot(folder: Path, model: str, parameters: str = "", step: float = 1e-3) -> Robot:
    """The robot of a model, written to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.xml").write_text(model)
    (folder / "robot.toml").write_text(TOML.format(step=step, parameters=parameters))
    return load(str(folder))


def solved(robot: Robot, time: np.ndarray, command: np.ndarray, route: Route | None = None, **how: object) -> Solution:
    """A trial of controls (n, nu) at `time` (n,) s; `how` are values, loads, start."""
    body = robot.build(how.get("values", {}))  # type: ignore[arg-type]
    assert isinstance(body, ModelBody)
    loads = how.get("loads", Loads(robot.gravity))
    problem = Problem(
        time,
        command,
        loads,
        route or Route(),
        (Drive.CONTROL,) * command.shape[1],
        start=how.get("start", Start()),  # type: ignore[arg-type]
    )
    return robot.solver(body).solve(problem)
