"""Joints that rub stay anywhere: a trial begins where its encoders show them, less what effects of the encoders add."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.mechanics.mjcf.models import PENDULUM, robot
from twin.effects import effect_class
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin

HELD = 40  # rows before the command moves
NUMBERS = {"joint_friction": {"torque_hinge": 0.2, "presliding": 1e-3}, "encoder_offset": {"offset_hinge": 0.05}}


def made(folder: Path, angle: np.ndarray, effects: tuple[str, ...]) -> tuple[Twin, Recording]:
    """A rod on a spring of 0.8 N m/rad without weight, its log of an angle (n,) rad, and the twin with these effects."""
    text = PENDULUM.replace('integrator="implicitfast"', 'integrator="implicitfast" gravity="0 0 0"')
    rod = robot(folder, text.format(joint=' stiffness="0.8" damping="0.05"', key=""))
    time = 0.01 * np.arange(len(angle))
    push = np.where(np.arange(len(angle)) < HELD, 0.0, 1e-3)
    channels = (
        Channel("push", "input", "N*m", quantity="actuator.push.ctrl"),
        Channel("hinge", "output", "rad", 1e-3, "joint.hinge.position"),
    )
    log = Trial("a.csv", time, {"push": push, "hinge": angle}, {}, start=0.0)
    kept = tuple(effect_class(name)(NUMBERS[name], rod.n_tendon) for name in effects)
    return Twin(rod, {}, kept), Recording(rod.name, "made", "simulation", None, channels, (log,))


def predicted(folder: Path, angle: np.ndarray, *effects: str) -> np.ndarray:
    twin, recording = made(folder, angle, effects)
    return np.asarray(twin.predict(recording).trials[0].values["hinge"])


NOISE = 1e-3 * np.random.default_rng(4).normal(size=100)  # rad


def test_the_mean_of_what_is_seen_before_the_command_moves_is_taken(tmp_path: Path) -> None:
    angle = np.where(np.arange(100) < HELD, 0.1 + NOISE, 0.7)
    twin, recording = made(tmp_path, angle, ())
    start = prepare(recording, twin.robot).inputs[0].start
    assert start.seen == pytest.approx((0.1 + NOISE[:HELD].mean(),))
    assert start.doubt == pytest.approx((10.0 * 1e-3 / np.sqrt(HELD),), rel=0.3)  # the scatter of 40 rows is known to some 15 %
    angle[: HELD - 2] = np.nan  # two rows say nothing of their scatter
    twin, recording = made(tmp_path, angle, ())
    assert np.isnan(prepare(recording, twin.robot).inputs[0].start.seen).all()


def test_a_joint_that_moves_is_not_seen(tmp_path: Path) -> None:
    """A log that begins with a step, whose command never changes, says nothing of where the joint stood before."""
    swing = 0.2 * (1.0 - np.cos(0.2 * np.arange(100))) + NOISE
    twin, recording = made(tmp_path, swing, ())
    assert np.isnan(prepare(recording, twin.robot).inputs[0].start.seen).all()


@pytest.mark.parametrize("seen", [-0.2, 0.0, 0.15])
def test_a_joint_that_rubs_stays_where_it_was_seen(seen: float, tmp_path: Path) -> None:
    """Friction of 0.2 N m holds the spring's 0.16 N m at most, from the first row on."""
    stays = predicted(tmp_path, np.full(100, seen), "joint_friction")
    assert np.abs(stays[:HELD] - seen).max() < 1e-6  # rad
    assert np.abs(stays - seen).max() < 5e-4  # rad: a push of a hundredth of that load is less than half the presliding
    assert np.abs(predicted(tmp_path, np.full(100, seen))[:HELD]).max() < 1e-6  # without friction the spring takes it home


def test_what_noise_explains_is_not_seen(tmp_path: Path) -> None:
    """Let go where its spring rests it stays at 0; seen d off it moves by d^3 / (d^2 + doubt^2)."""
    for off in (1e-4, 1e-2):
        twin, recording = made(tmp_path, off + NOISE, ("joint_friction",))
        start = prepare(recording, twin.robot).inputs[0].start
        moved = start.seen[0] ** 3 / (start.seen[0] ** 2 + start.doubt[0] ** 2)
        assert predicted(tmp_path, off + NOISE, "joint_friction")[0] == pytest.approx(moved, rel=1e-6)
        assert (moved > 0.9 * off) is (off > 1e-3)


def test_it_slides_to_where_friction_holds_it(tmp_path: Path) -> None:
    slid = predicted(tmp_path, np.full(600, 0.5), "joint_friction")
    assert abs(slid[-1]) <= 0.2 / 0.8
    assert np.ptp(slid[-100:]) < 1e-3


def test_an_offset_of_the_encoder_is_no_pose(tmp_path: Path) -> None:
    shown = predicted(tmp_path, np.full(100, 0.15), "joint_friction", "encoder_offset")
    assert shown == pytest.approx(np.full(100, 0.15), abs=1e-4)
