"""Orientations: of a rod bent by a pure moment, quaternions and angles by hand, and what a camera's frame does to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tools.simulators.rod.mechanics.rod import Rod, follow
from twin.body import orientation
from twin.diagnosis import Settings, diagnose
from twin.effects import effect_class
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.evaluate import evaluate
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")
PULLS = tuple(Channel(f"tendon_{i}_tension", "input", "N", 0.01) for i in (1, 2, 3))
QUATERNION = tuple(Channel(f"disk_8_{a}", "output", "1", 1e-3) for a in ("qw", "qx", "qy", "qz"))
ANGLES = tuple(Channel(f"disk_8_{a}", "output", "deg", np.radians(0.2)) for a in ("roll", "pitch", "yaw"))
TIP = tuple(Channel(f"disk_8_{a}", "output", "mm", 2.5e-4) for a in "xyz")
VECTOR = st.lists(st.floats(-1.7, 1.7), min_size=3, max_size=3).map(np.array)


def pulled(tension: np.ndarray, outputs: tuple[Channel, ...], n_trial: int = 2) -> Recording:
    """Slow trials of tensions (n, 3) N without gravity."""
    n = len(tension)
    values = {c.name: tension[:, i] for i, c in enumerate(PULLS)} | {c.name: np.zeros(n) for c in outputs}
    trials = tuple(Trial(f"{k}.csv", 1.0 * np.arange(n), values, start=100.0 * k) for k in range(n_trial))
    return Recording("continuum", "test", "simulation", np.zeros(3), (*PULLS, *outputs), trials)


def test_a_tip_turns_by_the_moment_over_the_stiffness() -> None:
    """One tendon at x makes a moment T r about y: by theta = T r L / EI. What it presses, 0.3 N, softens the rod between its disks
    by T h^2 / (12 EI) = 0.4 %."""
    T = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    seen = Twin(ROBOT).predict(pulled(T, QUATERNION)).trials[0].values
    q = np.column_stack([seen[c.name] for c in QUATERNION])
    np.testing.assert_allclose(q[0], [1.0, 0.0, 0.0, 0.0], atol=1e-9)
    stiffness = ROBOT.value("backbone.youngs_modulus") * np.pi * ROBOT.value("backbone.radius") ** 4 / 4.0
    theta = 0.3 * 8e-3 * 0.12 / stiffness
    np.testing.assert_allclose(2.0 * np.arctan2(q[1, 2], q[1, 0]), theta, rtol=0.01)
    np.testing.assert_allclose(q[1, [1, 3]], 0.0, atol=1e-9)


def test_angles_and_quaternions_say_the_same() -> None:
    T = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.0], [0.2, 1.5, 0.1]])
    by = {c: Twin(ROBOT).predict(pulled(T, c)).trials[0].values for c in (QUATERNION, ANGLES, ANGLES[:2])}
    q = np.column_stack([by[QUATERNION][c.name] for c in QUATERNION])
    angles = np.column_stack([by[ANGLES][c.name] for c in ANGLES])
    np.testing.assert_allclose(
        Rotation.from_euler("ZYX", angles[:, ::-1]).as_matrix(), Rotation.from_quat(q, scalar_first=True).as_matrix(), atol=1e-9
    )
    for channel in ANGLES[:2]:  # without yaw each is compared by itself
        np.testing.assert_allclose(by[ANGLES[:2]][channel.name], by[ANGLES][channel.name], atol=1e-9)


def test_a_sensor_that_sits_turned_on_its_disk_reads_in_its_own_axes() -> None:
    """Q of the disk becomes Q M, M the mount; an IMU reads gravity in its own axes: R^T g becomes M^T R^T g."""
    T = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.0], [0.2, 1.5, 0.1]])
    mount = Rotation.from_rotvec([0.4, -0.3, 1.1])
    accel = tuple(Channel(f"imu_1_accel_{a}", "output", "m/s^2", 0.01) for a in "xyz")
    seen = []
    for vector in (np.zeros(3), mount.as_rotvec()):
        turns = {f"{place}.turn_{a}": x for place in ("markers", "imus") for a, x in zip("xyz", vector, strict=True)}
        twin = Twin(replace(ROBOT, structure={**ROBOT.structure, "imus": [8]}), values=turns)
        day = replace(pulled(T, (*QUATERNION, *accel)), gravity=np.array([0.0, 0.0, -9.81]))
        values = twin.predict(day).trials[0].values
        seen.append([np.column_stack([values[c.name] for c in of]) for of in (QUATERNION, accel)])
    (q, force), (turned, felt) = seen
    as_mounted = Rotation.from_quat(q, scalar_first=True) * mount
    np.testing.assert_allclose((as_mounted.inv() * Rotation.from_quat(turned, scalar_first=True)).magnitude(), 0.0, atol=1e-9)
    np.testing.assert_allclose(felt, mount.inv().apply(force), atol=1e-9)
    assert np.linalg.norm(felt - force) > 1.0


def test_the_sign_of_a_quaternion_is_free_and_errors_are_angles() -> None:
    """A reading turned by 2 degrees about an axis of its own is 2 degrees off, whatever its sign; a missing cell is left out."""
    T = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.0], [0.2, 1.5, 0.1]])
    recording = Twin(ROBOT).predict(pulled(T, QUATERNION))
    q = np.column_stack([recording.trials[0].values[c.name] for c in QUATERNION])
    off = (Rotation.from_quat(q, scalar_first=True) * Rotation.from_rotvec(np.radians([0.0, 0.0, 2.0]))).as_quat(scalar_first=True)
    off[1] *= -1.0
    off[2, 3] = np.nan
    values = [{**t.values, **{c.name: off[:, i] for i, c in enumerate(QUATERNION)}} for t in recording.trials]
    error = evaluate(Twin(ROBOT), recording.with_values(values, "test"))
    assert error["unit"] == "deg"
    # Components of a rotation vector across it shrink by sin(theta/2) / (theta/2), 1 % at 30 degrees.
    assert error["rmse"] == pytest.approx(2.0, rel=0.02)


def test_a_part_of_a_quaternion_is_refused() -> None:
    with pytest.raises(DataError, match="disk_8 needs all of qw, qx, qy, qz"):
        prepare(pulled(np.zeros((3, 3)), QUATERNION[:3]), ROBOT)


def test_a_turned_camera_turns_orientations() -> None:
    T = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.0]])
    turn = np.radians([3.0, -2.0, 5.0])
    camera = effect_class("camera_misalignment")(dict(zip(("turn_x", "turn_y", "turn_z"), turn, strict=True)))
    plain, seen = (
        np.column_stack([t.predict(pulled(T, QUATERNION)).trials[0].values[c.name] for c in QUATERNION])
        for t in (Twin(ROBOT), Twin(ROBOT).with_effect(camera))
    )
    expected = Rotation.from_rotvec(turn) * Rotation.from_quat(plain, scalar_first=True)
    np.testing.assert_allclose(Rotation.from_quat(seen, scalar_first=True).as_matrix(), expected.as_matrix(), atol=1e-9)


def test_an_imu_reads_gravity_and_its_own_turning() -> None:
    """On a straight robot in 9.81 m/s^2 along z it reads -9.81 along z; turning about y at a steady rate it reads that rate."""
    turn = np.zeros((5, 1, 3))
    turn[:, 0, 1] = 0.3 * np.arange(5)
    rate, force = orientation.rates_and_forces(0.1 * np.arange(5), turn, np.array([0.0, 0.0, 9.81]))
    np.testing.assert_allclose(force[0, 0], [0.0, 0.0, -9.81], atol=1e-12)
    np.testing.assert_allclose(force[4, 0], [9.81 * np.sin(1.2), 0.0, -9.81 * np.cos(1.2)], atol=1e-12)
    np.testing.assert_allclose(rate[:, 0], np.tile([0.0, 3.0, 0.0], (5, 1)), atol=1e-12)


def test_imus_are_on_the_disks_that_a_structure_names() -> None:
    robot = replace(ROBOT, structure={**ROBOT.structure, "imus": [8, 4]})
    seen = (Channel("imu_1_accel_x", "output", "m/s^2", 0.05), Channel("imu_2_accel_z", "output", "m/s^2", 0.05), *QUATERNION)
    hanging = replace(pulled(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), seen), gravity=np.array([0.0, 0.0, 9.81]))
    values = Twin(robot).predict(hanging).trials[0].values
    theta = 2.0 * np.arctan2(values["disk_8_qy"][1], values["disk_8_qw"][1])
    assert values["imu_1_accel_x"][1] == pytest.approx(9.81 * np.sin(theta), rel=1e-6)
    assert values["imu_2_accel_z"][0] == pytest.approx(-9.81)


@given(VECTOR)
def test_quaternions_and_angles_return_what_they_came_from(vector: np.ndarray) -> None:
    there = Rotation.from_rotvec(vector).as_matrix()
    for out, back in ((orientation.quaternions, orientation.from_quaternions), (orientation.angles, orientation.from_angles)):
        found = Rotation.from_rotvec(back(out(vector[None])))[0].as_matrix()
        np.testing.assert_allclose(found, there, atol=1e-7)  # near a pitch of 90 degrees roll and yaw are known to half the digits


def test_a_body_that_turns_beyond_half_a_turn_goes_on() -> None:
    angle = np.linspace(0.0, 3.0 * np.pi, 60)
    turn = Rotation.from_rotvec(angle[:, None] * np.array([0.6, 0.0, 0.8])).as_rotvec()
    np.testing.assert_allclose(orientation.followed(turn[:, None])[:, 0], angle[:, None] * [0.6, 0.0, 0.8], atol=1e-9)


def test_orientations_are_those_of_another_rod() -> None:
    """Disk 8 of the independent rod simulator, bent out of plane under its weight; its backbone bends between the disks as a curve,
    the twin's in hinges: 0.3 degrees of 60."""
    tension = np.stack([np.linspace(0.0, 2.0, 21), np.linspace(0.0, 1.2, 21), np.zeros(21)], axis=1)
    gravity = np.array([2.0, 0.0, 9.6])
    shape = follow(Rod(), tension, gravity=gravity)
    slow = replace(pulled(tension, QUATERNION), gravity=gravity)
    slow = replace(slow, trials=tuple(replace(t, time=20.0 * t.time, start=1000.0 * k) for k, t in enumerate(slow.trials)))
    seen = Twin(ROBOT).predict(slow).trials[0].values
    twin = Rotation.from_quat(np.column_stack([seen[c.name] for c in QUATERNION]), scalar_first=True)
    rod = Rotation.from_matrix(shape.rotations[:, -1])
    assert np.degrees(rod[-1].magnitude()) > 40.0
    np.testing.assert_array_less(np.degrees((rod.inv() * twin).magnitude()), 0.3)


def test_friction_is_found_from_orientations_alone() -> None:
    """Eight slow trials of the independent rod simulator with friction of 0.2, seen by one disk's quaternion, 0.2 degrees of noise.

    Its pre-sliding is another law; the coefficient is compared.
    """
    rng, n = np.random.default_rng(3), 60
    phase, gravity, trials = np.linspace(0.0, 4.0 * np.pi, n), np.array([0.0, 0.0, 9.81]), []
    data = replace(pulled(np.zeros((n, 3)), QUATERNION, 8), gravity=gravity)
    for k, t in enumerate(data.trials):
        tension = np.stack([(1.0 - np.cos(phase + a)) * (1.0 + 0.1 * k) for a in rng.uniform(0, 6.3, 3)], axis=1)
        tension[:, k % 3] = 0.1
        ramp = np.linspace(0.0, 1.0, 16)[:-1, None] * tension[0]  # from rest, as the twin begins a trial
        between = 0.5 * (tension[1:] + tension[:-1])  # steps of 0.25 N or less, as the simulator asks for
        halved = np.insert(tension, np.arange(1, n), between, axis=0)
        fine = np.concatenate([ramp, halved])
        shape = follow(Rod(), fine, gravity=gravity, mu=0.2, stroke=5e-5)
        shaken = Rotation.from_matrix(shape.rotations[len(ramp) :: 2, -1]) * Rotation.from_rotvec(
            rng.normal(0.0, np.radians(0.2), (n, 3))
        )
        q = shaken.as_quat(scalar_first=True)
        values = {c.name: tension[:, i] for i, c in enumerate(PULLS)} | {c.name: q[:, i] for i, c in enumerate(QUATERNION)}
        trials.append(replace(t, time=4.0 * t.time, values=values, start=500.0 * k))
    found = diagnose(replace(data, trials=tuple(trials)), settings=Settings(jobs=1))
    assert [c.effect for c in found.claims] == ["tendon_friction"]
    assert found.claims[0].parameters["mu"].value == pytest.approx(0.2, abs=0.03)
    assert found.errors.after["turn"] == pytest.approx(np.radians(0.2) * np.sqrt(3.0), rel=0.15)
