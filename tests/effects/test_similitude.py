"""Laws hold on robots of other sizes: by dimensional analysis, and of a strong one's load cell."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from tools.benchmarks.diagnosis.similitude import factor, resized
from twin.body import Signals
from twin.diagnosis import Settings
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.calibration.model import Model
from twin.effects import catalogue, effect_class
from twin.effects.base.scaling import at_reference_size, scaled_parameters, scaled_starts
from twin.foundation.errors import DataError, TwinError
from twin.foundation.parameters import SIZE_EXPONENTS, Parameter, Size
from twin.measurements import read
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.robot import models_folder

FRIDAY = models_folder() / "continuum" / "samples" / "friday"
LENGTHS, MASSES = 3.0, 20.0
# Quantities that a robot's length and force do not change: who adds a unit says here or in POWERS which it is.
OF_NO_SIZE = {"1", "rad", "s", "1/s", "rad/s", "K", "1/K", "W/K", "A"}


@pytest.mark.parametrize("law", catalogue().values(), ids=list(catalogue()))
def test_every_unit_of_a_law_is_known_to_grow_or_not(law: type) -> None:
    for parameter in law.all_parameters(3):  # type: ignore[attr-defined]
        assert (parameter.unit in SIZE_EXPONENTS) != (parameter.unit in OF_NO_SIZE), parameter.unit


@pytest.mark.parametrize("unit", sorted(SIZE_EXPONENTS))
def test_powers_are_those_of_dimensional_analysis(unit: str) -> None:
    """Against pint's dimensions, where lengths grow and times with their root, and N/s and N*m*s, whose times stay, apart."""
    late = {"N/s": -1, "N*m*s/rad": 1}.get(unit, 0)
    assert Size(LENGTHS, MASSES).factor(unit) * LENGTHS ** (0.5 * late) == pytest.approx(factor(unit, LENGTHS, MASSES))


def test_the_nominal_robot_has_size_one_and_a_similar_one_its_factors(tmp_path: Path) -> None:
    assert load("continuum").size == Size(1.0, 1.0)
    resized(FRIDAY, tmp_path, LENGTHS, MASSES)
    assert load(str(tmp_path / "robot")).size == Size(LENGTHS, MASSES)


# One value a law of the nominal robot that moves it by 0.3 mm and more; laws of time alone grow with nothing.
MOVING = {
    "actuator_saturation": {"loss": 0.4, "limit": 1.5, "corner": 0.2},
    "backbone_precurvature": {"about_x": 1.0, "slope": 0.5},
    "camera_misalignment": {"turn_x": 0.02, "shift_y": 2e-3},
    "contact": {"stiffness": 50.0, "azimuth": 0.5, "distance": 0.02},
    "load_cell_bias": {"bias_1": 0.15},
    "tendon_friction": {"mu": 0.2},
    "tendon_routing": {"radius_1": 1e-3, "angle_2": 0.1},
    "tip_payload": {"mass": 5e-3},
}


def tips(twin: Twin, folder: Path) -> np.ndarray:
    """(n, 3) m, of the last disk in the first two trials of a set."""
    trials = replace(read(folder), trials=read(folder).trials[:2])
    return np.concatenate([np.stack([t.values[f"disk_8_{a}"] for a in "xyz"], axis=1) for t in twin.predict(trials).trials])


@pytest.mark.parametrize("effect", MOVING)
def test_a_similar_robot_under_a_similar_law_moves_alike(effect: str, tmp_path: Path) -> None:
    """The last disk at three times the place, to 2e-5 of the robot's length, twenty times what the solver is asked for. What is not
    given, such as the travel over which friction reverses, grows too."""
    day = resized(FRIDAY, tmp_path, LENGTHS, MASSES)
    size, law, values = Size(LENGTHS, MASSES), effect_class(effect), MOVING[effect]
    units = {p.name: p.unit for p in law.all_parameters(3)}
    seen = []
    for robot, folder, grown in ((load("continuum"), FRIDAY, Size()), (load(str(tmp_path / "robot")), day, size)):
        model = Model(Twin(robot), ()).with_effect(effect, {n: v * grown.factor(units[n]) for n, v in values.items()}, (), 3)
        seen.append(tips(model.twin, folder) / grown.length)
        assert np.abs(seen[-1] - tips(Twin(robot), folder) / grown.length).max() > 3e-4, "it moves nothing"
    assert np.abs(seen[1] - seen[0]).max() < 2e-5 * 0.12
    back = at_reference_size(model.twin.effects[0], size)
    assert {n: back[n] for n in values} == pytest.approx(values)


def test_starts_and_bounds_grow_with_the_robot() -> None:
    rng, size, n = np.random.default_rng(0), Size(0.5, 0.1), 50
    tension, still = rng.uniform(0.0, 3.0, (n, 3)), np.zeros(n)
    one = Signals(np.arange(n) * 1.0, np.arange(n) * 1.0, tension, 0.01 * tension, rng.normal(0.0, 0.05, (n, 8, 3)), still)
    small = one.with_changes(tension=0.1 * one.tension, displacement=0.5 * one.displacement, markers=0.5 * one.markers)
    for name, law in catalogue().items():
        units = {p.name: p.unit for p in law.all_parameters(3)}
        own = [{k: v * size.factor(units[k]) for k, v in s.values.items()} for s in law.fit_starts([one], 3)]
        assert [s.values for s in scaled_starts(law, [small], 3, size)] == [pytest.approx(v) for v in own], name
        for p, q in zip(law.all_parameters(3), scaled_parameters(law, 3, size), strict=True):
            by = size.factor(p.unit)
            assert (q.low, q.value, q.high, q.step) == pytest.approx((p.low * by, p.value * by, p.high * by, p.step * by))


def test_a_value_that_some_robot_has_is_taken_and_one_that_none_has_is_not() -> None:
    assert effect_class("load_cell_bias")({"bias_1": 40.0})["bias_1"] == 40.0
    for effect, values in (
        ("tip_payload", {"mass": -1e-9}),
        ("tendon_friction", {"presliding": 0.0}),
        ("base_tilt", {"about_x": 0.7}),
    ):
        with pytest.raises(TwinError, match=next(iter(values))):
            effect_class(effect)(values)
    assert Parameter("mass", 0.0, "kg", 0.0, 0.1, "").without_size_bounds.high == np.inf


def test_a_strong_robots_load_cell_is_off_by_newtons(tmp_path: Path) -> None:
    """3.2 N of 60, written into the readings of the bundled sample made twenty times as strong: beyond the range of the nominal
    robot's cells. Found to 0.2 N, a sixteenth: the bench's friction is of another law."""
    day = resized(FRIDAY, tmp_path, LENGTHS, MASSES)
    for file in day.glob("*.csv"):
        rows = list(csv.reader(file.open(newline="")))
        at = rows[0].index("tendon_2_tension")
        for row in rows[1:]:
            row[at] = repr(float(row[at]) + 3.2)
        with file.open("w", newline="") as written:
            csv.writer(written).writerows(rows)
    robot = load(str(tmp_path / "robot"))
    bench = prepare(read(day), robot)
    start, objective, _ = objective_of(bench, Twin.of(robot), list(range(8)), Settings(jobs=1))
    model = start.with_effect("tendon_friction", {"mu": 0.2}, ("mu", "presliding"), 3)
    found = fit(objective, model.with_effect("load_cell_bias", {"bias_2": 0.5}, ("bias_2",), 3), refresh=True)
    assert found.model.twin.effects[-1]["bias_2"] == pytest.approx(3.2, abs=0.2)


def test_a_factor_below_zero_and_a_condition_that_is_not_grown_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="positive"):
        resized(FRIDAY, tmp_path, -1.0, 1.0)
    told = tomllib.loads((FRIDAY / "measurements.toml").read_text())
    told["trial"][1]["tip_force"] = [0.1, 0.0, 0.0]
    (tmp_path / "measurements.toml").write_text(tomli_w.dumps(told))
    with pytest.raises(DataError, match=r"fast_3\.csv.*tip_force"):
        resized(tmp_path, tmp_path / "out", 2.0, 1.0)
