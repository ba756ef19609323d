"""Headings that walk while nothing tilts are told; those of a body that still moves, or that turns as it tilts, are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from twin.diagnosis.checks.suspicions import headings
from twin.diagnosis.checks.suspicions.case import Case, Suspicion
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")
PULLS = tuple(Channel(f"tendon_{i}_tension", "input", "N", 0.01) for i in (1, 2, 3))
ANGLES = tuple(Channel(f"disk_8_{a}", "output", "deg", np.radians(0.2)) for a in ("roll", "pitch", "yaw"))
QUATERNION = tuple(Channel(f"disk_8_{a}", "output", "1", 1e-3) for a in ("qw", "qx", "qy", "qz"))
TIME = np.arange(160) * 0.1
PLATEAU = np.repeat([0.0, 0.6, 0.2, 0.9], 40)  # N


def found(
    heading: np.ndarray, sag: np.ndarray, channels: tuple[Channel, ...] = ANGLES, g: float = -9.81, pull: np.ndarray = PLATEAU
) -> list[Suspicion]:
    """Of a body that tilts by half a radian a newton and `sag` (rad), read with the `heading` (rad)."""
    rng = np.random.default_rng(0)
    tilt = np.column_stack([0.0 * TIME, 0.5 * pull + sag, 0.0 * TIME])
    true = Rotation.from_rotvec(np.outer(heading, [0.0, 0.0, 1.0])) * Rotation.from_rotvec(tilt)
    read = true * Rotation.from_rotvec(rng.normal(0.0, np.radians(0.2), (len(TIME), 3)))
    columns = read.as_euler("ZYX")[:, ::-1] if channels == ANGLES else read.as_quat(scalar_first=True)
    values = {"tendon_1_tension": pull, "tendon_2_tension": 0.0 * TIME, "tendon_3_tension": 0.0 * TIME}
    values |= {c.name: columns[:, k] for k, c in enumerate(channels)}
    trials = tuple(Trial(f"{k}.csv", TIME, values, start=100.0 * k) for k in range(2))
    day = Recording("continuum", "test", "hardware", np.array([0.0, 0.0, g]), (*PULLS, *channels), trials)
    return list(headings.walking(Case(prepare(day, ROBOT), Twin(ROBOT), None)))


STILL, WALK = 0.0 * TIME, 0.05 * TIME  # rad: 3 degrees a second


@pytest.mark.parametrize("channels", [ANGLES, QUATERNION], ids=["angles", "quaternion"])
def test_a_heading_that_walks_while_commands_hold_is_told(channels: tuple[Channel, ...]) -> None:
    """From the middle of a hold of 40 rows to its last it goes on by 19 rows at 0.05 rad/s: 5.4 degrees, within the noise."""
    (suspicion,) = found(WALK, STILL, channels)
    assert suspicion.kind == "heading"
    assert float(suspicion.words.split("goes on by ")[1].split()[0]) == pytest.approx(5.44, abs=0.3)
    assert ("disk_8_yaw" if channels == ANGLES else "disk_8_roll and disk_8_pitch in place") in suspicion.change


@pytest.mark.parametrize(
    ("heading", "sag", "g"),
    [(STILL, STILL, -9.81), (0.5 * PLATEAU, STILL, -9.81), (WALK, 0.05 * TIME, -9.81), (WALK, STILL, 0.0)],
    ids=["still", "turns with the command", "sags as fast", "no vertical"],
)
def test_no_other_motion_is(heading: np.ndarray, sag: np.ndarray, g: float) -> None:
    assert not found(heading, sag, g=g)


def test_commands_that_never_hold_show_no_walk() -> None:
    assert not found(WALK, STILL, pull=np.linspace(0.0, 1.0, len(TIME)))


def test_the_vertical_is_turned_into_the_frame_of_the_readings() -> None:
    """A camera on its side has the vertical along y: there a turn about z tilts, and one about y is the heading."""
    values = {"frame.turn_x": np.pi / 2.0}
    twin = replace(Twin(ROBOT), values=values)
    rng = np.random.default_rng(1)
    outputs = {}
    for axis in (1, 2):
        turned = np.zeros((len(TIME), 3))
        turned[:, axis] = WALK
        read = Rotation.from_rotvec(turned) * Rotation.from_rotvec(rng.normal(0.0, np.radians(0.2), (len(TIME), 3)))
        columns = read.as_quat(scalar_first=True)
        trial = {c.name: 0.0 * TIME for c in PULLS} | {c.name: columns[:, k] for k, c in enumerate(QUATERNION)}
        trials = tuple(Trial(f"{k}.csv", TIME, trial, start=100.0 * k) for k in range(2))
        day = Recording("continuum", "test", "hardware", np.array([0.0, 0.0, -9.81]), (*PULLS, *QUATERNION), trials)
        outputs[axis] = list(headings.walking(Case(prepare(day, ROBOT), twin, None)))
    assert outputs[1]
    assert not outputs[2]
