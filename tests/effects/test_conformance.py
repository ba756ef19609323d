"""What every effect in the folder must satisfy, asked of all of them, also of those not yet written."""

from __future__ import annotations

import doctest
import importlib
import itertools
import sys
from dataclasses import replace

import numpy as np
import pytest

from twin.body import Drive
from twin.effects import Effect, catalogue, effect_class
from twin.effects.base.chain import EffectChain
from twin.foundation.errors import SolveError, TwinError
from twin.foundation.parameters import Size
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.simulate import output_columns, simulate
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.effect_tables import read_effects

FIXED = {
    "tendon_friction", "tendon_backlash", "tendon_elasticity", "tendon_routing", "actuator_saturation", "actuator_lag",
    "time_delay",
    "sma_hysteresis", "sma_cooling", "backbone_creep", "backbone_precurvature", "stiffness_asymmetry", "stiffness_gradient",
    "temperature_softening", "base_tilt", "camera_misalignment", "tip_payload", "contact", "load_cell_gain", "load_cell_bias",
    "load_cell_drift", "load_cell_crosstalk", "sensor_gain", "sensor_drift", "sensor_hysteresis",
    "drive_zero", "load_dependent_friction", "reflected_inertia", "actuator_gain", "joint_stiffness", "joint_stop",
    "encoder_offset",
}  # fmt: skip
NEW = {
    "backbone_ageing",
    "transmission_error",
    "joint_friction",
}  # identifiers of our own, beside those of the contract

laws = pytest.mark.parametrize("law", catalogue().values(), ids=catalogue().keys())


def channels(heated: bool, felt: bool = False) -> tuple[Channel, ...]:
    """Drive by tensions, by the currents of springs for laws that act on those, or, of a finger that is felt, by lengths."""
    if felt:
        pulls = (Channel(f"tendon_{i}_displacement", "input", "mm", 1e-5) for i in (1, 2, 3, 4))
        return (*pulls, *(Channel(f"sensor_{i}_resistance", "output", "ohm", 0.3) for i in (1, 2, 3, 4)))
    drive = (
        Channel(f"sma_{i}_current", "input", "A", 3e-3) if heated else Channel(f"tendon_{i}_tension", "input", "N", 0.01)
        for i in (1, 2, 3)
    )
    disks = (Channel(f"disk_{k}_{a}", "output", "mm", 2.5e-4) for k in (4, 8) for a in "xyz")
    return (*drive, *disks, *(Channel(f"tendon_{i}_displacement", "output", "mm", 2e-5) for i in (1, 2, 3)))


def cycle(name: str, start: float, peak: float, payload: float, heated: bool = False) -> Trial:
    """Tendon 1 up and down, tendon 2 following a quarter behind: a closed loop in tension, or, slower, in current."""
    n = 41
    time = np.linspace(0.0, 100.0 if heated else 20.0, n)
    angle = 2 * np.pi * np.arange(n) / (n - 1)
    tension = np.stack([0.5 * peak * (1 - np.cos(angle)), 0.25 * peak * (1 - np.sin(angle)), np.full(n, 0.2)], axis=1)
    if heated:  # every spring hot enough to pull
        tension[:, 1], tension[:, 2] = 2.0 * tension[:, 1], 2.5
    drive = {
        f"sma_{i + 1}_current" if heated else f"tendon_{i + 1}_tension": tension[:, i] * (0.4 if heated else 1.0) for i in range(3)
    }
    values = {c.name: np.zeros(n) for c in channels(heated)} | drive
    return Trial(name, time, values, {"tip_payload": payload, "ambient_temperature": 300.15}, start=start)


def bend(name: str, start: float, peak: float) -> Trial:
    """The finger pulled by tendon 1 and released, tendon 2 following, the others paid out; m."""
    n = 41
    angle = 2 * np.pi * np.arange(n) / (n - 1)
    pulls = np.stack([0.5 * peak * (1 - np.cos(angle)), 0.25 * peak * (1 - np.sin(angle)), *np.full((2, n), -6e-3)], axis=1)
    values = {c.name: np.zeros(n) for c in channels(False, True)}
    return Trial(
        name, np.linspace(0.0, 20.0, n), values | {f"tendon_{i + 1}_displacement": pulls[:, i] for i in range(4)}, {}, start=start
    )


JAW = (
    Channel("joint_1_angle", "input", "rad", 1e-3), Channel("joint_2_torque", "input", "N*m"),
    Channel("joint_2_angle", "output", "rad", 1e-3),
)  # fmt: skip


def turned(name: str, start: float, torque: float) -> Trial:
    """The drum of a jaw turned there and back under a load (N m)."""
    n = 41
    q = 0.5 * np.sin(2 * np.pi * np.arange(n) / (n - 1))
    values = {"joint_1_angle": q, "joint_2_torque": np.full(n, torque), "joint_2_angle": np.zeros(n)}
    return Trial(name, np.linspace(0.0, 20.0, n), values, start=start)


LEG = (
    Channel("actuator.hip_servo.ctrl", "input", "rad"), Channel("actuator.knee_winch.ctrl", "input", "m"),
    *(Channel(f"joint.{joint}.position", "output", "rad", 1e-3) for joint in ("hip", "knee")),
    *(Channel(f"site.foot_tip.{a}", "output", "m", 2e-4) for a in "xz"),
)  # fmt: skip
OF_MODELS = {"load friction", "joints", "encoders", "stops"}  # features that an MJCF's body alone has


def stepped(name: str, start: float, size: float) -> Trial:
    """A leg that swings and bends twice in two seconds."""
    n = 101
    wave = np.sin(4 * np.pi * np.arange(n) / (n - 1))
    values = {"actuator.hip_servo.ctrl": size * wave, "actuator.knee_winch.ctrl": 0.01 * size * (1.0 + wave)}
    return Trial(name, np.linspace(0.0, 2.0, n), {c.name: np.zeros(n) for c in LEG} | values, start=start)


def is_of_models(law: type[Effect]) -> bool:
    """Whether it acts on joints, actuators or encoders of an MJCF only."""
    return bool(law.needs & OF_MODELS)


def drives(law: type[Effect]) -> int:
    """The number of drives of a robot that it acts on; an MJCF's names its joints."""
    return load("tendon_leg").n_tendon if is_of_models(law) else 3


def recording(*trials: Trial) -> Recording:
    if "actuator.hip_servo.ctrl" in trials[0].values:
        return Recording("tendon_leg", "conformance", "simulation", None, LEG, trials)
    if "joint_1_angle" in trials[0].values:
        return Recording("cable_tool", "conformance", "simulation", None, JAW, trials)
    felt, heated = "sensor_1_resistance" in trials[0].values, "sma_1_current" in trials[0].values
    robot = "finger" if felt else "continuum"
    return Recording(robot, "conformance", "simulation", np.array([0.0, 0.0, 9.81]), channels(heated, felt), trials)


@pytest.fixture
def two_trials(law: type[Effect]) -> Recording:
    if is_of_models(law):
        return recording(stepped("a.csv", 0.0, 0.5), stepped("b.csv", 160.0, 0.3))
    if is_of_sensors(law):
        return recording(bend("a.csv", 0.0, 6e-3), bend("b.csv", 160.0, 4e-3))
    if is_of_antagonists(law):
        return recording(turned("a.csv", 0.0, 0.02), turned("b.csv", 160.0, 0.05))
    heated = is_of_springs(law)
    return recording(cycle("a.csv", 0.0, 3.0, 0.0, heated), cycle("b.csv", 160.0, 2.0, 0.02, heated))


def is_of_sensors(law: type[Effect]) -> bool:
    """Whether it needs strain-sensing cords, which a backbone has not."""
    return bool(law.needs & {"strain sensors", "drifting sensors"})


def is_of_antagonists(law: type[Effect]) -> bool:
    """Whether it needs two tendons that pull against each other on a joint."""
    return "friction of joints" in law.needs


def is_of_springs(law: type[Effect]) -> bool:
    return law(n_tendon=drives(law)).acts_in("spring")


def predict(effects: tuple[Effect, ...], data: Recording) -> list[np.ndarray]:
    twin = Twin(load(data.robot), {}, effects)
    bench = prepare(data, twin.robot)
    return [output_columns(bench, EffectChain(effects).sense(t.true)) for t in simulate(twin, bench)]


@laws
def test_it_says_what_it_is(law: type[Effect]) -> None:
    module = sys.modules[law.__module__]
    assert law.id == module.__name__.rpartition(".")[2]
    assert law.id in FIXED | NEW
    text = law.__doc__ or ""
    assert "Source:" in text
    assert "=" in text.split("Source:")[0], "the docstring gives the law as an equation"
    assert ">>> " in text
    assert doctest.testmod(importlib.import_module(law.__module__)).attempted > 0
    assert doctest.testmod(importlib.import_module(law.__module__)).failed == 0
    assert law.moves_with
    for other in law.confusable_with:
        assert law.id in effect_class(other).confusable_with, "kinship is mutual"


@laws
def test_its_parameters_have_units_bounds_and_sources(law: type[Effect]) -> None:
    declared = law.all_parameters(drives(law))
    assert declared
    assert len({p.name for p in declared}) == len(declared)
    for p in declared:
        assert p.unit
        assert p.source
        assert p.low <= p.value <= p.high
        assert p.low < p.high
        assert p.step > 0
    assert set(law.inactive_when_off) | set(law.extended_parameters) <= {p.name for p in declared}


@laws
def test_off_is_the_plain_twin(law: type[Effect], two_trials: Recording) -> None:
    plain, off = predict((), two_trials), predict((law(n_tendon=load(two_trials.robot).n_tendon),), two_trials)
    for a, b in zip(plain, off, strict=True):
        # 1e-12 m: the same computation; a law that is off may at most reorder a rounding
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-12)


@laws
def test_unknown_parameters_and_broken_bounds_are_refused(law: type[Effect]) -> None:
    with pytest.raises(TwinError, match=rf"effect {law.id}.*available"):
        law({"nonsense": 1.0}, drives(law))
    p, problems = law.all_parameters(drives(law))[0], []
    with pytest.raises(TwinError, match=rf"effect {law.id}.*allowed"):
        law({p.name: np.nan}, drives(law))
    # The bounds of a robot's size are those of files that name a robot.
    beyond = {"id": law.id, "parameters": {p.name: p.high + 1.0 + abs(p.high)}}
    assert read_effects([beyond], drives(law), Size(), problems) == []
    assert [f"effect {law.id}" in said and "allowed" in said for said in problems] == [True]


@laws
@pytest.mark.parametrize("n_tendon", [1, 3])
def test_fits_may_start_without_a_prediction(law: type[Effect], n_tendon: int) -> None:
    assert all(set(start.values) <= {p.name for p in law.all_parameters(n_tendon)} for start in law.fit_starts([], n_tendon))


def starts(law: type[Effect], data: Recording) -> list[Effect]:
    """The law as its fits begin, at most four of them."""
    robot = load(data.robot)
    bench, n = prepare(data, robot), robot.n_tendon
    predicted = [t.true for t in simulate(Twin(robot), bench)]
    held = [
        s.with_changes(drives=(Drive.DISPLACEMENT,) * n) for s in predicted
    ]  # some laws are sought only where displacements command
    found = list(law.fit_starts(predicted, n)) or list(law.fit_starts(held, n))
    assert found, "a law needs somewhere to start a fit"
    return [law({**s.values}, n) for s in found[:4]]


def by_length(data: Recording) -> Recording:
    """The same motion commanded by lengths; a tendon that hardly pulled is paid out by 2 mm, or three would fight each other."""
    bench = prepare(data, load(data.robot))
    drives = tuple(Channel(f"tendon_{i}_displacement", "input", "mm", 2e-5) for i in (1, 2, 3))
    disks = tuple(c for c in data.channels if c.name.startswith("disk"))
    trials = []
    for trial, trace in zip(data.trials, simulate(Twin(bench.robot), bench), strict=True):
        lengths = trace.true.displacement - 2e-3 * np.exp(-trace.true.tension / 0.15)
        seen = {c.name: trial.values[c.name] for c in disks}
        trials.append(replace(trial, values=seen | {c.name: u for c, u in zip(drives, lengths.T, strict=True)}))
    return replace(data, channels=(*drives, *disks), trials=tuple(trials))


@laws
def test_it_does_something_where_its_fits_begin(law: type[Effect], two_trials: Recording) -> None:
    effects = starts(law, two_trials)
    commanded = two_trials if law.id not in {"drive_zero", "actuator_gain"} else by_length(two_trials)
    plain = predict((), commanded)
    for effect in effects:
        moved = predict((effect,), commanded)
        change = max(np.abs(a - b).max() for a, b in zip(plain, moved, strict=True))
        if is_of_sensors(law):
            assert 0.05 < change < 300.0  # ohm: more than a cord's last digit, less than a third of it
        elif is_of_models(law):
            assert 1e-5 < change < 0.5  # rad or m: more than a hundredth of an encoder's count, less than the leg's swing
        elif is_of_antagonists(law):
            assert 1e-3 < change < 0.5  # rad: more than an encoder's count, less than the drum's turn
        else:
            assert 1e-6 < change < 0.05  # m: more than a micrometre, less than half the robot


@pytest.mark.parametrize("law", [effect_class("actuator_saturation")])
def test_a_stroke_that_ends_does_something_where_lengths_command(law: type[Effect], two_trials: Recording) -> None:
    pulled = by_length(two_trials)
    plain, effects = predict((), pulled), starts(law, pulled)
    assert all(e["loss_1"] + e["loss_2"] + e["loss_3"] > 0.0 or np.isfinite(e.route().stall_tension) for e in effects)
    for effect in effects:
        change = max(np.abs(a - b).max() for a, b in zip(plain, predict((effect,), pulled), strict=True))
        assert 1e-6 < change < 0.05  # m, as above


@laws
def test_trials_are_independent_but_for_the_clock(law: type[Effect], two_trials: Recording) -> None:
    for effect in starts(law, two_trials)[:1]:
        together = predict((effect,), two_trials)
        if effect.deform().amplitude:
            pytest.skip("creep carries over from trial to trial by its nature; its own test is in test_twin.py")
        for k, trial in enumerate(two_trials.trials):
            alone = predict((effect,), recording(trial))
            assert np.array_equal(alone[0], together[k]), "batch and serial must agree bit for bit"


@laws
def test_no_nan_at_the_corners_of_its_bounds(law: type[Effect]) -> None:
    if is_of_models(law):
        one = stepped("a.csv", 0.0, 0.5)
    else:
        one = bend("a.csv", 0.0, 4e-3) if is_of_sensors(law) else cycle("a.csv", 0.0, 2.0, 0.0, is_of_springs(law))
    data = recording(turned("a.csv", 0.0, 0.02) if is_of_antagonists(law) else one)
    n = load(data.robot).n_tendon
    corners = itertools.product(*[(p.low, p.high) for p in law.all_parameters(n)[:4]])
    solved = 0
    for corner in corners:
        values = {p.name: v for p, v in zip(law.all_parameters(n)[:4], corner, strict=True)}
        try:
            predicted = predict((law(values, n),), data)
        except SolveError:
            continue  # a robot past its limits says so
        assert all(np.isfinite(y).all() for y in predicted)
        solved += 1
    assert solved > 0


@laws
def test_a_closed_cycle_takes_energy_and_gives_none(law: type[Effect]) -> None:
    """Work of the motors over a closed loop of tension, the second time round: lost in friction and creep, never gained."""
    if is_of_springs(law):
        pytest.skip("heat drives springs: what a loop of theirs takes is asked in test_sma.py")
    if is_of_sensors(law):
        pytest.skip("a sensor does no work")
    if is_of_models(law):
        pytest.skip("a leg in motion holds kinetic energy: friction of a swing is in tests/mechanics/mjcf")
    once = turned("a.csv", 0.0, 0.02) if is_of_antagonists(law) else cycle("a.csv", 0.0, 3.0, 0.0)
    time = np.concatenate([once.time, once.time[-1] + once.time[1:]])
    twice = replace(once, time=time, values={k: np.concatenate([v, v[1:]]) for k, v in once.values.items()})
    for effect in starts(law, recording(once))[:2]:
        if effect.acts_in("sense", "command"):
            pytest.skip("a sensor does no work")
        data = recording(twice)
        twin = Twin(load(data.robot), {}, (effect,))
        true = simulate(twin, prepare(data, twin.robot))[0].true
        n = len(once.time)
        T, d = true.tension[n - 1 :], true.displacement[n - 1 :]
        work = float((0.5 * (T[1:] + T[:-1]) * np.diff(d, axis=0)).sum())
        # An elastic loop closes to the trapezoid's error: 4e-6 J either way for a wall's kink between two of 40 samples (3e-7 with
        # 160, 1e-9 with 640), 1e-9 J for the others; friction and creep lose more.
        assert work > -5e-6
        if law.id in ("tendon_friction", "joint_friction", "backbone_creep"):
            assert work > 1e-5


def test_an_unknown_effect_lists_those_there_are() -> None:
    with pytest.raises(TwinError, match=r"no effect named 'tendon_frictoin'; available: .*tendon_friction"):
        effect_class("tendon_frictoin")
