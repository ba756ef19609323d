"""Bodies of an MJCF against closed forms: a pendulum's period, what hangs, stiction, the capstan, and steps of half the length."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.mechanics.mjcf.models import CAPSTAN, PENDULUM, robot, solved
from twin.body import Drive, Loads, Problem, Route, Rubbing, Start
from twin.effects import JointStop
from twin.foundation.errors import DataError
from twin.mechanics.mjcf import ModelBody, longest_step
from twin.robots import Robot

G, LENGTH, MASS = 9.81, 0.2, 0.5  # m/s^2, m, kg of the pendulum


def test_a_pendulum_swings_with_its_period(tmp_path: Path) -> None:
    """From 0.1 rad at rest: T = 2 pi sqrt(l / g) (1 + a^2 / 16)."""
    key = '<keyframe><key name="up" qpos="0.1"/></keyframe>'
    swing = robot(tmp_path, PENDULUM.format(joint="", key=key))
    time = np.arange(0.0, 4.0, 0.01)
    angle = solved(swing, time, np.zeros((len(time), 1)), start=Start(0.0, "up")).others["joint angle"][:, 0]
    down = np.flatnonzero((angle[:-1] > 0.0) & (angle[1:] <= 0.0))
    at = time[down] + 0.01 * angle[down] / (angle[down] - angle[down + 1])
    period = 2 * np.pi * np.sqrt(LENGTH / G) * (1 + 0.1**2 / 16)
    # s: straight lines between rows find a crossing to some 1e-5 s; steps of second order are 1e-5 off in the period
    np.testing.assert_allclose(np.diff(at), period, rtol=0, atol=1e-4)
    assert angle.max() == pytest.approx(0.1, abs=1e-4)  # no damping


def test_steps_are_of_second_order(tmp_path: Path) -> None:
    """A damped swing under a moving torque: halving the step takes three quarters off the error."""
    swing = robot(tmp_path, PENDULUM.format(joint=' damping="0.02"', key=""))
    time = np.arange(0.0, 2.0, 0.008)
    command = 0.2 * np.sin(7.0 * time)[:, None]

    def angle(step: float) -> np.ndarray:
        there = replace(swing, structure={**swing.structure, "timestep": step})
        return solved(there, time, command, start=Start(0.0)).others["joint angle"][:, 0]

    fine = angle(1.25e-4)
    errors = [float(np.abs(angle(step) - fine).max()) for step in (8e-3, 4e-3, 2e-3)]
    assert errors[0] < 0.01
    assert all(3.2 < a / b < 4.8 for a, b in pairwise(errors)), errors


def test_what_hangs_on_a_spring_is_where_torques_balance(tmp_path: Path) -> None:
    """A rod pushed by a torque u against its weight and a spring of k: u = m g l sin q + k q."""
    hangs = robot(tmp_path, PENDULUM.format(joint=' stiffness="0.8" damping="0.05"', key=""))
    u, time = 0.6, np.arange(0.0, 0.1, 0.02)
    for hung in (0.0, 0.1):  # kg at the tip
        loads = Loads(np.array([0.0, 0.0, -G]), payloads=(("tip", hung),) if hung else ())
        found = solved(hangs, time, np.full((len(time), 1), u), loads=loads, start=Start(30.0))
        q = found.others["joint angle"][-1, 0]
        assert (MASS + hung) * G * LENGTH * np.sin(q) + 0.8 * q == pytest.approx(u, abs=1e-6)
        assert found.markers[-1, 0] == pytest.approx([-LENGTH * np.sin(q), 0.0, -LENGTH * np.cos(q)], abs=1e-9)


def test_friction_holds_a_joint_and_lets_it_go(tmp_path: Path) -> None:
    """On a spring k without gravity, slowly pulled up by u: it stays at (u - F) / k, and let down again at (u + F) / k."""
    F, k = 0.1, 0.8
    rod = robot(tmp_path, PENDULUM.format(joint=f' stiffness="{k}" damping="0.05"', key=""))
    still = Loads(np.zeros(3))
    time = np.arange(0.0, 20.0, 0.02)
    up, down = (0.5 * (1.0 - np.cos(np.pi * np.clip((time - t) / 8.0, 0.0, 1.0))) for t in (0.0, 9.0))
    u = (0.6 * up - 0.4 * down)[:, None]
    rub = Route(rubbing=Rubbing(torque=(F,), presliding=1e-4))
    angle = solved(rod, time, u, rub, loads=still, start=Start(0.5)).others["joint angle"][:, 0]
    slow = [angle[np.searchsorted(time, t)] for t in (8.9, 19.9)]
    # rad: the damper's torque and the last of the swing are a hundredth of the friction's
    assert slow == pytest.approx([(0.6 - F) / k, (0.2 + F) / k], abs=0.003)

    def turning(t: float, y: np.ndarray) -> list[float]:
        ramps = (0.5 * (1.0 - np.cos(np.pi * np.clip((t - at) / 8.0, 0.0, 1.0))) for at in (0.0, 9.0))
        pushed = 0.6 * next(ramps) - 0.4 * next(ramps)
        return [y[1], (pushed - k * y[0] - 0.05 * y[1] - F * y[2]) / (MASS * LENGTH**2), y[1] / 1e-4 * (1.0 - y[2] * np.sign(y[1]))]

    reference = solve_ivp(turning, (0.0, 20.0), [0.0, 0.0, 0.0], "LSODA", time, rtol=1e-8, atol=1e-11, max_step=2e-3).y[0]
    # rad: the steps' second order, a thirtieth of the presliding; it creeps after the ramp's end as Dahl's law has it, by 7e-5
    assert np.abs(angle - reference).max() < 3e-6


def test_friction_takes_the_energy_that_it_should(tmp_path: Path) -> None:
    """A swing against friction F loses 4 F / (m g l) of its amplitude a period."""
    F = 2e-3
    key = '<keyframe><key qpos="0.1"/></keyframe>'
    swing = robot(tmp_path, PENDULUM.format(joint="", key=key))
    time = np.arange(0.0, 4.0, 0.01)
    rub = Route(rubbing=Rubbing(torque=(F,), presliding=1e-4))
    angle = solved(swing, time, np.zeros((len(time), 1)), rub, start=Start(0.0)).others["joint angle"][:, 0]
    tops = [angle[i] for i in range(1, len(angle) - 1) if angle[i] > angle[i - 1] and angle[i] >= angle[i + 1]]
    lost = 4.0 * F / (MASS * G * LENGTH)
    np.testing.assert_allclose(-np.diff([0.1, *tops]), lost, rtol=0.05)


def test_load_friction_grows_with_the_torque_of_the_drive(tmp_path: Path) -> None:
    """With share c of its own torque u against it, a rod stands up to k q = u (1 - c)."""
    k, c = 0.8, 0.2
    rod = robot(tmp_path, PENDULUM.format(joint=f' stiffness="{k}" damping="0.05"', key=""))
    time = np.arange(0.0, 8.0, 0.02)
    rub = Route(rubbing=Rubbing(load=(c,), presliding=1e-4))
    u = np.interp(time, [0, 6, 8], [0.0, 0.6, 0.6])[:, None]
    angle = solved(rod, time, u, rub, loads=Loads(np.zeros(3)), start=Start(0.2)).others["joint angle"][:, 0]
    assert k * angle[-1] == pytest.approx(0.6 * (1 - c), rel=0.02)


def test_what_a_tendon_does_to_a_joint_goes_past_its_gear(tmp_path: Path) -> None:
    """With a tendon's torque w beside the motor's u, a rod stands up to k q = u (1 - c) + w: only u rubs."""
    k, c, w = 0.8, 0.2, 0.5
    both = PENDULUM.format(joint=f' stiffness="{k}" damping="0.05"', key="").replace(
        '<actuator><motor name="push" joint="hinge"/>',
        '<tendon><fixed name="line"><joint joint="hinge" coef="0.1"/></fixed></tendon>'
        '<actuator><motor name="push" joint="hinge"/><motor name="pull" tendon="line"/>',
    )
    time = np.arange(0.0, 8.0, 0.02)
    rub = Route(rubbing=Rubbing(load=(c,), presliding=1e-4))
    u = np.stack([np.interp(time, [0, 6, 8], [0.0, 0.6, 0.6]), np.full(len(time), w / 0.1)], axis=1)
    found = solved(robot(tmp_path, both), time, u, rub, loads=Loads(np.zeros(3)), start=Start(5.0))
    assert k * found.others["joint angle"][-1, 0] == pytest.approx(0.6 * (1 - c) + w, rel=0.01)  # with w c it would be 0.1 less


def stopped(rod: Robot, time: np.ndarray, u: np.ndarray, start: Start, **stops: float) -> np.ndarray:
    """The angle (n,) rad of a rod without weight under a torque u (n,) N m, with stops."""
    body, effect = rod.build(), JointStop(stops, rod.n_tendon)
    effect.edit(body)
    problem = Problem(time, u[:, None], Loads(np.zeros(3)), effect.route(), (Drive.CONTROL,), start=start)
    return rod.solver(body).solve(problem).others["joint angle"][:, 0]


@pytest.mark.parametrize("give", [2e-3, 0.05])
def test_a_bumper_gives_way_and_rings(give: float, tmp_path: Path) -> None:
    """Pushed by u into a bumper it moves as I q'' = u - k q - c q' - max(0, r + loss r') / give, r = q - upper > 0, says."""
    k, c, loss, upper, time = 0.8, 0.05, 2e-3, 0.3, np.arange(0.0, 4.0, 0.01)
    rod = robot(tmp_path, PENDULUM.format(joint=f' stiffness="{k}" damping="{c}"', key=""))
    u = np.interp(time, [0.5, 0.6, 2.0, 3.0], [0.0, 1.0, 1.0, 0.0])

    def turning(t: float, y: np.ndarray) -> list[float]:
        into = y[0] - upper
        bump = max(0.0, (into + loss * y[1]) / give) if into > 0.0 else 0.0
        return [y[1], (np.interp(t, time, u) - k * y[0] - c * y[1] - bump) / (MASS * LENGTH**2)]

    reference = solve_ivp(turning, (0.0, time[-1]), [0.0, 0.0], "RK45", time, rtol=1e-8, atol=1e-10, max_step=1e-3).y[0]
    assert reference.max() > upper + 0.5 * give  # it bumps
    # rad: it meets the bumper at 4.5 rad/s somewhere between two steps of 1 ms
    angle = stopped(rod, time, u, Start(0.1), upper_hinge=upper, give=give, loss=loss)
    assert np.abs(angle - reference).max() < 4.5e-3


def test_a_joint_ends_at_its_stops(tmp_path: Path) -> None:
    """On a spring k without gravity, slowly pushed by u: q = clip(u / k, lower, upper); the nearer of two stops holds."""
    k, time = 0.8, np.arange(0.0, 60.0, 0.05)
    u = 0.6 * np.sin(2 * np.pi * time / 60.0)
    free = robot(tmp_path / "free", PENDULUM.format(joint=f' stiffness="{k}" damping="0.05"', key=""))
    near = robot(tmp_path / "near", PENDULUM.format(joint=f' stiffness="{k}" damping="0.05" range="-30 15"', key=""))
    for rod, upper in ((free, 0.4), (near, np.deg2rad(15.0))):
        angle = stopped(rod, time, u, Start(0.5), upper_hinge=0.4, lower_hinge=-0.2)
        away = np.abs(angle - np.clip(u / k, -0.2, upper))
        # rad: it lags by 0.05 / 0.8 s behind 0.08 rad/s, and swings by 0.08 / 6.3 as it is set going: 0.02; a stop is to be hard
        assert away.max() < 0.025
        assert away[(u / k > upper + 0.05) | (u / k < -0.25)].max() < 1e-3
    assert np.ptp(stopped(free, time, u, Start(0.5))) == pytest.approx(1.5, abs=0.02)  # without stops


def test_a_stop_does_not_throw_back(tmp_path: Path) -> None:
    """Set going by a spring, the rod stays where it meets the stop until the spring pulls it back: it does not bounce."""
    key = '<keyframe><key qpos="-0.3"/></keyframe>'
    rod = robot(tmp_path, PENDULUM.format(joint=' stiffness="0.8" springref="20"', key=key))
    time = np.arange(0.0, 2.0, 0.01)
    angle = stopped(rod, time, np.zeros(len(time)), Start(0.0), upper_hinge=0.1)  # its spring rests at 0.35 rad, beyond the stop
    met = int(np.argmax(angle > 0.1 - 1e-3))
    # The spring holds it at the stop with 10 rad/s^2: thrown back with a tenth of its 4 rad/s it would go back by 0.4^2 / 20 rad.
    assert 0 < met < len(time) // 2
    assert np.abs(angle[met:] - 0.1).max() < 0.008
    assert angle[-1] == pytest.approx(0.1, abs=1e-4)


@pytest.mark.parametrize(("way", "sign"), [("pulled", -1.0), ("released", 1.0)])
def test_a_cord_around_a_corner_passes_on_what_the_capstan_does(way: str, sign: float, tmp_path: Path) -> None:
    """A quarter turn: the spring beyond it feels T exp(-mu pi / 2) while pulled, T exp(+mu pi / 2) while released."""
    mu, k = 0.3, 200.0
    slider = robot(tmp_path, CAPSTAN)
    time = np.arange(0.0, 6.0, 0.02)
    T = (
        np.interp(time, [0, 4, 6], [0.0, 8.0, 8.0])[:, None]
        if way == "pulled"
        else np.interp(time, [0, 2, 6], [0.0, 8.0, 2.0])[:, None]
    )
    found = solved(slider, time, T, Route(mu, 2e-5), start=Start(0.1))
    at = np.searchsorted(time, 3.9 if way == "pulled" else 5.9)
    force = k * found.others["joint shift"][at, 0]
    # 2 %: the damper's 4 N s/m at 10 mm/s is 0.04 N of some 5 N
    assert force == pytest.approx(T[at, 0] * np.exp(sign * mu * np.pi / 2), rel=0.02)
    assert found.others["tendon tension"][at, 0] == pytest.approx(T[at, 0], abs=1e-9)  # at its base


def test_each_tendon_has_its_own_friction(tmp_path: Path) -> None:
    slider = robot(tmp_path, CAPSTAN)
    time = np.arange(0.0, 2.0, 0.02)
    T = np.interp(time, [0, 2], [0.0, 8.0])[:, None]
    one, none, half = (
        solved(slider, time, T, Route(mu, 2e-5, mu_shares=shares)).others["joint shift"][-1, 0]
        for mu, shares in ((0.3, (1.0,)), (0.0, ()), (0.6, (0.5,)))
    )
    assert none > one == pytest.approx(half, rel=1e-12)


def test_derivatives_are_those_of_the_closed_form(tmp_path: Path) -> None:
    """dq/dk of a spring that carries a torque u without gravity: -u / k^2."""
    parameters = '[parameters]\n"joint.hinge.stiffness" = { relative_std = 0.1, source = "made" }'
    rod = robot(tmp_path, PENDULUM.format(joint=' stiffness="0.8" damping="0.1"', key=""), parameters)
    time = np.arange(0.0, 0.1, 0.02)
    q = [
        solved(rod, time, np.full((5, 1), 0.4), values={"joint.hinge.stiffness": k}, loads=Loads(np.zeros(3)), start=Start(8.0))
        for k in (0.8, 0.801)
    ]
    slope = (q[1].others["joint angle"][-1, 0] - q[0].others["joint angle"][-1, 0]) / 1e-3
    assert slope == pytest.approx(-0.4 / (0.8 * 0.801), rel=1e-3)


def test_steps_are_shorter_where_joints_rub(tmp_path: Path) -> None:
    body = robot(tmp_path, PENDULUM.format(joint="", key="")).build()
    assert isinstance(body, ModelBody)
    assert longest_step(body, Route()) == body.longest_step
    for rubbing in (Rubbing(torque=(0.1,)), Rubbing(load=(0.1,))):
        assert longest_step(body, Route(rubbing=rubbing)) < body.longest_step


def test_what_is_not_there_is_refused(tmp_path: Path) -> None:
    rod = robot(tmp_path, PENDULUM.format(joint="", key=""))
    time, none = np.arange(0.0, 0.1, 0.02), np.zeros((5, 1))
    with pytest.raises(DataError, match=r"start_pose 'home': the model has no such keyframe; it has none"):
        solved(rod, time, none, start=Start(0.0, "home"))
    with pytest.raises(DataError, match=r"payload at 'tipp': .* did you mean 'tip'"):
        solved(rod, time, none, loads=Loads(np.zeros(3), payloads=(("tipp", 0.1),)))


def test_a_motion_that_diverges_says_so(tmp_path: Path) -> None:
    rod = robot(tmp_path, PENDULUM.format(joint="", key=""))
    found = solved(rod, np.arange(0.0, 0.1, 0.02), np.full((5, 1), 1e6), start=Start(0.0))
    assert not found.status.all()
    assert "timestep" in found.end_reason
