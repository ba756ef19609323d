"""Laws against closed forms beyond their docstrings' examples, and how they meet."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import PchipInterpolator, make_interp_spline
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tests.effects.test_effects import some_signals
from twin.body import Drive, Loads, Signals
from twin.effects import Effect, catalogue, effect_class
from twin.effects.base.chain import EffectChain
from twin.effects.contact import obstacle_gap, obstacle_in_frame
from twin.foundation.compiled import jit
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")


def law(name: str, **values: float) -> Effect:
    return effect_class(name)(values, 3)


def test_delayed_strain_relaxes_while_the_robot_rests_between_trials() -> None:
    """A weak tip force held for 20 s, a pause, nothing: what is left is a (1 - exp(-20 s/tau)) exp(-pause/tau) of the instant
    bend, and fades on."""
    amplitude, tau, held = 0.3, 10.0, np.linspace(0.0, 20.0, 41)
    channels = (
        *(Channel(f"tendon_{i}_tension", "input", "N") for i in (1, 2, 3)),
        *(Channel(f"disk_8_{a}", "output", "mm") for a in "xyz"),
    )

    def trial(name: str, start: float, force: float) -> Trial:
        values = {c.name: np.zeros(41) for c in channels}
        return Trial(name, held, values, {"tip_force": np.array([force, 0.0, 0.0])}, start=start)

    def tips(pause: float) -> tuple[np.ndarray, np.ndarray]:
        trials = (trial("a.csv", 0.0, 1e-3), trial("b.csv", 20.0 + pause, 0.0))
        day = Recording("continuum", "made", "simulation", np.zeros(3), channels, trials)
        twin = Twin(ROBOT, {}, (law("backbone_creep", amplitude=amplitude, time=tau),))
        a, b = (t.true.markers[:, 7, 0] for t in simulate(twin, prepare(day, ROBOT)))
        return a, b

    for pause in (0.0, 10.0, 25.0):
        loaded, rest = tips(pause)
        # 0.4 mm, so 1e-3 rad of nonlinearity squared; solved to 1e-7 rad of 5e-3; the bend itself follows the delayed strain.
        np.testing.assert_allclose(loaded / loaded[0], 1 + amplitude * (1 - np.exp(-held / tau)), rtol=2e-4)
        left = amplitude * (1 - np.exp(-20.0 / tau)) * np.exp(-(pause + held) / tau)
        np.testing.assert_allclose(rest / loaded[0], left, rtol=2e-3, atol=2e-4)


def test_a_delay_shifts_currents_by_the_heat_they_bring() -> None:
    """Rows of a second, each with a current of its own: by whole rows the currents are those before; by half a row the heat I^2 of
    both neighbours counts half. Nothing flows before the log."""
    t = np.arange(6.0)
    current = np.array([1.0, 2.0, 0.0, 3.0, 1.0, 2.0])[:, None]
    zero = np.zeros((6, 1))
    seen = Signals(t, t, zero, zero, np.zeros((6, 0, 3)), t, (Drive.CURRENT,), current)
    one, half, early = (effect_class("time_delay")({"delay": d}, 1).command(seen).current[:, 0] for d in (1.0, 0.5, -1.0))
    np.testing.assert_allclose(one, [0.0, 1.0, 2.0, 0.0, 3.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(half**2, [0.5, 2.5, 2.0, 4.5, 5.0, 2.5], atol=1e-12)
    np.testing.assert_allclose(early, [2.0, 0.0, 3.0, 1.0, 2.0, 0.0], atol=1e-12)  # and none after it


def test_a_delay_shifts_tensions_and_displacements_alike() -> None:
    seen = some_signals()
    delayed = law("time_delay", delay=0.3).command(seen)
    then = np.clip(seen.time - 0.3, seen.time[0], None)
    # The signals are sines of 0.3 rad/s; cubics through samples up to 0.8 s apart miss them by far less than 1 % of the swing.
    np.testing.assert_allclose(delayed.tension, 1.5 + np.sin(0.3 * then[:, None] + np.arange(3)), atol=0.01)
    np.testing.assert_allclose(delayed.displacement, 5e-3 * np.sin(0.3 * then[:, None] + np.arange(3)), atol=5e-5)
    two, up = np.array([0.0, 1.0]), np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
    short = Signals(two, two, up, up, np.zeros((2, 0, 3)), two)
    np.testing.assert_allclose(law("time_delay", delay=0.25).command(short).tension[1], [0.75, 1.5, 0.0], atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_cell_drifts_by_its_rate_and_ever_less_where_it_warms_up(sign: float) -> None:
    """rate t; and rate tau (1 - exp(-t / tau)) with tau of half an hour, after half an hour and two; ever faster with -tau. Of a
    strain sensor the same of its resistance."""
    seen = some_signals(n=2).with_changes(clock=np.array([1800.0, 7200.0]))
    cords = seen.with_changes(others={"sensor": np.full((2, 3), 1000.0)})

    def wander(levelling: float) -> np.ndarray:
        rates = {"rate_1": sign * 1e-4, "rate_3": sign * 5e-5}
        zero = sign * (law("load_cell_drift", **rates, levelling=levelling).sense(seen).tension - seen.tension)
        settled = law("sensor_drift", **rates, levelling=levelling).sense(cords).others["sensor"] / 1000.0
        np.testing.assert_allclose(sign * (settled - 1.0), zero, rtol=1e-9, atol=1e-12)
        return zero

    np.testing.assert_allclose(wander(0.0), [[0.18, 0.0, 0.09], [0.72, 0.0, 0.36]], rtol=1e-12, atol=1e-15)
    left = np.exp([-1.0, -4.0])
    np.testing.assert_allclose(wander(1.0 / 1800.0)[:, 0], 0.18 * (1.0 - left), rtol=1e-12)
    np.testing.assert_allclose(wander(-1.0 / 7200.0)[:, 2], 0.36 * (np.exp([0.25, 1.0]) - 1.0), rtol=1e-12)
    np.testing.assert_allclose(wander(1e-9), wander(0.0), rtol=1e-5)  # the limit: 7200 s of 1e-9 / s, half of it


def test_cells_read_what_their_equations_say() -> None:
    seen = some_signals(n=3)
    T = seen.tension
    np.testing.assert_allclose(law("load_cell_bias", bias_2=0.2).sense(seen).tension, T + np.array([0, 0.2, 0]), rtol=1e-14)
    np.testing.assert_allclose(law("load_cell_gain", gain_3=1.2).sense(seen).tension, T * [1, 1, 1.2], rtol=1e-14)
    mixed = law("load_cell_crosstalk", share_1_3=0.1, share_2_1=-0.05).sense(seen).tension
    np.testing.assert_allclose(mixed[:, 0], T[:, 0] + 0.1 * T[:, 2], rtol=1e-14)
    np.testing.assert_allclose(mixed[:, 1], T[:, 1] - 0.05 * T[:, 0], rtol=1e-14)
    np.testing.assert_allclose(mixed[:, 2], T[:, 2], rtol=1e-14)


def test_the_camera_turns_about_the_bases_origin_and_shifts() -> None:
    seen = some_signals(n=3)
    x, y, z = np.moveaxis(seen.markers, -1, 0)
    turned = law("camera_misalignment", turn_z=0.3, shift_y=2e-3).sense(seen).markers
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(turned, np.stack([c * x - s * y, s * x + c * y + 2e-3, z], axis=-1), atol=1e-15)


def test_a_lag_of_a_step() -> None:
    """After a ramp of 1 s to one: 1 - tau (1 - exp(-1/tau)) exp(-(t - 1)/tau)."""
    t = np.linspace(0.0, 60.0, 241)
    up = np.minimum(t, 1.0)[:, None] * np.ones(3)
    seen = Signals(t, t, up, 1e-3 * up, np.zeros((241, 0, 3)), t, (Drive.TENSION,) * 3)
    lagged = law("actuator_lag", time=2.0).drive(seen)
    after = t >= 1.0
    expected = 1.0 - 2.0 * (1 - np.exp(-0.5)) * np.exp(-(t[after] - 1.0) / 2.0)
    np.testing.assert_allclose(lagged.tension[after, 1], expected, rtol=1e-12)
    np.testing.assert_allclose(lagged.displacement[after, 1], 1e-3 * expected, rtol=1e-12)


def test_a_current_that_lags_heats_as_an_integrator_has_it() -> None:
    """Of currents that hold from row to row, from none: the mean square over each interval, by scipy; of none, none."""
    t, c = np.array([0.0, 0.3, 2.0, 2.1, 9.0]), np.array([1.0, 0.2, 0.0, 1.4, 0.7])
    current = c[:, None] * np.array([1.0, 0.0, 2.0])
    seen = Signals(t, t, 0 * current, 0 * current, np.zeros((5, 0, 3)), t, (Drive.CURRENT,) * 3, current)
    delivered = law("actuator_lag", time=1.7).drive(seen)
    x, expected = 0.0, []
    for k in range(4):
        rest = x - c[k]
        square = quad(lambda s, k=k, rest=rest: (c[k] + rest * np.exp(-s / 1.7)) ** 2, 0.0, t[k + 1] - t[k], epsrel=1e-12)[0]
        expected.append(np.sqrt(square / (t[k + 1] - t[k])))
        x = c[k] + rest * np.exp(-(t[k + 1] - t[k]) / 1.7)
    np.testing.assert_allclose(delivered.current[:4, 0], expected, rtol=1e-9)
    np.testing.assert_allclose(delivered.current[:4], np.outer(expected, [1.0, 0.0, 2.0]), rtol=1e-9)
    assert not delivered.tension.any()
    fast = law("actuator_lag", time=1e-4).drive(seen).current
    np.testing.assert_allclose(fast[:4, 0], c[:4], atol=5e-3)  # sqrt(1e-4 s / 2 / 0.1 s) x 0.2 A fades in the third
    starts = [s.values["time"] for s in effect_class("actuator_lag").fit_starts([seen], 3)]
    assert max(starts) > 1.0 > min(starts)
    assert [s.values["time"] for s in effect_class("actuator_lag").fit_starts([some_signals()], 3)] == [0.1]
    assert not list(law("actuator_lag").extended_starts([seen])), "an inertia that no current has"
    assert list(law("actuator_lag").extended_starts([some_signals()]))


def test_a_supply_ends_at_its_ceiling() -> None:
    t = np.arange(4.0)
    current = np.array([0.0, 0.5, 1.0, 2.0])[:, None] * np.ones(3)
    seen = Signals(t, t, 0 * current, 0 * current, np.zeros((4, 0, 3)), t, (Drive.CURRENT,) * 3, current)
    given = law("actuator_saturation", loss=1.0, ceiling=0.9, knee=1e-3).drive(seen)
    np.testing.assert_allclose(given.current[:, 1], [0.0, 0.5, 0.9, 0.9], atol=1e-5)
    assert not given.tension.any()
    half = law("actuator_saturation", loss=0.5, ceiling=0.9, knee=1e-3).drive(seen).current[:, 2]
    np.testing.assert_allclose(half, [0.0, 0.5, 0.95, 1.45], atol=1e-5)
    starts = list(effect_class("actuator_saturation").fit_starts([seen], 3))
    assert [s.free for s in starts] == [("loss", "ceiling", "knee")] * 2
    assert all(0.5 < s.values["ceiling"] < 2.0 for s in starts)


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("damping", [0.2, 0.7, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.5, 8.0])
def test_a_lag_of_second_order_is_what_an_integrator_makes_of_it(damping: float, smooth: bool) -> None:
    """tau^2 x'' + 2 damping tau x' + x = c by scipy, over rows of no even spacing, straight between them or by scipy's monotone
    cubics; behind a ramp it is late by 2 damping tau."""
    t = np.array([0.0, 0.05, 0.4, 0.41, 1.3, 2.0, 3.5, 3.6, 9.0])
    c = np.array([1.0, 2.0, 2.0, -1.0, 0.5, 0.5, 3.0, 3.0, 1.0])
    tau = 0.3
    path: Any = PchipInterpolator(t, c) if smooth else make_interp_spline(t, c, k=1)

    def rate(s: float, y: np.ndarray) -> list[float]:
        return [y[1], (float(path(s)) - y[0] - 2 * damping * tau * y[1]) / tau**2]

    exact = [c[0]]
    state = np.array([c[0], 0.0])
    for a, b in pairwise(t):
        state = solve_ivp(rate, (a, b), state, method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
        exact.append(state[0])
    seen = Signals(t, t, c[:, None] * np.ones(3), np.zeros((9, 3)), np.zeros((9, 0, 3)), t, (Drive.TENSION,) * 3, smooth=smooth)
    drive = law("actuator_lag", time=2 * damping * tau, inertia=0.25 / damping**2)
    # Rounding: what a drive settles to has (lag / row)^3 in it, (4.8 / 0.01)^3 here, and 1e8 times 2e-16 of some newtons.
    np.testing.assert_allclose(drive.drive(seen).tension[:, 1], exact, atol=1e-6)
    long = np.linspace(0.0, 60.0, 31)
    ramp = Signals(long, long, long[:, None] * np.ones(3), np.zeros((31, 3)), np.zeros((31, 0, 3)), long, (Drive.TENSION,) * 3)
    # To 1e-5: exp(-60 s / 4.8 s) is left.
    assert drive.drive(ramp).tension[-1, 0] == pytest.approx(60.0 - 2 * damping * tau, rel=1e-5)


def test_a_late_share_of_strain_comes_exponentially_whenever_rows_were_taken() -> None:
    """A sudden strain e: read is e (1 - share exp(-t / tau)), t since the row before it, at rows of no even spacing."""
    t, e = np.array([0.0, 0.1, 0.7, 1.9, 2.0, 7.0]), 0.05 * np.array([0.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    one = np.full((6, 1), 1e3)
    others = {"sensor": 1e3 * (1.0 + e[:, None]) ** 2, "sensor_rest": one}
    zero = np.zeros((6, 1))
    seen = Signals(t, t, zero, zero, np.zeros((6, 0, 3)), t, others=others)
    read = effect_class("sensor_hysteresis")({"share": 0.2, "time": 1.5}, 1).sense(seen).others["sensor"][:, 0]
    np.testing.assert_allclose(np.sqrt(read / 1e3) - 1.0, e * (1.0 - 0.2 * np.exp(-t / 1.5)), atol=1e-14)


def test_laws_meet_in_the_order_of_the_signal() -> None:
    """A cell with a gain, then a bias: readings are gain T + bias, and undone the other way round."""
    both = EffectChain((law("load_cell_gain", gain_1=2.0), law("load_cell_bias", bias_1=0.5)))
    seen = some_signals(n=2)
    read = both.sense(seen)
    np.testing.assert_allclose(read.tension[:, 0], 2.0 * seen.tension[:, 0] + 0.5, rtol=1e-14)
    np.testing.assert_allclose(both.command(read).tension, seen.tension, rtol=1e-13)


def test_stiffnesses_multiply_stretches_add_and_strains_follow_each_other() -> None:
    soft, old = law("temperature_softening", rate=0.01), law("backbone_ageing", rate=1e-5)
    warm, clock = np.array([296.15, 306.15]), np.array([0.0, 3600.0])
    np.testing.assert_allclose(EffectChain((soft, old)).stiffness(warm, clock), [1.0, 0.9 * 0.964], rtol=1e-12)
    np.testing.assert_array_equal(EffectChain(()).stiffness(warm, clock), 1.0)
    laws = EffectChain(
        (
            law("tendon_elasticity", stretch=2e-5),
            law("tendon_friction", mu=0.2, presliding=1e-4),
            law("tendon_elasticity", stretch=3e-5),
        )
    )
    assert laws.route.stretch == pytest.approx(5e-5)
    assert (laws.route.mu, laws.route.presliding) == (0.2, 1e-4)
    creep = EffectChain(
        (law("backbone_creep", amplitude=0.1, time=5.0, amplitude_2=0.2, time_2=50.0), law("backbone_creep", amplitude=0.3))
    ).creep
    assert creep.amplitude == (0.1, 0.2, 0.3)
    assert creep.time == (5.0, 50.0, 10.0)


def test_ageing_that_levels_off_is_a_rate_that_fades() -> None:
    """dK/dt = -rate K_0 exp(-levelling t), integrated; towards rate / levelling in all, and a line where nothing levels."""
    rate, levelling, clock = 2e-4, 1e-3, np.array([0.0, 60.0, 900.0, 7200.0])
    gone = solve_ivp(lambda t, k: [-rate * np.exp(-levelling * t)], (0.0, 7200.0), [1.0], t_eval=clock, rtol=1e-10, atol=1e-12)
    old = law("backbone_ageing", rate=rate, levelling=levelling)
    np.testing.assert_allclose(old.soften(clock, clock), gone.y[0], atol=1e-9)
    assert float(np.asarray(old.soften(clock, np.array([1e6])))[0]) == pytest.approx(1.0 - rate / levelling)
    nearly, line = (law("backbone_ageing", rate=1e-5, levelling=x).soften(clock, clock) for x in (1e-12, 0.0))
    np.testing.assert_allclose(nearly, line, atol=1e-9)


def test_loads_add_up_and_turn() -> None:
    laws = EffectChain((law("tip_payload", mass=0.005), law("base_tilt", about_x=np.pi / 6)))
    loads = laws.surround(Loads(np.array([0.0, 0.0, 9.0]), payload=0.01))
    assert loads.payload == pytest.approx(0.015)
    np.testing.assert_allclose(loads.gravity, [0.0, -4.5, 9.0 * np.sqrt(0.75)], atol=1e-12)


def test_a_law_that_finds_nothing_to_act_on_is_refused() -> None:
    jaw = load("cable_tool")
    with pytest.raises(DataError, match=r"backbone_creep acts on viscosity, which robot 'cable_tool' has not"):
        Twin(jaw, {}, (effect_class("backbone_creep")({"amplitude": 0.1}, 2),)).body()
    finger, saturation = load("finger"), effect_class("actuator_saturation")
    with pytest.raises(DataError, match="motors that stall are not solved on robot 'finger'"):
        Twin(finger, {}, (saturation({"stall": 2.0}, 4),)).body()
    Twin(finger, {}, (saturation({"loss_1": 0.5, "stroke": 5e-3}, 4),)).body()  # a stroke that ends is


def test_laws_that_change_the_body_all_change_it() -> None:
    """Rest angles u h (1 + slope (s/L - 1/2)), stiffnesses (1 + gradient (s/L - 1/2)), a hole moved along and across its radius."""
    laws = EffectChain(
        (
            law("backbone_precurvature", about_x=0.5, about_y=-0.2, slope=0.4),
            law("stiffness_gradient", gradient=0.3),
            law("tendon_routing", angle_2=0.1, radius_2=1e-3),
        )
    )
    plain, body = ROBOT.build(), ROBOT.build()
    laws.edit(body, "continuum")
    chain: Any = plain
    for at in chain.joints:
        along = at.arclength - 0.5
        for name, curvature in ((at.bend_x, 0.5), (at.bend_y, -0.2), (at.twist, 0.0)):
            before, after = plain.spec.joint(name), body.spec.joint(name)
            assert after.springref - before.springref == pytest.approx(curvature * at.length * (1 + 0.4 * along), abs=1e-15)
            np.testing.assert_allclose(after.stiffness, np.array(before.stiffness) * (1 + 0.3 * along), rtol=1e-12)
    assert sum(at.length for at in chain.joints) == pytest.approx(0.12)  # m: every piece of the backbone has its hinges
    for i, holes in enumerate(chain.tendon_sites):
        for name in holes:
            x, y, z = plain.spec.site(name).pos
            was, now = complex(x, y), complex(*body.spec.site(name).pos[:2])
            moved = (abs(was) + 1e-3) / abs(was) * np.exp(0.1j) if i == 1 else 1.0
            assert abs(now - was * moved) < 1e-15
            assert body.spec.site(name).pos[2] == z


def test_a_drum_that_is_not_round_errs_by_its_turn_and_reports_what_it_believes() -> None:
    """delivered = u + s sin(2 pi u / turn) + c (1 - cos(2 pi u / turn)); where tensions command, the encoder says the u that
    delivers what the tendon did."""
    crooked = law("transmission_error", turn=0.02, sine_1=2e-4, cosine_1=-3e-4, cosine_2=1e-4)
    u = np.array([[0.0, 0.0, 0.0], [2.5e-3, 5e-3, 5e-3], [7e-3, -1e-2, 3e-3]])
    time, zero = np.arange(3.0), np.zeros((3, 3))
    phase = 2.0 * np.pi * u / 0.02
    delivered = u + np.sin(phase) * [2e-4, 0.0, 0.0] + (1.0 - np.cos(phase)) * [-3e-4, 1e-4, 0.0]
    held = Signals(time, time, zero, u, np.zeros((3, 0, 3)), time, (Drive.DISPLACEMENT,) * 3)
    np.testing.assert_allclose(crooked.drive(held).displacement, delivered, atol=1e-15)
    pulled = held.with_changes(drives=(Drive.TENSION,) * 3, displacement=delivered)
    np.testing.assert_allclose(crooked.sense(pulled).displacement, u, atol=1e-7)  # m: an iteration that shrinks by 0.1 each time


def test_a_drive_on_its_stop_draws_in_no_more_and_pays_out_freely() -> None:
    """delivered = u below the limit, limit + (1 - loss) (u - limit) above it; of tendons that tensions pull nothing changes."""
    stops = law("actuator_saturation", loss_1=1.0, loss_2=0.25, stroke=5e-3, give=1e-6)
    u = np.array([[-2e-3, 0.0, 0.0], [4e-3, 4e-3, 4e-3], [9e-3, 9e-3, 9e-3]])
    time, zero = np.arange(3.0), np.zeros((3, 3))
    held = Signals(time, time, zero, u, np.zeros((3, 0, 3)), time, (Drive.DISPLACEMENT,) * 3)
    delivered = [[-2e-3, 0.0, 0.0], [4e-3, 4e-3, 4e-3], [5e-3, 8e-3, 9e-3]]
    np.testing.assert_allclose(stops.drive(held).displacement, delivered, atol=1e-9)
    pulled = held.with_changes(drives=(Drive.TENSION,) * 3)
    np.testing.assert_array_equal(stops.drive(pulled).displacement, u)


def test_holes_are_moved_about_the_axis_or_away_from_it_or_both() -> None:
    def holes(*effects: Effect) -> np.ndarray:
        """Radius and azimuth (3, n, 2) of every tendon's."""
        body = ROBOT.build()
        for effect in effects:
            effect.edit(body)
        xy = np.array([[body.spec.site(name).pos[:2] for name in sites] for sites in body.tendon_sites])
        return np.stack([np.hypot(*np.moveaxis(xy, -1, 0)), np.unwrap(np.arctan2(xy[..., 1], xy[..., 0]))], axis=-1)

    moved = holes(law("tendon_routing", radius_1=1e-3, angle_2=0.3, radius_3=-5e-4, angle_3=-0.2)) - holes()
    expected = np.array([[1e-3, 0.0], [0.0, 0.3], [-5e-4, -0.2]])
    np.testing.assert_allclose(moved, np.broadcast_to(expected[:, None], moved.shape), atol=1e-12)


def test_an_asymmetric_body_is_stiff_about_one_axis_and_soft_about_the_other() -> None:
    """The bending stiffness of each joint set as a tensor: EI (1 + e (cos 2a, sin 2a; sin 2a, -cos 2a)), whatever the axes."""
    plain: Any = ROBOT.build()
    body: Any = ROBOT.build()
    law("stiffness_asymmetry", along=-0.1, across=0.2).edit(body)
    for at in plain.joints:
        tensor = np.zeros((2, 2))
        for name in (at.bend_x, at.bend_y):
            joint = body.spec.joint(name)
            axis = np.array(joint.axis[:2])
            tensor += np.array(joint.stiffness).flat[0] * np.outer(axis, axis)
        EI = np.array(plain.spec.joint(at.bend_x).stiffness).flat[0]
        np.testing.assert_allclose(tensor / EI, [[0.9, 0.2], [0.2, 1.1]], atol=1e-12)


def test_springs_cool_and_change_phase_as_their_laws_say() -> None:
    plain = ROBOT.springs(3)
    cooled = law("sma_cooling", factor=1.5, share_1=2.0, forced=1e-3, rate=0.01).spring(plain)
    share = np.array([2.0, 1.0, 0.5])  # the last one's makes the product one
    np.testing.assert_allclose(cooled.loss, 1.5 * share * (plain.loss + 1e-3), rtol=1e-12)
    for name in ("loss_warm", "loss_warm_2", "loss_open", "loss_open_2", "loss_warm_open"):
        np.testing.assert_allclose(getattr(cooled, name), 1.5 * share * getattr(plain, name), rtol=1e-12)
    np.testing.assert_allclose(cooled.loss_surroundings, plain.loss_surroundings + 0.01, rtol=1e-12)
    moved = law("sma_hysteresis", width=6.0, shift=1.0, spread=2.0, plateau=1.1).spring(plain)
    heating, cooling = (plain.austenite_start + plain.austenite_finish) / 2, (plain.martensite_start + plain.martensite_finish) / 2
    np.testing.assert_allclose((moved.austenite_start + moved.austenite_finish) / 2, heating + 4.0, rtol=1e-12)
    np.testing.assert_allclose((moved.martensite_start + moved.martensite_finish) / 2, cooling - 2.0, rtol=1e-12)
    np.testing.assert_allclose(moved.austenite_finish - moved.austenite_start, 2 * (plain.austenite_finish - plain.austenite_start))
    np.testing.assert_allclose(
        moved.martensite_start - moved.martensite_finish, 2 * (plain.martensite_start - plain.martensite_finish)
    )
    np.testing.assert_allclose(moved.detwinning_start, 1.1 * plain.detwinning_start, rtol=1e-12)
    np.testing.assert_allclose(moved.detwinning_finish, 1.1 * plain.detwinning_finish, rtol=1e-12)


def test_each_spring_may_change_phase_at_its_own_temperatures() -> None:
    """By what it has more than the mean; the last one's departures make the sum none."""
    plain = ROBOT.springs(3)
    moved = law("sma_hysteresis", width=4.0, shift=1.0, width_1=2.0, shift_1=0.5, width_2=-6.0).spring(plain)
    width, shift = np.array([6.0, -2.0, 8.0]), np.array([1.5, 1.0, 0.5])
    for name in ("austenite_start", "austenite_finish"):
        np.testing.assert_allclose(getattr(moved, name) - getattr(plain, name), shift + width / 2, rtol=0, atol=1e-10)
    for name in ("martensite_start", "martensite_finish"):
        np.testing.assert_allclose(getattr(moved, name) - getattr(plain, name), shift - width / 2, rtol=0, atol=1e-10)
    alone = effect_class("sma_hysteresis")({"width": 4.0}, 1)
    assert {*alone.values} == {"width", "shift", "spread", "plateau"}
    own = ("width_1", "shift_1", "width_2", "shift_2")
    assert [s.free for s in law("sma_hysteresis").extended_starts([])] == [("spread", "plateau"), ("spread", "plateau", *own)]
    assert [s.free for s in alone.extended_starts([])] == [("spread", "plateau")]


def test_a_drive_gives_less_beyond_its_limit() -> None:
    """T - loss (r(T - limit) - r(-limit)), r(x) = (x + sqrt(x^2 + corner^2)) / 2: nothing lost at rest."""
    law_ = law("actuator_saturation", loss=0.4, limit=2.0, corner=0.5)
    pull = np.array([0.0, 1.0, 2.0, 5.0])[:, None] * np.ones(3)
    t = np.arange(4.0)
    given = law_.drive(Signals(t, t, pull, 0 * pull, np.zeros((4, 0, 3)), t, (Drive.TENSION,) * 3)).tension[:, 0]

    def r(x: float) -> float:
        return (x + np.sqrt(x * x + 0.25)) / 2

    np.testing.assert_allclose(given, [T - 0.4 * (r(T - 2.0) - r(-2.0)) for T in (0.0, 1.0, 2.0, 5.0)], rtol=1e-12)
    assert given[0] == 0.0


def test_play_is_an_operator_with_a_width_of_its_own_a_drive() -> None:
    """Pulled 1 mm and paid out again in steps of 0.1 mm, gap 0.2 mm (0.3 mm in the second), slack 0.05 mm, swap half the mean gap,
    so that in each the tendon stands still until the gap is crossed."""
    u = 1e-3 * np.concatenate([np.linspace(0, 1, 11), np.linspace(0.9, 0, 10)])[:, None] * np.ones(3)
    t = np.arange(21.0)
    play = law("tendon_backlash", gap=2e-4, swap=0.7e-3 / 6.0, slack=5e-5, gap_2=1e-4)
    signals = Signals(t, t, 0 * u, u, np.zeros((21, 0, 3)), t, (Drive.DISPLACEMENT,) * 3)
    moved = play.drive(signals).displacement
    for j, half in ((0, 1e-4), (1, 1.5e-4), (2, 1e-4)):
        at, stands = 0.0, []
        for pulled in u[:, j]:
            at = min(max(at, pulled - half), pulled + half)  # dragged along by one side of the gap or the other
            stands.append(at)
        np.testing.assert_allclose(moved[:, j], np.array(stands) - 5e-5, atol=1e-15)
    np.testing.assert_allclose(play.route().crossing_travel, [1e-4, 1.5e-4, 1e-4])
    by_tension = signals.with_changes(drives=(Drive.TENSION,) * 3)
    np.testing.assert_array_equal(play.drive(by_tension).displacement, u)  # no motor holds a length: the gap shows in its reading
    np.testing.assert_allclose(play.sense(by_tension).displacement - u, u - moved, atol=1e-15)
    np.testing.assert_array_equal(play.sense(signals).displacement, u)


def test_a_wall_stands_where_it_is_said() -> None:
    wall = law("contact", azimuth=0.5, distance=0.03, stiffness=100.0).surround(Loads(np.zeros(3))).wall
    point = 0.031 * np.array([np.cos(0.5), np.sin(0.5), 0.0])  # a millimetre beyond it
    assert wall[:3] @ point - wall[3] == pytest.approx(-1e-3)
    assert np.linalg.norm(wall[:3]) == pytest.approx(1.0)
    assert wall[4] == 100.0


def test_a_wall_leans_about_its_line() -> None:
    """Away from the robot further up, by the plane's points: its line at a height and the one a metre up its slope."""
    e, beside = np.array([np.cos(0.5), np.sin(0.5), 0.0]), np.array([-np.sin(0.5), np.cos(0.5), 0.0])
    there = 0.03 * e + [0.0, 0.0, 0.08]
    for lean in (0.0, 0.4, -0.7):
        wall = law("contact", azimuth=0.5, distance=0.03, stiffness=100.0, height=0.08, lean=lean).surround(Loads(np.zeros(3))).wall
        slope = np.sin(lean) * e + [0.0, 0.0, np.cos(lean)]
        for a, b in ((0.0, 0.0), (0.1, 0.0), (-0.2, 0.3)):
            gap, normal, _, bend = _touched(wall, there + a * beside + b * slope)
            assert gap == pytest.approx(0.0, abs=1e-15)
            assert bend == 0.0
        np.testing.assert_allclose(np.cross(slope, beside), normal, atol=1e-15)  # towards the robot
        assert _touched(wall, there + 1e-3 * e)[0] == pytest.approx(-1e-3 * np.cos(lean))


@pytest.mark.parametrize("slant", [0.6, -1.2, np.pi / 2])
def test_a_post_may_be_slanted(slant: float) -> None:
    """By points' distance from the line through its nearest point, a radius behind the surface, turned about the way there."""
    values = {"azimuth": 0.5, "distance": 0.03, "stiffness": 100.0, "curvature": 50.0, "height": 0.07, "slant": slant}
    post = law("contact", **values).surround(Loads(np.zeros(3))).wall
    e = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    along = Rotation.from_rotvec(slant * e).apply([-np.sin(0.5), np.cos(0.5), 0.0])
    for x in 0.05 * e + [0.0, 0.0, 0.07] + np.random.default_rng(1).normal(0.0, 0.02, (20, 3)):
        d = x - 0.05 * e - [0.0, 0.0, 0.07]
        assert _touched(post, x)[0] == pytest.approx(np.linalg.norm(d - d @ along * along) - 0.02, abs=1e-15)


def test_a_post_stands_where_it_is_said() -> None:
    """Round, of 20 mm, across the direction in which it stands: by the distance of a point from its axis, in any frame."""
    post = (
        law("contact", azimuth=0.5, distance=0.03, stiffness=100.0, curvature=50.0, height=0.07).surround(Loads(np.zeros(3))).wall
    )
    out, along = np.array([np.cos(0.5), np.sin(0.5), 0.0]), np.array([-np.sin(0.5), np.cos(0.5), 0.0])
    rng = np.random.default_rng(0)
    points = 0.05 * out + [0.0, 0.0, 0.07] + rng.normal(0.0, 0.02, (20, 3))
    turn, place = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix(), np.array([0.01, -0.02, 0.03])
    moved = obstacle_in_frame(post, turn, place)
    for x in points:
        d = x - 0.05 * out - [0.0, 0.0, 0.07]
        d -= d @ along * along
        gap, normal, across, bend = _touched(post, x)
        assert gap == pytest.approx(np.linalg.norm(d) - 0.02, abs=1e-15)
        np.testing.assert_allclose(normal, d / np.linalg.norm(d), atol=1e-12)
        assert np.dot(across, normal) == pytest.approx(np.dot(across, along), abs=1e-12)
        assert bend == pytest.approx(1.0 / np.linalg.norm(d))
        there = _touched(moved, (x - place) @ turn)
        assert there[0] == pytest.approx(gap, abs=1e-15)
        np.testing.assert_allclose(turn @ there[1], normal, atol=1e-12)


@jit
def _touched(wall, x):
    return obstacle_gap(wall, x)


def test_strokes_are_sought_of_all_drives_that_come_so_far() -> None:
    """Only where lengths command every tendon; of drives that all reach as far, all; of one that stays behind, not it. Motors may
    stall where some rows, not most, have a tendon pull harder."""
    saturation, u = effect_class("actuator_saturation"), 1e-2 * np.linspace(0.0, 1.0, 5)[:, None]
    held = some_signals(n=5).with_changes(drives=(Drive.DISPLACEMENT,) * 3, displacement=u * np.ones(3))
    starts = list(saturation.fit_starts([held], 3))
    assert starts
    stalls = [s.values["stall"] for s in starts if s.free == ("stall",)]
    assert len(stalls) == 2
    for stall in stalls:
        assert 0.0 < (held.tension.max(axis=1) > stall).mean() < 0.5
    starts = [s for s in starts if s.free != ("stall",)]
    for start in starts:
        assert 0.0 < start.values["stroke"] < 1e-2
        assert start.free == ("stroke", "give", "loss_1", "loss_2", "loss_3")
    behind = held.with_changes(displacement=u * [1.0, 0.1, 1.0])
    assert {s.free for s in saturation.fit_starts([behind], 3)} == {("stroke", "give", "loss_1", "loss_3"), ("stall",)}
    assert [s.free for s in saturation.fit_starts([held.with_changes(tension=0.0 * held.tension)], 3) if "stall" in s.free] == []
    mixed = held.with_changes(drives=(Drive.DISPLACEMENT, Drive.DISPLACEMENT, Drive.TENSION))
    assert not any("stroke" in s.free for s in saturation.fit_starts([mixed], 3))


@pytest.mark.parametrize("turns", [0.5, 0.6, 0.85, 1.0, 1.3, 3.0])
def test_a_fit_finds_a_drums_turn_from_some_start_whatever_its_phase(turns: float) -> None:
    """Of a drum half a millimetre off its centre, one turn of which takes up `turns` of the travel: least squares with the law's
    own steps and bounds ends at its circumference from one of the starts at least. Without the start at half the travel it did at
    0.5 of it in 2 of these phases."""
    effect, u = effect_class("transmission_error"), np.linspace(0.0, 2e-2, 60)[:, None]
    held = some_signals(n=60).with_changes(drives=(Drive.DISPLACEMENT,) * 3, displacement=u * [1.0, 0.0, 0.0])
    starts, table = list(effect.fit_starts([held], 3)), {p.name: p for p in effect.all_parameters(3)}
    assert all(s.free == ("turn", "sine_1", "cosine_1") for s in starts)
    free = [table[n] for n in starts[0].free]
    step, bounds = np.array([p.step for p in free]), ([p.low for p in free], [p.high for p in free])

    def off(x: np.ndarray, seen: np.ndarray | float = 0.0) -> np.ndarray:
        return (effect(dict(zip(starts[0].free, x, strict=True)), 3).drive(held).displacement[:, 0] - seen) / 5e-5

    for phase in np.arange(12) * np.pi / 6.0:
        truth = np.array([turns * 2e-2, 5e-4 * np.cos(phase), 5e-4 * np.sin(phase)])
        seen = off(truth) * 5e-5
        ends = [least_squares(off, list(s.values.values()), bounds=bounds, x_scale=step, args=(seen,)) for s in starts]
        assert min(ends, key=lambda f: f.cost).x[0] == pytest.approx(truth[0], rel=1e-3), phase


def test_springs_may_cool_as_fast_as_in_a_fans_wind_and_no_faster() -> None:
    """Loss of the springs' wire of 0.51 mm, 50 K above air: forced by Churchill and Bernstein (1977), free by Churchill and Chu
    (1975). Air that hardly moves, 0.25 m/s, doubles it; a fan's 2 m/s is the end of the range; both laws are good to some 10 %."""
    d, nu, Pr, T, warmer = 5.1e-4, 1.8e-5, 0.70, 323.0, 50.0  # m, m^2/s of air at 50 degC
    Ra = 9.81 / T * warmer * d**3 / nu**2 * Pr
    free = (0.60 + 0.387 * Ra ** (1 / 6) / (1.0 + (0.559 / Pr) ** (9 / 16)) ** (8 / 27)) ** 2

    def factor(speed: float) -> float:
        Re = speed * d / nu
        forced = 0.62 * Re**0.5 * Pr ** (1 / 3) / (1.0 + (0.4 / Pr) ** (2 / 3)) ** 0.25
        return (0.3 + forced * (1.0 + (Re / 282000.0) ** 0.625) ** 0.8) / free

    (still_air,) = (p for p in effect_class("sma_cooling").all_parameters(3) if p.name == "factor")
    assert factor(0.25) == pytest.approx(2.0, rel=0.1)
    assert still_air.high == pytest.approx(factor(2.0), rel=0.15)


def test_what_may_have_either_sign_may_be_as_large_either_way() -> None:
    """A day seen in a mirror, or counted the other way, is a day as well. Not so a draught, which carries off more heat, hardly
    less, a hysteresis, which is narrowed to none at most, and a warm-up, which may end within minutes; nothing runs away so."""
    one_way = {
        ("sma_cooling", "forced"),
        ("sma_hysteresis", "width"),
        ("load_cell_drift", "levelling"),
        ("sensor_drift", "levelling"),
    }
    for name, effect in catalogue().items():
        for p in effect.all_parameters(3):
            if p.low < 0.0 < p.high and p.value == 0.0 and (name, p.name) not in one_way:
                assert p.high == -p.low, (name, p.name)


def test_fits_start_at_every_guess_and_at_each_tendon_alone_and_all() -> None:
    """Of a law of each tendon: one start a tendon and one of all, with its first parameter, then with both; of a drift those with
    its rate, then with a levelling of all that leaves e^-3 of it at the session's end."""
    starts = list(effect_class("tendon_routing").fit_starts([], 3))
    assert [s.free for s in starts] == [
        ("angle_1",), ("angle_2",), ("angle_3",), ("angle_1", "angle_2", "angle_3"),
        ("angle_1", "radius_1"), ("angle_2", "radius_2"), ("angle_3", "radius_3"),
        ("angle_1", "radius_1", "angle_2", "radius_2", "angle_3", "radius_3"),
    ]  # fmt: skip
    table = {p.name: p for p in effect_class("tendon_routing").all_parameters(3)}
    for start in starts:
        assert dict(start.values) == {n: table[n].value + table[n].step for n in start.free}
    still = [some_signals().with_changes(clock=np.array([0.0, 900.0, 3000.0]))]
    drifts = list(effect_class("load_cell_drift").fit_starts(still, 3))
    rates = [("rate_1",), ("rate_2",), ("rate_3",), ("rate_1", "rate_2", "rate_3")]
    assert [s.free for s in drifts] == [*rates, *((*free, "levelling") for free in rates)]
    for plain, levelled in zip(drifts[:4], drifts[4:], strict=True):
        assert dict(plain.values) == dict.fromkeys(plain.free, 2e-5)
        assert dict(levelled.values) == {**dict.fromkeys(plain.free, pytest.approx(6e-5)), "levelling": pytest.approx(1e-3)}
    assert [s.free for s in effect_class("load_cell_drift").fit_starts([], 3)] == rates  # of no session it is not said how it ends
    assert [(s.free, s.values.get("levelling")) for s in effect_class("sensor_drift").fit_starts(still, 3)] == [
        (s.free, s.values.get("levelling")) for s in drifts
    ]
    creep = list(effect_class("backbone_creep").fit_starts([], 3))
    assert [dict(s.values)["time"] for s in creep] == [3.0, 15.0, 80.0]
    assert {s.free for s in creep} == {("amplitude", "time")}  # the second retardation time only where the first is in force


def test_drives_and_springs_that_are_alike_are_tried_each_with_its_own() -> None:
    """Beside the plain law's: all but the last have one, which has that of all (gaps) or what makes the product one (shares). Never
    where they already differ, nor of one drive alone."""
    still = [some_signals()]
    for alike, apart, fuller in (
        (law("tendon_backlash", gap=2e-4), law("tendon_backlash", gap=2e-4, gap_2=1e-4), [("slack",), ("slack", "gap_1", "gap_2")]),
        (law("sma_cooling", factor=1.3), law("sma_cooling", factor=1.3, share_2=1.1),
         [("forced", "rate"), ("forced", "rate", "share_1", "share_2")]),
    ):  # fmt: skip
        starts = list(alike.extended_starts(still))
        assert [s.free for s in starts] == fuller
        assert all(set(s.values) <= set(s.free) for s in starts)
        assert [s.free for s in apart.extended_starts(still)] == fuller[:1]
        one = effect_class(alike.id)({n: v for n, v in alike.values.items() if not n[-1].isdigit()}, 1)
        assert [s.free for s in one.extended_starts(still)] == fuller[:1]
    own = law("tendon_backlash", gap_2=2e-4)
    assert [s.free for s in own.extended_starts(still)] == [("slack",)]
    np.testing.assert_allclose(own.route().backlash, [0.0, 1e-4, 0.0])
    np.testing.assert_allclose(own.route().crossing_travel, [1e-4, 1e-4, 1e-4])  # of those without play it is not asked
    np.testing.assert_allclose(
        law("tendon_backlash", gap=1e-4, gap_2=-3e-4).route().backlash, [5e-5, 0.0, 5e-5]
    )  # never less than none


def test_an_actuator_follows_its_control_through_its_play() -> None:
    """By hand, play 0.2: at rest within half of it, then behind by that; the stepped law says the same of each row."""
    control = np.array([0.0, 0.05, 0.3, 0.25, 0.12, 0.0])[:, None]
    time, none, warm = np.arange(6.0), np.zeros((6, 1)), np.full(6, 293.0)
    s = Signals(time, time, none, none, np.zeros((6, 0, 3)), warm, (Drive.CONTROL,), control=control)
    play = effect_class("tendon_backlash")({"play_1": 0.2}, 1)
    expected = [0.0, 0.0, 0.2, 0.2, 0.2, 0.1]
    np.testing.assert_allclose(play.drive(s).control[:, 0], expected, atol=1e-12)
    step = play.by_step(1.0, control[0])
    assert step is not None
    np.testing.assert_allclose([step(c)[0] for c in control], expected, atol=1e-12)


def test_springs_and_drives_are_sought_where_they_are() -> None:
    """No start without springs; play in all drives, and in each that moves; walls only where the robot reaches."""
    still = some_signals()
    heated = still.with_changes(drives=(Drive.CURRENT,) * 3)
    for name in ("sma_cooling", "sma_hysteresis"):
        assert list(effect_class(name).fit_starts([still], 3)) == []
        assert len(list(effect_class(name).fit_starts([heated], 3))) >= 3
    one_moves = still.with_changes(displacement=still.displacement * np.array([0.0, 1.0, 0.0]))
    assert [s.free for s in effect_class("tendon_backlash").fit_starts([one_moves], 3)] == [("gap", "swap"), ("gap_2", "swap")]
    assert len(list(effect_class("tendon_backlash").fit_starts([still.with_changes(antagonists=True)], 2))) == 1
    asked = still.with_changes(drives=(Drive.CONTROL,) * 3)
    starts = [s.free for s in effect_class("tendon_backlash").fit_starts([asked], 3)]
    assert starts == [("play_1",), ("play_2",), ("play_3",), ("play_1", "play_2", "play_3")]
    for late, name in (("actuator_lag", "time"), ("time_delay", "delay")):  # a row where controls drive, else 0.1 s
        fast = asked.with_changes(time=0.02 * np.arange(len(asked.time)))
        ((of_controls,), (of_tensions,)) = (list(effect_class(late).fit_starts([s], 3)) for s in (fast, still))
        assert (of_controls.values[name], of_tensions.values[name]) == (pytest.approx(0.02), 0.1)
    limits = [s.values["limit"] for s in effect_class("actuator_saturation").fit_starts([still], 3)]
    assert limits
    assert max(limits) < still.tension.max()
    harder = still.with_changes(tension=3.0 * still.tension)
    both = effect_class("actuator_saturation").fit_starts([still, harder], 3)
    assert [s.values["limit"] for s in both] == pytest.approx([3.0 * x for x in limits])
    reached = still.markers[..., :2]
    for start in effect_class("contact").fit_starts([still], 3):
        towards = np.array([np.cos(start.values["azimuth"]), np.sin(start.values["azimuth"])])
        beyond = ((reached @ towards).max(axis=1) > start.values["distance"]).mean()
        assert 0.0 < beyond < 0.5  # touched in some samples, not in most
        assert not {"curvature", "height", "slant", "lean"} & set(start.free)
        wall = law("contact", **start.values)
        fuller = list(wall.extended_starts([still]))
        posts = [s.values for s in fuller if "curvature" in s.free]
        leaning = [s for s in fuller if "lean" in s.free]
        assert sorted(s.values["lean"] for s in leaning) == [-0.3, 0.3]
        furthest = (reached @ towards).argmax(axis=1)
        heights = still.markers[np.arange(len(furthest)), furthest, 2]
        assert all(heights.min() <= s.values["height"] <= heights.max() for s in leaning)
        assert {-0.8, 0.0, 0.8} < {post["slant"] for post in posts}
        for post in posts:
            assert {"distance", "curvature", "height", "slant"} == set(post)
            nearest = np.abs(still.markers[..., 2] - post["height"]).min(axis=0).argmin()
            touched = (reached[:, nearest] @ towards > post["distance"]).mean()
            assert touched == pytest.approx(beyond, abs=1.5 / len(reached))  # as often as the wall, to a sample
