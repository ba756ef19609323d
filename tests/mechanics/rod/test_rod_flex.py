"""The flex robot against the hinge chain: two formulations of one robot, in the plane."""

from __future__ import annotations

import numpy as np
import pytest

from tools.simulators.rod_flex import build, settle
from twin.body import Loads
from twin.prediction.kinematics import LoadedRobot
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")
VALUES = {p.name: p.value for p in ROBOT.parameters}


@pytest.mark.parametrize("gravity", [[0.0, 0.0, 0.0], [0.0, 0.0, 9.81], [-9.81, 0.0, 0.0]])
def test_flex_and_chain_are_one_robot(gravity: list[float]) -> None:
    """0-4 N. A discrete rod's moment exceeds EI kappa by phi^2 / 3 at 2 phi a vertex, 0.8 % at 4 N and 0.2 % at 2 N, of a tip that
    has moved by its own length; half of that again is the chain's and the edges' own error."""
    tension = np.linspace(0.0, 4.0, 9)
    flex = settle(build(ROBOT.structure, VALUES, np.array(gravity)), tension)
    chain = LoadedRobot(Twin(ROBOT), Loads(np.array(gravity)))
    for T, seen in zip(tension, flex, strict=True):
        off = np.linalg.norm(chain.pull(np.array([T, 0.0, 0.0])).tip - seen[-1])
        assert off < 0.12 * (0.003 if T <= 2.0 else 0.012)


def test_the_rod_keeps_its_length() -> None:
    flex = settle(build(ROBOT.structure, VALUES, np.zeros(3)), np.array([4.0]))[0]
    chords = np.linalg.norm(np.diff(np.vstack([np.zeros(3), flex]), axis=0), axis=1)
    bend = np.radians(145.0) / 8  # a disk interval at 4 N: chord / arc = sin(x / 2) / (x / 2)
    assert np.all(chords < 0.015 * 1.002)
    assert np.all(chords > 0.015 * np.sinc(bend / 2 / np.pi) * 0.995)
