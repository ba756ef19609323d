"""twin/MJCFTrack-v0: its motion is the twin's own prediction, its targets are the log's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.mechanics.mjcf.models import CAPSTAN, robot
from twin.effects import effect_class
from twin.env.mjcf import MJCFTrack
from twin.foundation.errors import DataError, UnknownNameError
from twin.measurements import Recording
from twin.prediction.rollout import Drawing, draw_controls
from twin.prediction.twin import Twin
from twin.robots import load

INTERVAL = 0.04


def rubbing() -> Twin:
    """A leg whose knee rubs, whose hip's encoder is off, with a payload's worth of inertia."""
    leg = load("tendon_leg")
    friction = effect_class("joint_friction")({"torque_knee": 0.02}, leg.n_tendon)
    offset = effect_class("encoder_offset")({"offset_hip": 0.03}, leg.n_tendon)
    return Twin(leg, {"body.shank.mass": 0.063}, (friction, offset))


def logged(twin: Twin) -> Recording:
    """Two trials of the twin, of which the second carries 20 g, rows an interval apart."""
    drawn = draw_controls(twin, 2, 3, Drawing(1.2, 1.0 / INTERVAL))
    loaded = replace(drawn.trials[1], conditions={"payload.foot_tip": 0.02})
    return twin.predict(replace(drawn, trials=(drawn.trials[0], loaded)))


def followed(env: MJCFTrack) -> tuple[list[float], list[bool], dict[str, Any]]:
    """Rewards and truncations under the log's own controls, and the last info."""
    rewards, ends, info = [], [], {}
    for control in env.motion.controls[1:]:
        _, reward, lost, ended, info = env.step(env.action_of(control))
        assert not lost
        rewards.append(reward)
        ends.append(ended)
    return rewards, ends, info


@pytest.mark.parametrize("trial", ["rollout_1", "rollout_2"])
def test_the_logs_controls_give_the_logs_motion(trial: str) -> None:
    """With effects, an offset of an encoder, and each trial's payload; another twin does not follow so."""
    twin = rubbing()
    log = logged(twin)
    env = MJCFTrack(twin, motion=log, trial=trial, interval=INTERVAL)
    assert env.joints == ("joint.hip.position", "joint.knee.position")
    env.reset(seed=0)
    rewards, ends, info = followed(env)
    # spans are some rad: both are the same steps, controls rounded by their way through an action
    assert np.min(rewards) > -1e-8
    assert ends == [False] * (len(ends) - 1) + [True]
    measured = next(t for t in log.trials if t.name == trial).values
    assert info["position"] == pytest.approx([measured[j][-1] for j in env.joints], abs=1e-9)
    assert info["is_success"] is True
    plain = MJCFTrack(load("tendon_leg").name, motion=log, trial=trial, interval=INTERVAL)
    plain.reset(seed=0)
    rewards, _, info = followed(plain)
    assert np.mean(rewards) < -0.1


def test_rewards_and_success_are_shares_of_what_joints_move() -> None:
    log = logged(rubbing())
    env = MJCFTrack(rubbing(), motion=log, interval=INTERVAL, success=0.01)
    env.reset(seed=0)
    spans = [np.ptp(np.concatenate([t.values[j] for t in log.trials])) for j in env.joints]
    rng = np.random.default_rng(0)
    for _ in range(5):
        seen, reward, *_, info = env.step(rng.uniform(-1, 1, 2))
        error = np.abs(info["position"] - info["target"])
        assert reward == pytest.approx(-np.mean(error / (0.1 * np.array(spans))))
        assert info["is_success"] is bool((error < 0.01 * np.array(spans)).all())
        half_turns = seen[:2] * env.units
        assert half_turns == pytest.approx(info["position"], abs=1e-6)  # single precision


def test_targets_are_seen_ahead() -> None:
    env = MJCFTrack(rubbing(), motion=logged(rubbing()), trial="rollout_1", interval=INTERVAL, ahead=2)
    seen, _ = env.reset(seed=0)
    assert seen[-6:].reshape(3, 2) * env.units == pytest.approx(env.motion.targets[:3], abs=1e-6)
    seen, *_ = env.step(np.zeros(2))
    assert seen[-6:].reshape(3, 2) * env.units == pytest.approx(env.motion.targets[1:4], abs=1e-6)
    with pytest.raises(DataError, match="ahead = -1; a whole number from 0 on"):
        MJCFTrack(ahead=-1)


def test_readings_that_lack_are_bridged_and_other_rates_are_met() -> None:
    log = logged(rubbing())
    trial = log.trials[0]
    knee = trial.values["joint.knee.position"].copy()
    knee[5:9] = np.nan
    holed = replace(log, trials=(replace(trial, values={**trial.values, "joint.knee.position": knee}), log.trials[1]))
    env = MJCFTrack(rubbing(), motion=holed, trial="rollout_1", interval=INTERVAL / 2)
    assert len(env._motions[0].targets) == 2 * len(trial.time) - 1
    got = env._motions[0].targets[::2, 1]
    assert got[[4, 9]] == pytest.approx(knee[[4, 9]])
    assert got[5:9] == pytest.approx(np.linspace(knee[4], knee[9], 6)[1:-1])


def test_what_cannot_be_followed_is_refused(tmp_path: Path) -> None:
    log = logged(rubbing())
    with pytest.raises(UnknownNameError, match="rollout_1, rollout_2"):
        MJCFTrack(rubbing(), motion=log, trial="rollout_3")
    channels = tuple(c for c in log.channels if not c.name.startswith("joint."))
    kept = {c.name for c in channels}
    trials = tuple(replace(t, values={n: v for n, v in t.values.items() if n in kept}) for t in log.trials)
    with pytest.raises(DataError, match="no position of a joint to follow"):
        MJCFTrack(rubbing(), motion=replace(log, channels=channels, trials=trials))
    with pytest.raises(DataError, match="is no MJCF"):
        MJCFTrack("continuum")
    robot(tmp_path, CAPSTAN)
    with pytest.raises(DataError, match=r"actuator\.pull\.ctrl has no range for actions; give the actuator a ctrlrange"):
        MJCFTrack(str(tmp_path))


def test_a_motion_that_diverges_ends_the_episode(tmp_path: Path) -> None:
    """A motor that drives what it moves away, ever faster."""
    text = CAPSTAN.replace('<motor name="pull" tendon="cord" gear="-1"/>', '<general name="pull" joint="slide" biastype="affine" '
                           'biasprm="0 1e7 1e5" ctrlrange="-1 1"/>')  # fmt: skip
    made = robot(tmp_path, text)
    env = MJCFTrack(Twin.of(made), motion=None)
    env._motions = []
    env.plant.step(np.zeros(1))
    env.motion = type("Still", (), {"targets": np.zeros((9, 1)), "controls": np.zeros((9, 1))})()  # type: ignore[assignment]
    env.command, env._step = np.zeros(1), 0
    for _ in range(8):
        _, reward, lost, _, info = env.step(np.ones(1))
        if lost:
            break
    assert (lost, reward, info["is_success"]) == (True, -10.0, False)
    assert "diverges" in info["lost"]
