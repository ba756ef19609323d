"""What the data can tell: by hand on patterns at a known angle, and on designs of which one thing is taken away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.diagnosis.checks.test_design import DISPLACEMENTS, TEMPERATURE, bench
from tools.simulators.rod.design import Day, bench_day
from tools.simulators.rod.effects import all_effects
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.calibration.objective import Objective
from twin.diagnosis.checks import identifiability as stage
from twin.diagnosis.checks.identifiability import Visibility, identifiability
from twin.diagnosis.evidence.first_order import Dictionary, Pattern, dictionary
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.diagnosis.thresholds import CLEAR_CHI_SQUARE
from twin.effects import FitStart, catalogue
from twin.effects.base.effect import DataNeed
from twin.prediction.prepared import PreparedRecording
from twin.prediction.twin import Twin

SIGMA = {"marker": 2.5e-4, "displacement": 5e-5, "tension": 1e-2}  # m, m, N
MATERIAL = 0.1  # sigma
WITHOUT_LOG = {"temperature_softening", "tendon_backlash", "tendon_elasticity"}


# ---- by hand ---------------------------------------------------------------------------------------------------------------

N = 100


def by_hand(*columns: np.ndarray, robot: np.ndarray) -> dict[str, Visibility]:
    """Friction, delay and payload with one column each, beside a robot with one free parameter of column `robot` (n,)."""
    effects = (("tendon_friction", "mu"), ("time_delay", "delay"), ("tip_payload", "mass"))
    patterns = (pattern(e, (p,), i) for i, ((e, p), _) in enumerate(zip(effects, columns, strict=False)))
    return of_patterns(columns, robot, *patterns)


def pattern(effect: str, names: tuple[str, ...], *where: int) -> Pattern:
    return Pattern(effect, FitStart({}, names), names, where)


def of_patterns(columns: Sequence[np.ndarray], robot: np.ndarray, *patterns: Pattern) -> dict[str, Visibility]:
    free: Any = (SimpleNamespace(parameter=SimpleNamespace(std=None, step=1.0)),)
    base: Any = SimpleNamespace(J=robot[:, None], model=SimpleNamespace(free=free), at_bound=lambda: np.zeros(1, bool))
    objective: Any = SimpleNamespace(prepared=bench(bench_day("default", np.random.default_rng(0))), n=N)
    table = identifiability(objective, base, Dictionary(tuple(patterns), np.stack(columns, axis=1)), MATERIAL)
    return {v.effect: v for v in table}


def along(*parts: float) -> np.ndarray:
    """A column (n,) with these components, each as long as one sigma in every sample."""
    return np.sqrt(N) * np.eye(N)[:, : len(parts)] @ np.array(parts)


@pytest.mark.parametrize("angle", [90.0, 30.0, 5.0])
def test_what_is_told_apart_is_the_angle_between_patterns(angle: float) -> None:
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    found = by_hand(along(0, 1, 0), along(0, c, s), robot=along(1, 0, 0))
    for v, rival in ((found["tendon_friction"], "time_delay"), (found["time_delay"], "tendon_friction")):
        assert v.rival == rival
        assert v.share == pytest.approx(s**2, rel=1e-5)  # the solve is held by 1e-9 of the pattern, 1e-7 of sin^2(5 degrees)
        # Five standard errors of a parameter of which n samples show one sigma a unit: 5 / sqrt(n), over sin(angle) by a rival.
        assert v.seen == pytest.approx(0.5)
        assert v.apart == pytest.approx(0.5 / s, rel=1e-5)
        assert v.smallest[1] == pytest.approx(0.5 / s, rel=1e-5)  # one unit leaves one sigma
    assert found["time_delay"].smallest[::2] == ("delay", "s")
    assert CLEAR_CHI_SQUARE == 25.0


def test_each_law_of_a_name_has_its_own_row_and_is_no_rival_of_the_other() -> None:
    """A toe is half a lag's, a stretch all a payload's; of a rival the law counts that imitates best."""
    ropes = "tendon_elasticity"
    columns = [along(0, 1, 0, 0), along(0, 0, 1, 0), along(0, 1, 0, 1), along(0, 0, 2, 0)]
    objective: Any = SimpleNamespace(prepared=bench(bench_day("default", np.random.default_rng(0))), n=N)
    amplitudes = ((ropes, "toe"), (ropes, "stretch"), ("time_delay", "delay"), ("tip_payload", "mass"))
    patterns = tuple(pattern(effect, (name,), i) for i, (effect, name) in enumerate(amplitudes))
    free: Any = (SimpleNamespace(parameter=SimpleNamespace(std=None, step=1.0)),)
    base: Any = SimpleNamespace(J=along(1, 0, 0, 0)[:, None], model=SimpleNamespace(free=free), at_bound=lambda: np.zeros(1, bool))
    table = identifiability(objective, base, Dictionary(patterns, np.stack(columns, axis=1)), MATERIAL)
    found = {(v.effect, v.form): v for v in table}
    assert set(found) == {(ropes, "toe"), (ropes, "stretch"), ("time_delay", ""), ("tip_payload", "")}
    assert (found[ropes, "toe"].rival, found[ropes, "toe"].smallest[0]) == ("time_delay", "toe")
    assert found[ropes, "toe"].share == pytest.approx(0.5, rel=1e-5)
    assert (found[ropes, "stretch"].rival, found[ropes, "stretch"].smallest[0]) == ("tip_payload", "stretch")
    assert found[ropes, "stretch"].share == pytest.approx(0.0, abs=1e-5)
    assert found["tip_payload", ""].share == pytest.approx(0.0, abs=1e-5), "by the stretch, not by the toe that came first"
    assert found["time_delay", ""].share == pytest.approx(0.5, rel=1e-5), "by the toe, not by the stretch that came last"


def test_what_the_robot_imitates_is_not_seen() -> None:
    found = by_hand(along(1, 0, 0), along(1, 1, 0), along(0, 0, 10), robot=along(1, 0, 0))
    never = found["tendon_friction"]
    assert (never.seen, never.apart, never.share, never.smallest[1]) == (np.inf, np.inf, 0.0, np.inf)
    half = found["time_delay"]  # of a unit, one sigma of the two parts is left
    assert half.share == pytest.approx(1.0)
    assert half.smallest[1] == pytest.approx(0.5)
    assert found["tip_payload"].smallest[1] == pytest.approx(0.05)  # ten sigmas a unit


def test_nothing_below_what_is_material_is_promised() -> None:
    tiny = 100.0 * along(0, 1, 0)
    found = by_hand(tiny, robot=along(1, 0, 0))["tendon_friction"]
    assert (found.rival, found.share) == ("", 1.0)
    assert found.apart == 0.5
    assert found.smallest[1] == pytest.approx(0.005)


def test_two_that_are_one_are_never_told_apart() -> None:
    found = by_hand(along(0, 1), along(0, -2), robot=along(1, 0))
    for v in found.values():
        assert np.isfinite(v.seen)
        assert v.apart > 1e3  # sigma: rounding may leave a share of some 1e-9


@pytest.mark.parametrize("left", [0.0, -1e-12])
def test_where_a_rival_leaves_nothing_no_size_is_told_apart(left: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage, "_left", lambda A, i, j: left)
    for v in by_hand(along(0, 1), along(0, -2), robot=along(1, 0)).values():
        assert (v.share, v.apart, v.smallest[1]) == (0.0, np.inf, np.inf)
        assert np.isfinite(v.seen)


def test_what_a_design_lacks_is_said_of_what_it_blinds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage, "shortcomings", lambda bench: [DataNeed.TWO_RATES, DataNeed.REVERSALS, DataNeed.RANDOM_ORDER])
    found = by_hand(along(1, 0), along(0, 1), robot=along(1, 0))
    assert {e: v.lacking for e, v in found.items()} == {
        "tendon_friction": ("loading and unloading",),
        "time_delay": ("two rates of pull, ten times apart",),
    }
    assert np.isinf(found["tendon_friction"].seen)


def test_what_moves_nothing_is_never_seen() -> None:
    """As where a pattern has no equilibrium."""
    found = by_hand(along(0, 0), along(0, 1), robot=along(1, 0))
    assert (found["tendon_friction"].seen, found["tendon_friction"].rival) == (np.inf, "")
    assert found["time_delay"].share == pytest.approx(1.0)


@pytest.mark.parametrize("unit", [1e-5, 1e5])
def test_the_share_is_the_same_in_whatever_units(unit: float) -> None:
    """Held by a billionth of the rival's own pattern, of several sizes."""
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    found = by_hand(unit * along(0, 1, 0), unit * along(0, c, s), robot=along(1, 0, 0))
    assert found["tendon_friction"].share == pytest.approx(0.25, rel=1e-5)
    assert found["tendon_friction"].smallest[1] == pytest.approx(1.0 / unit, rel=1e-5)


def test_of_several_rivals_the_closest_is_named() -> None:
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    found = by_hand(along(0, 1, 0), along(0, c, s), along(0, s, c), robot=along(1, 0, 0))
    assert {e: v.rival for e, v in found.items()} == {
        "tendon_friction": "time_delay",
        "time_delay": "tendon_friction",
        "tip_payload": "time_delay",
    }
    assert found["tip_payload"].share == pytest.approx(0.25)


def test_of_several_parameters_all_are_imitated_and_the_plainest_is_told() -> None:
    """Two of a tilt, 1 and 2 sigma a unit, along axes 1 and 2; friction half on the second and half on the third; of two starts,
    one on axis 1 and one on axes 1 and 2, the second takes all of the tilt."""
    columns = [along(0, 1, 0, 0), along(0, 0, 2, 0), along(0, 0, 1, 1)]
    tilt, friction = pattern("base_tilt", ("about_x", "about_y"), 0, 1), pattern("tendon_friction", ("mu",), 2)
    found = of_patterns(columns, along(1), tilt, friction)
    assert found["base_tilt"].share == pytest.approx(0.6)  # 1 + 4 / 2 of 1 + 4
    assert found["tendon_friction"].share == pytest.approx(0.5)
    name, value, _ = found["base_tilt"].smallest
    assert (name, value) == ("about_y", pytest.approx(0.25 / np.sqrt(0.6)))
    frictions = pattern("tendon_friction", ("mu",), 0), pattern("tendon_friction", ("mu", "presliding"), 0, 1)
    found = of_patterns(columns, along(1), tilt, pattern("time_delay", ("delay",), 2), *frictions)
    assert found["base_tilt"].rival == "tendon_friction"
    assert found["base_tilt"].apart > 1e3
    assert found["tendon_friction"].smallest[0] == "presliding"
    assert found["time_delay"].rival in ("base_tilt", "tendon_friction")


# ---- designs ---------------------------------------------------------------------------------------------------------------


def planned() -> Day:
    day = bench_day("hanging", np.random.default_rng(0))
    return replace(day, trials=tuple(t for t in day.trials if t.name in ("slow_1", "hold_2", "pair_3", "wander_2", "fast_1")))


def table(planned: PreparedRecording) -> dict[str, Visibility]:
    """Rows by effect for the robot as described; nothing is fitted, nothing has been measured."""
    trials, outputs = list(range(len(planned.inputs))), planned.outputs
    noise = Noise(np.array([SIGMA[o.group] for o in outputs]), np.zeros(3), np.zeros(len(outputs)), "by hand")
    exact = [np.zeros((*y.shape, 3)) for y in planned.measured]
    whitener = Whitener(noise, planned.measured, exact, [i.command for i in planned.inputs])
    objective = Objective(planned, trials, whitener, jobs=1)
    model = Model.base(planned.robot, Twin.of(planned.robot))
    at = objective.evaluate(model)
    base = Fit(at, objective.jacobian(at, range(len(model.free))), 0.0)
    return {v.effect: v for v in identifiability(objective, base, dictionary(objective, base), MATERIAL)}


@pytest.fixture(scope="module")
def usual() -> dict[str, Visibility]:
    return table(bench(planned()))


def test_every_effect_has_a_row_and_only_what_is_not_logged_is_never_seen(usual: dict[str, Visibility]) -> None:
    backbone = {
        name
        for name, law in catalogue().items()
        if not law.needs
        & {"strain sensors", "drifting sensors", "friction of joints", "load friction", "joints", "encoders", "stops"}
    }
    of_lengths = {name for name in backbone if all_effects()[name].driven_by_length}  # tensions are commanded here
    of_springs = {name for name, law in catalogue().items() if law(n_tendon=3).acts_in("spring")}  # none pull here
    assert set(usual) == backbone - of_springs - of_lengths
    for effect, v in usual.items():
        assert 0.0 <= v.share <= 1.0
        assert v.seen <= v.apart
        assert v.apart >= MATERIAL
        never = effect in WITHOUT_LOG
        assert np.isinf([v.seen, v.apart, v.smallest[1]]).all() == never
        assert bool(v.rival) != never
    assert usual["temperature_softening"].lacking == (TEMPERATURE,)
    assert usual["tendon_elasticity"].lacking == (DISPLACEMENTS,)
    assert usual["base_tilt"].lacking == ()
    order = [v.apart for v in usual.values()]
    assert order == sorted(order)


def test_twins_of_each_other_are_named(usual: dict[str, Visibility]) -> None:
    """A cell's gain and a hole's radius bend the robot alike; a gradient along the body is like nothing else."""
    assert usual["load_cell_gain"].rival == "tendon_routing"
    assert usual["tendon_routing"].rival == "load_cell_gain"
    assert usual["load_cell_gain"].share < 0.02
    assert usual["stiffness_gradient"].share > 0.5


def test_what_is_logged_is_seen() -> None:
    more = table(bench(planned(), displacement=True, room=True))
    assert all(np.isfinite(v.seen) for v in more.values())
    # Slack of five standard errors in some 300 readings of 0.05 mm: 0.015 mm where nothing else moves alike.
    name, gap, unit = more["tendon_backlash"].smallest
    assert (name, unit) == ("gap", "m")
    assert 1e-5 < gap < 2e-4


def test_one_payload_hides_a_tilt_and_leaves_friction_alone(usual: dict[str, Visibility]) -> None:
    day = planned()
    bare = table(bench(replace(day, trials=tuple(replace(t, payload=0.0) for t in day.trials))))
    lacks = ("two payloads, or two mounts",)
    assert bare["base_tilt"].lacking == lacks
    # Hanging with one load a tilt is nearly a curvature: a fifth to a tenth of its share is left on the days looked at.
    assert bare["base_tilt"].rival == "backbone_precurvature"
    assert bare["base_tilt"].share < 0.5 * usual["base_tilt"].share
    assert bare["base_tilt"].apart > usual["base_tilt"].apart
    assert bare["tendon_friction"].lacking == ()
    assert bare["tendon_friction"].share == pytest.approx(usual["tendon_friction"].share, rel=0.3)


def test_a_tip_alone_tells_less_of_where(usual: dict[str, Visibility]) -> None:
    tip = table(bench(replace(planned(), tip_only=True)))
    for effect in ("stiffness_gradient", "camera_misalignment"):
        assert tip[effect].lacking == ("three markers along the body",)
        assert tip[effect].share < 0.75 * usual[effect].share
        assert tip[effect].apart > usual[effect].apart
    assert tip["backbone_creep"].lacking == ()
