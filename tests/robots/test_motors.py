"""Motors that wind tendons: against the closed form of a rod between two antagonists, and what their descriptions may say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.report.plots.variables import variables
from twin.robots import Robot, load
from twin.robots.robot import models_folder

RADIUS, HOLE, STRETCH, PRETENSION = 0.01, 0.008, 2e-4, 0.2  # m, m, m/N, N
MOTORS = """
"motors.radius" = { value = 10.0, unit = "mm", std = 0.5, source = "test" }
"motors.zero" = { value = [0.0, 0.0], unit = "deg", std = 5.0, source = "test" }
"motors.torque_constant" = { value = 0.5, unit = "N*m/A", source = "test" }
"tendons.pretension" = { value = 0.2, unit = "N", std = 0.3, source = "test" }
"tendons.stretch" = { value = 0.2, unit = "mm/N", std = 0.05, source = "test" }
"""


def robot(folder: Path, structure: str = "motors = [[1, -3], [2, -4]]", more: str = MOTORS) -> Robot:
    """The reference robot with four tendons at right angles, wound in pairs."""
    text = (models_folder() / "continuum/robot.toml").read_text("utf-8")
    text = text.replace("tendons = 3", f"tendons = 4\npieces = 3\n{structure}")
    text = text.replace("value = [0.0, 120.0, 240.0]", "value = [0.0, 90.0, 180.0, 270.0]")
    folder.mkdir(exist_ok=True)
    (folder / "robot.toml").write_text(text.replace('"damping.time"', more + '"damping.time"'), "utf-8")
    return load(str(folder))


def turned(
    a: np.ndarray, names: tuple[str, ...] = ("motor_1_angle", "motor_2_angle"), outputs: tuple[tuple[str, str], ...] = ()
) -> Recording:
    """A slow trial of motor angles (n, 2) rad without gravity."""
    n = len(a)
    drive = [Channel(name, "input", "rad" if name.endswith("angle") else "N*m") for name in names]
    seen = [Channel(f"tip_{x}", "output", "mm", 2e-4) for x in "xyz"] + [Channel(o, "output", u) for o, u in outputs]
    values = {c.name: np.zeros(n) for c in seen} | {c.name: a[:, i] for i, c in enumerate(drive)}
    trials = tuple(Trial(f"{k}.csv", 2.0 * np.arange(n), values, start=100.0 * k) for k in range(2))
    return Recording("there", "test", "simulation", np.zeros(3), (*drive, *seen), trials)


def test_a_pair_with_pretension_bends_the_rod_as_the_closed_form_says(tmp_path: Path) -> None:
    """Tensions T0 +- (w a - r theta) / c on a rod of stiffness EI / L bend it by theta = (2 r w a / c) / (EI / L + 2 r^2 / c).

    All tendons together press the rod with P = 0.8 N, which between disks h = 15 mm apart softens it by P h^2 / (12 EI) = 1 %, and
    shorten it by 1e-6 m/N.
    """
    built = robot(tmp_path / "r")
    angle = np.column_stack([np.linspace(0.0, 0.12, 7), np.zeros(7)])
    prepared = prepare(turned(angle), built)
    found = simulate(Twin(built), prepared)[0]
    stiffness = built.value("backbone.youngs_modulus") * np.pi * built.value("backbone.radius") ** 4 / 4.0 / 0.12
    theta = (2 * HOLE * RADIUS * angle[:, 0] / STRETCH) / (stiffness + 2 * HOLE**2 / STRETCH)
    apart = (RADIUS * angle[:, 0] - HOLE * theta) / STRETCH
    alone = PRETENSION / (1.0 + 4 * 1e-6 / STRETCH)
    assert apart[-1] > 0.1
    np.testing.assert_allclose(found.true.tension[:, 0] - found.true.tension[:, 2], 2 * apart, atol=0.03 * apart[-1])
    np.testing.assert_allclose(found.true.tension[0], alone, rtol=1e-3)
    straight = np.where(theta == 0.0, 1.0, theta)
    tip = 0.12 * np.where(theta == 0.0, 0.0, (1.0 - np.cos(theta)) / straight)
    assert tip[-1] > 5e-3
    np.testing.assert_allclose(found.solution.markers[:, -1, 0], tip, atol=0.01 * tip[-1])  # type: ignore[union-attr]


def test_a_radius_and_a_zero_count_from_what_is_described(tmp_path: Path) -> None:
    """Commands are made with the described spool: a spool 5 % larger winds 5 % more, a zero later by 3 degrees that much less."""
    built = robot(tmp_path / "r")
    train = built.drive_train({"motors.radius": 1.05 * RADIUS, "motors.zero_1": np.radians(3.0)})
    np.testing.assert_allclose(train.share, 1.05)
    wound = 1.05 * RADIUS * np.radians(3.0)
    np.testing.assert_allclose(train.shift, STRETCH * PRETENSION + wound * np.array([-1.0, 0.0, 1.0, 0.0]))
    twin = Twin(built, {"motors.radius": 1.05 * RADIUS, "motors.zero_1": np.radians(3.0)})
    a = np.column_stack([np.radians([3.0, 9.0]), np.zeros(2)])
    same = Twin(built).predict(turned((a - np.radians([3.0, 0.0])) * 1.05))
    for axis in "xyz":
        got = twin.predict(turned(a)).trials[0].values[f"tip_{axis}"]
        np.testing.assert_allclose(got, same.trials[0].values[f"tip_{axis}"], atol=1e-9)


def test_motors_show_their_angle_torque_and_current(tmp_path: Path) -> None:
    built = robot(tmp_path / "r")
    a = np.column_stack([np.linspace(0.0, 0.1, 5), np.linspace(0.0, -0.05, 5)])
    with_motors = turned(a, outputs=(("motor_1_torque", "N*m"), ("motor_2_current", "A")))
    seen = Twin(built).predict(with_motors).trials[0].values
    tension = simulate(Twin(built), prepare(with_motors, built))[0].true.tension
    np.testing.assert_allclose(seen["motor_1_torque"], RADIUS * (tension[:, 0] - tension[:, 2]), atol=1e-15)
    np.testing.assert_allclose(seen["motor_2_current"], RADIUS * (tension[:, 1] - tension[:, 3]) / 0.5, atol=1e-15)
    pulls = tuple(Channel(f"tendon_{i}_tension", "input", "N") for i in (1, 2, 3, 4))
    reading = Channel("motor_2_angle", "output", "rad")
    pulled = {c.name: tension[:, i] for i, c in enumerate(pulls)}
    trials = tuple(replace(t, values=pulled | {"motor_2_angle": np.zeros(5)}) for t in with_motors.trials)
    back = replace(with_motors, channels=(*pulls, reading), trials=trials)
    # Two tensions say the angle only through the path's length, which is known to the solver's 1e-7 rad.
    np.testing.assert_allclose(Twin(built).predict(back).trials[0].values["motor_2_angle"], a[:, 1], atol=1e-4)


def test_a_motor_of_one_tendon_may_be_driven_by_its_torque(tmp_path: Path) -> None:
    built = robot(tmp_path / "r", "motors = [[1], [2], [3], [-4]]", MOTORS.replace("[0.0, 0.0]", "[0.0, 0.0, 0.0, 0.0]"))
    names = tuple(f"motor_{i}_torque" for i in (1, 2, 3, 4))
    torque = np.array([[0.0, 0.0, 0.0, 0.0], [0.02, 0.01, 0.0, -0.01]])
    prepared = prepare(turned(torque, names), built)
    np.testing.assert_allclose(prepared.inputs[0].command[1], [2.0, 1.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("structure", "more", "said"),
    [
        ("motors = [[1, -3], [3, -4]]", MOTORS, "a tendon has one motor"),
        ("motors = [[1, -5]]", MOTORS, "tendons from 1 to 4"),
        ("motors = [[0]]", MOTORS, "tendons from 1 to 4"),
        ("motors = [[1, -3], [2, -4]]", MOTORS.replace('0.2, unit = "mm/N', '0.0, unit = "mm/N'), "tendons.stretch is 0"),
        ("motors = [[1, -3], [2, -4]]", "", "motors.radius"),
        ("", MOTORS, "motors.radius"),
    ],
)
def test_contradictions_are_refused(tmp_path: Path, structure: str, more: str, said: str) -> None:
    with pytest.raises(DataError, match=said.replace(".", r"\.")):
        robot(tmp_path / "r", structure, more)


def test_a_bound_that_another_number_contradicts_is_narrowed_and_said(tmp_path: Path) -> None:
    """Holes lie within the disks' rim, 10 mm: a fit may not leave them 14 mm from the axis, or its twin could not be read again."""
    text = (models_folder() / "continuum/robot.toml").read_text("utf-8").replace("low = 7.5, high = 8.5", "low = 7.5, high = 14.0")
    (tmp_path / "robot.toml").write_text(text, "utf-8")
    loose = load(str(tmp_path))
    (hole,) = (p for p in loose.parameters if p.name == "tendons.radius")
    assert hole.high == pytest.approx(0.01, rel=1e-9)
    assert loose.find_conflicts({"tendons.radius": hole.high}) == []
    assert [n.split(";")[0] for n in loose.notices] == ["tendons.radius is fitted as far as 0.01 m"]


def test_plots_go_by_a_motors_own_column(tmp_path: Path) -> None:
    """In its unit, also of the tendon that it lets go; rates are those of that column."""
    built = robot(tmp_path / "r")
    angle = np.column_stack([np.linspace(0.0, 0.12, 7), np.zeros(7)])
    day = turned(angle)
    degrees = tuple(replace(c, unit="deg") if c.name == "motor_1_angle" else c for c in day.channels)
    drawn = [v for kind, v in variables(prepare(replace(day, channels=degrees), built)) if kind in ("tension", "rate")]
    for v in (drawn[0], drawn[4]):  # of the tendons 1 and 3
        assert v.title == "motor_1_angle (deg)"
        np.testing.assert_allclose(v.values[:7], np.degrees(angle[:, 0]), atol=1e-9)
    assert drawn[1].title == "rate of motor_1_angle (deg/s)"
    assert drawn[1].values[3] == pytest.approx(np.degrees(0.02) / 2.0, rel=1e-6)
