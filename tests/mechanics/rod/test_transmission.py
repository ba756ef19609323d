"""A jaw between two antagonist tendons against closed forms, MuJoCo's own statics, and data made by a play operator."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from twin.body import Signals
from twin.diagnosis import Settings, diagnose
from twin.effects import Effect, effect_class
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.mechanics.rod.balance.tendon_actuation import LEAST_STRETCH
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.families.transmission import Jaw

TOOL = load("cable_tool")
# Cables that do not stretch at all have closed forms; no cable of the tool may be so stiff.
ROBOT = replace(TOOL, parameters=tuple(replace(p, low=0.0) if p.name == "tendons.stretch" else p for p in TOOL.parameters))
VALUES = {p.name: p.value for p in ROBOT.parameters}
DRUM, PULLEY = VALUES["drum.radius"], -VALUES["pulley.radius"]  # m; crossed
REST, WRAP, PRETENSION = VALUES["jaw.rest"], VALUES["tendons.wrap"], VALUES["tendons.pretension"]
STRETCH = 2e-4  # m/N
RIGID = {"tendons.stretch": 0.0}
ELASTIC = {"tendons.stretch": STRETCH - LEAST_STRETCH}
NOISE = np.deg2rad(0.1)  # rad


def recording(*trials: Trial) -> Recording:
    channels = (
        Channel("joint_1_angle", "input", "rad", 1e-3), Channel("joint_2_torque", "input", "N*m"),
        Channel("joint_2_angle", "output", "rad", NOISE), Channel("joint_1_torque", "output", "N*m", 1e-3),
    )  # fmt: skip
    return Recording("cable_tool", "made", "simulation", None, channels, trials)


def run(q: np.ndarray, torque: np.ndarray | float, name: str = "made.csv") -> Trial:
    """A drum turned by q (n,) rad under a load torque (n,) N m, a row every 0.04 s."""
    n = len(q)
    values = {"joint_1_angle": q, "joint_2_torque": np.broadcast_to(torque, n).astype(float)}
    return Trial(name, 0.04 * np.arange(n), {**values, "joint_2_angle": np.zeros(n), "joint_1_torque": np.zeros(n)})


def sine(n: int = 400, turns: float = 3.0, size: float = 0.5) -> np.ndarray:
    return size * np.sin(2 * np.pi * turns * np.arange(n) / n)


def solved(values: dict[str, float], effects: tuple[Effect, ...], trial: Trial) -> Signals:
    twin = Twin(ROBOT, values, effects)
    return simulate(twin, prepare(recording(trial), ROBOT))[0].true


def law(name: str, **values: float) -> Effect:
    return effect_class(name)(values, 2)


def test_the_tendons_moment_arm_in_mujoco_is_the_pulleys_radius() -> None:
    body = ROBOT.build()
    assert isinstance(body, Jaw)
    model = body.spec.compile()
    data = mujoco.MjData(model)
    turns, length = np.deg2rad([-80.0, -30.0, 0.0, 45.0, 80.0]), []
    for turn in turns:
        data.qpos[0] = REST + turn
        mujoco.mj_forward(model, data)
        length.append(data.ten_length.copy())
    # m: the arc on the pulley grows with the turn and nothing else changes, but for rounding of 0.4 m
    away = np.outer(turns, [-body.pulley, body.pulley])
    np.testing.assert_allclose(np.array(length) - length[2], away, rtol=0, atol=1e-12)


def test_where_it_stands_mujoco_finds_it_in_balance() -> None:
    torque = 0.03
    true = solved(ELASTIC, (), run(sine(), torque))
    model = ROBOT.build().spec.compile()
    data = mujoco.MjData(model)
    for k in (0, 50, 133):
        data.qpos[0], data.ctrl[:], data.qfrc_applied[0] = true.others["angle"][k, 1], true.tension[k], torque
        mujoco.mj_forward(model, data)
        # N m: two pulls of 20 N on 5 mm and the load sum to nothing, to 1e-10 of each, the solve's last step of 1e-13 m x 1e4 N/m
        assert data.qfrc_smooth[0] == pytest.approx(0.0, abs=1e-10)


def test_rigid_tendons_pass_the_drums_turn_on() -> None:
    q = sine()
    true = solved(RIGID, (), run(q, 0.0))
    np.testing.assert_allclose(true.others["angle"][:, 1], REST + DRUM / PULLEY * q, rtol=0, atol=1e-12)  # rad: no load, no stretch
    loaded = solved(RIGID, (), run(q, 0.03))
    # rad: the least stretch a tendon has, 1e-6 m/N, in two tendons side by side
    gives = LEAST_STRETCH * 0.03 / (2 * PULLEY**2)
    np.testing.assert_allclose(loaded.others["angle"][:, 1] - true.others["angle"][:, 1], gives, rtol=1e-6)
    # what goes in comes out: torque_1 dq_1 + torque_2 dq_2 = 0
    # N m: the solve's last step of 1e-13 m, over 1e-6 m/N, on 5 mm
    np.testing.assert_allclose(loaded.others["torque"][:, 0], -0.03 * DRUM / PULLEY, rtol=0, atol=1e-8)


def test_taut_tendons_give_way_side_by_side_and_a_slack_one_leaves_the_other_alone() -> None:
    taut = 2 * PRETENSION * abs(PULLEY)  # N m, at which one of them falls slack
    torque = np.array([-0.5, 0.2, 0.9, 1.5, 2.0]) * taut
    a = solved(ELASTIC, (), run(np.zeros(5), torque)).others["angle"][:, 1] - REST
    F = np.abs(torque / PULLEY)
    # both taut: F shared by two springs; else one holds F alone, STRETCH (F - PRETENSION) beyond rest
    y = np.where(F < 2 * PRETENSION, STRETCH * F / 2, STRETCH * (F - PRETENSION))
    np.testing.assert_allclose(a, np.sign(torque) * y / abs(PULLEY), rtol=1e-9)  # closed form


def test_antagonists_that_bed_in_follow_a_hyperbolic_tangent_and_then_hookes_law() -> None:
    """From exp(-d_1 / T_b) + exp(-d_2 / T_b) = 2, d_i the tensions above pretension, and d_2 - d_1 = F: y = S tanh(F / 2 T_b)."""
    S, T, torque = 4e-4, 2.0, np.linspace(-0.08, 0.08, 9)
    beds = law("tendon_elasticity", toe=S, toe_tension=T)
    a = solved(RIGID, (beds,), run(np.zeros(9), torque)).others["angle"][:, 1] - REST
    # rad: the least stretch comes on top, at most 1e-6 m/N x 16 N on 5 mm
    np.testing.assert_allclose(
        a, S * np.tanh(torque / PULLEY / 2 / T) / PULLEY, rtol=0, atol=1.01 * LEAST_STRETCH * 16 / abs(PULLEY)
    )
    true = solved(ELASTIC, (beds,), run(np.zeros(9), torque))
    above = true.tension - PRETENSION
    longer = STRETCH * above + S * -np.expm1(-above / T)
    y = PULLEY * (true.others["angle"][:, 1] - REST)
    np.testing.assert_allclose(longer, np.column_stack([-y, y]), rtol=0, atol=1e-12)  # m: both ropes are as long as their law says
    np.testing.assert_allclose(above[:, 0] - above[:, 1] + torque / PULLEY, 0.0, atol=1e-7)  # N: the last step of 1e-13 m


@pytest.mark.parametrize("torque", [0.0, 0.02, -0.08])
def test_the_loop_of_joint_friction_is_its_torque_times_the_compliance_whatever_load_and_pretension(torque: float) -> None:
    held, q = 0.01, sine()
    for pretension in (15.0, 30.0):
        rubs = law("joint_friction", torque=held, presliding=5e-3)
        a = solved({**ELASTIC, "tendons.pretension": pretension}, (rubs,), run(q, torque)).others["angle"][:, 1]
        assert width_of(a, q) == pytest.approx(2 * held * STRETCH / (2 * PULLEY**2), rel=1e-9)


@pytest.mark.parametrize("rate", [0.05, 0.4, 3.0])
@pytest.mark.parametrize(("torque", "breakaway"), [(0.006, 0.004), (0.0, 0.0)])
def test_the_loop_is_as_wide_as_the_bearing_rubs_at_the_rate(rate: float, torque: float, breakaway: float) -> None:
    """Triangles of one rate: torque + breakaway exp(-(v / v_s)^2) + viscous v, of the joint, by the pair's compliance; grease alone
    too."""
    stribeck, viscous = 0.3, 0.002
    leg = np.linspace(-0.5, 0.5, 100)
    q = np.concatenate([leg, leg[::-1], leg, leg[::-1]])
    trial = run(q, 0.01)
    trial = replace(trial, time=np.arange(len(q)) * (leg[1] - leg[0]) * abs(DRUM / PULLEY) / rate)
    rubs = law("joint_friction", torque=torque, presliding=5e-3, breakaway=breakaway, stribeck=stribeck, viscous=viscous)
    a = solved(ELASTIC, (rubs,), trial).others["angle"][:, 1]
    there, back = a[250], a[349]  # the middle of the last two legs, at one turn of the drum
    held = torque + breakaway * np.exp(-((rate / stribeck) ** 2)) + viscous * rate
    assert abs(there - back) == pytest.approx(2 * held * STRETCH / (2 * PULLEY**2), rel=1e-9)


def test_where_a_cable_falls_slack_the_capstans_loop_grows_with_the_load() -> None:
    """One cable alone holds the load F: T = F exp(+-f), so that the ways lie 2 stretch F sinh f apart; no pretension in it."""
    mu, q, pretension = 0.01, sine(), 5.0
    for torque in (0.08, 0.12):
        rubs = law("tendon_friction", mu=mu, presliding=2e-5)
        a = solved({**ELASTIC, "tendons.pretension": pretension}, (rubs,), run(q, torque)).others["angle"][:, 1]
        wide = 2 * STRETCH * abs(torque / PULLEY) * np.sinh(mu * WRAP) / abs(PULLEY)
        assert width_of(a, q) == pytest.approx(wide, rel=1e-9)


def width_of(a: np.ndarray, q: np.ndarray) -> float:
    """How far the ways lie apart (rad) in the middle of the strokes, where all slides."""
    off, rate = a - DRUM / PULLEY * q, np.gradient(q)
    sliding = (np.arange(len(q)) > 150) & (np.abs(rate) > 0.8 * np.abs(rate).max())
    return abs(off[sliding & (rate > 0)].mean() - off[sliding & (rate < 0)].mean())


@pytest.mark.parametrize("torque", [0.0, 0.02, -0.04])
def test_the_loop_of_capstan_friction_is_that_of_the_pretension_whatever_the_load(torque: float) -> None:
    """T_1 exp(-f) - T_2 exp(f) + F = 0 and T_1 + T_2 = 2 T_0 while both are taut: T_1 differs by 2 T_0 tanh f between the ways."""
    mu, q = 0.01, sine()
    a = solved(ELASTIC, (law("tendon_friction", mu=mu, presliding=2e-5),), run(q, torque)).others["angle"][:, 1]
    off = a - DRUM / PULLEY * q
    rate = np.gradient(q)
    second = np.arange(len(q)) > 150  # after the first turn
    sliding = second & (np.abs(rate) > 0.8 * np.abs(rate).max())  # in the middle of a stroke
    there, back = off[sliding & (rate > 0)], off[sliding & (rate < 0)]
    width = 2 * STRETCH * PRETENSION * np.tanh(mu * WRAP) / abs(PULLEY)
    assert np.ptp(there) + np.ptp(back) < 1e-9  # rad: fully sliding is a state, not a trend
    assert abs(there.mean() - back.mean()) == pytest.approx(width, rel=1e-9)


def test_what_friction_takes_over_a_turn_is_the_drums_loop_and_never_negative() -> None:
    n, turns = 3000, 3
    q = sine(n, turns)
    for mu in (0.0, 0.02):
        true = solved(ELASTIC, (law("tendon_friction", mu=mu),), run(q, 0.02))
        once = slice(n // turns, 2 * n // turns + 1)
        T, turn = true.others["torque"][once], true.others["angle"][once]
        work = float((0.5 * (T[1:] + T[:-1]) * np.diff(turn, axis=0)).sum())
        # J, of the 0.01 that go in: the trapezoid's error at 1,000 rows a turn
        assert work > 1e-4 if mu else abs(work) < 1e-9


def test_slack_in_both_tendons_is_a_dead_band_less_what_pretension_takes_up() -> None:
    gap = 12e-3  # m
    torque = 1e-3 * np.array([1.0, -1.0, 1.0])
    a = solved(ELASTIC, (law("tendon_backlash", gap=gap),), run(np.zeros(3), torque)).others["angle"][:, 1]
    F = abs(torque[0] / PULLEY)
    band = gap - 2 * STRETCH * PRETENSION + 2 * STRETCH * F
    np.testing.assert_allclose(np.abs(np.diff(a)), band / abs(PULLEY), rtol=1e-9)  # closed form
    still = solved(ELASTIC, (law("tendon_backlash", gap=gap),), run(sine(), 0.02)).others["angle"][:, 1]
    ratio = DRUM / PULLEY * sine()
    # rad: under a load of one sign, and without friction, slack shifts the jaw and makes no loop
    np.testing.assert_allclose(still - ratio, (still - ratio)[0], rtol=0, atol=1e-9)


def test_what_does_not_fit_a_jaw_is_refused_with_the_way_out() -> None:
    trial = run(sine(), 0.01)
    with pytest.raises(DataError, match=r"backbone_creep acts on viscosity.*cable_tool"):
        solved({}, (law("backbone_creep", amplitude=0.1),), trial)
    blind = recording(trial)
    blind = replace(blind, channels=(replace(blind.channels[0], role="context"), *blind.channels[1:]))
    with pytest.raises(DataError, match="joint_1_angle"):
        prepare(blind, ROBOT)
    pull = {f"tendon_{i}_displacement": 1e-3 * np.ones(3) for i in (1, 2, 3)} | {"tip_x": np.zeros(3)}
    inputs = tuple(Channel(f"tendon_{i}_displacement", "input", "m") for i in (1, 2, 3))
    held = Recording(
        "continuum", "made", "simulation", None, (*inputs, Channel("tip_x", "output", "m")), (Trial("a", np.arange(3.0), pull),)
    )
    with pytest.raises(DataError, match=r"joint_friction acts on friction of joints.*continuum"):
        Twin(load("continuum"), {}, (effect_class("joint_friction")({"torque": 0.01}, 3),)).predict(held)


def played(target: np.ndarray, half: np.ndarray | float) -> np.ndarray:
    """The play operator: the jaw follows `target` (n,) at a distance of `half` at most, which may change from row to row."""
    out, at = np.empty_like(target), target[0]
    for i, (t, h) in enumerate(zip(target, np.broadcast_to(half, len(target)), strict=True)):
        at = min(max(at, t - h), t + h)
        out[i] = at
    return out


def day(half: float, seed: int = 0) -> Recording:
    """Runs at two rates and four loads by closed forms: an elastic pair, its friction a play of +-`half` (rad), noise."""
    rng = np.random.default_rng(seed)
    trials = []
    for turns in (2.0, 6.0):
        for torque in (0.01, 0.02, 0.03, 0.04):
            q = sine(300, turns)
            jaw = played(0.3 + 0.95 * DRUM / PULLEY * q + STRETCH * torque / (2 * PULLEY**2), half)
            trial = run(q, torque, f"{turns:.0f}_{torque}.csv")
            trials.append(replace(trial, values={**trial.values, "joint_2_angle": jaw + rng.normal(0, NOISE, 300)}))
    made = recording(*trials)
    return replace(made, channels=tuple(replace(c, role="context") if c.name == "joint_1_torque" else c for c in made.channels))


def test_a_diagnosis_names_friction_where_there_is_friction_and_nothing_where_there_is_none() -> None:
    half = np.deg2rad(2.0)
    found = diagnose(day(half), Twin.of(ROBOT), Settings(jobs=1))
    # A play whose width no load changes is what either friction makes of it while both cables are taut: one is claimed, never both.
    (claim,) = found.claims
    both = {"tendon_friction", "joint_friction"}
    assert claim.effect in both
    assert found.runners_up[0].effect in both
    mu, torque = (claim.parameters[n].value if n in claim.parameters else 0.0 for n in ("mu", "torque"))
    held = PRETENSION * np.tanh(mu * WRAP) + torque / abs(PULLEY) / 2  # N, half of what friction holds
    # rad: half the loop of the friction found, at the stretch that the loads show; both are known to a few per cent
    assert held * found.parameters["tendons.stretch"].value / abs(PULLEY) == pytest.approx(half, rel=0.1)
    nothing = diagnose(day(0.0), Twin.of(ROBOT), Settings(jobs=1))
    assert nothing.verdict == "noise"
    assert not nothing.claims


def rubbing(rate: np.ndarray, torque: float, breakaway: float, stribeck: float, viscous: float) -> np.ndarray:
    """Stribeck's curve (N m) over the rate (rad/s)."""
    return torque + breakaway * np.exp(-((rate / stribeck) ** 2)) + viscous * np.abs(rate)


def paced_day(**curve: float) -> Recording:
    """Sines of four paces under two loads; the play's half width by `curve` at the rate that the jaw would have."""
    rng = np.random.default_rng(1)
    gives, phase, trials = STRETCH / (2 * PULLEY**2), np.linspace(0.0, 4 * np.pi, 300), []
    for period in (100.0, 20.0, 5.0, 1.0):
        for held in (0.01, 0.03):
            q, rate = 0.5 * np.sin(phase), DRUM / PULLEY * np.pi / period * np.cos(phase)
            jaw = played(0.3 + 0.95 * DRUM / PULLEY * q + gives * held, gives * rubbing(rate, **curve))
            made = run(q, held, f"{period}_{held}.csv")
            values = {**made.values, "joint_2_angle": jaw + rng.normal(0, NOISE, len(q))}
            trials.append(replace(made, time=phase / (2 * np.pi) * period, values=values))
    made = recording(*trials)
    return replace(made, channels=tuple(replace(c, role="context") if c.name == "joint_1_torque" else c for c in made.channels))


def test_a_diagnosis_tells_how_friction_depends_on_the_rate() -> None:
    curve = {"torque": 0.012, "breakaway": 0.01, "stribeck": 0.3, "viscous": 0.003}
    found = diagnose(paced_day(**curve), Twin.of(ROBOT), Settings(jobs=1))
    (claim,) = found.claims
    assert claim.effect == "joint_friction"
    rates = np.array([0.03, 0.15, 0.6, 3.0])
    seen = rubbing(rates, **{n: claim.parameters[n].value for n in curve})
    # 5 %: the jaw's rate is taken from the drive's rows, and a play has no pre-sliding
    np.testing.assert_allclose(seen, rubbing(rates, **curve), rtol=0.05)
    constant = diagnose(paced_day(torque=0.012, breakaway=0.0, stribeck=0.3, viscous=0.0), Twin.of(ROBOT), Settings(jobs=1))
    (claim,) = constant.claims
    assert claim.effect in {"joint_friction", "tendon_friction"}
    assert "viscous" not in claim.parameters, "what does not depend on the rate is not said to"
