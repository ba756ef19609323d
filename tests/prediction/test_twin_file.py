"""`twin.toml`: what is written is read again bit for bit, and what cannot be read says why."""

from __future__ import annotations

import math
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from twin.effects import Effect, catalogue
from twin.foundation.errors import DataError, TwinError, UnknownNameError
from twin.foundation.parameters import FittedValue, Parameter
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import correlations, read_twin, twin_table, write_twin
from twin.robots import load, robot_names
from twin.robots.robot import models_folder

PARAMETERS = {p.name: p for p in load("continuum").parameters}
FRICTION = '[[effect]]\nid = "tendon_friction"\nparameters = '
HEAD = 'format = "twin/1"\nrobot = "continuum"\n'


def inside(p: Parameter) -> st.SearchStrategy[float]:
    """Any value the parameter may take, its bounds, signed zeros and the smallest numbers included."""
    low, high = (b if math.isfinite(b) else None for b in (p.low, p.high))
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def some_of(parameters: tuple[Parameter, ...]) -> st.SearchStrategy[dict[str, float]]:
    return st.fixed_dictionaries({}, optional={p.name: inside(p) for p in parameters})


robot_values = some_of(load("continuum").nuisance)
effect_sets = st.lists(st.sampled_from(sorted(catalogue())), unique=True, max_size=4).flatmap(
    lambda names: st.tuples(*(some_of(catalogue()[n].all_parameters(3)).map(lambda v, n=n: catalogue()[n](v, 3)) for n in names))
)


def stored(folder: Path, twin: Twin, **found: dict) -> Path:
    path = folder / "twin.toml"
    write_twin(path, twin_table(twin, folder, found.get("parameters", {}), found.get("effects", {})), {"seed": 0})
    return path


@given(values=robot_values, effects=effect_sets)
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
def test_what_is_written_is_read_again(values: dict[str, float], effects: tuple[Effect, ...], tmp_path: Path) -> None:
    twin = Twin(load("continuum"), values, effects)
    again = read_twin(stored(tmp_path, twin))
    # To the bit: TOML floats are written with all their digits, and SI units have the factor one.
    assert again.robot is twin.robot
    assert again.values == twin.values
    assert again.effects == twin.effects
    assert [e.id for e in again.effects] == [e.id for e in effects]  # their order is the order of the signal


@given(st.one_of(st.floats(), st.floats(6e10, 1e11)))
@settings(deadline=None, max_examples=60)
def test_any_number_is_taken_or_refused_by_name(value: float) -> None:
    """A value outside its bounds never gets into a twin."""
    p = PARAMETERS["backbone.youngs_modulus"]
    if p.low <= value <= p.high:
        assert load("continuum").build({p.name: value}).joints
    else:
        with pytest.raises(TwinError, match=rf"{p.name}.*allowed is \[{p.low:g}, {p.high:g}\]".replace("+", r"\+")):
            load("continuum").build({p.name: value})


def test_units_of_other_people_are_converted(tmp_path: Path) -> None:
    path = tmp_path / "twin.toml"
    path.write_text(
        HEAD + '[parameters]\n"backbone.youngs_modulus" = { value = 76.1, unit = "GPa" }\n'
        '"tendons.radius" = { value = 8.1, unit = "mm" }\n'
        '"disks.mass" = 0.005\n"tendons.angle_2" = { value = 121.0, unit = "deg" }\n'
        '[[effect]]\nid = "base_tilt"\nparameters = { about_x = { value = 2.0, unit = "deg" } }\n'
        '[[effect]]\nid = "time_delay"\nparameters = { delay = { value = 100.0, unit = "ms" } }\n'
    )
    twin = read_twin(path)
    # The factors are exact but for one rounding of a product, 2e-16 relative.
    assert twin.values["backbone.youngs_modulus"] == pytest.approx(76.1e9, rel=1e-15)
    assert twin.values["tendons.radius"] == pytest.approx(8.1e-3, rel=1e-15)
    assert twin.values["disks.mass"] == 0.005
    assert twin.values["tendons.angle_2"] == pytest.approx(math.radians(121.0), rel=1e-15)
    assert twin.effects[0]["about_x"] == pytest.approx(math.radians(2.0), rel=1e-15)
    assert twin.effects[1]["delay"] == pytest.approx(0.1, rel=1e-15)


@pytest.mark.parametrize("name", robot_names())
def test_a_name_alone_is_a_twin(name: str) -> None:
    assert read_twin(name) == Twin.of(name)
    assert dict(read_twin(name).values) == {}


def test_a_folder_with_a_twin_is_a_twin(tmp_path: Path) -> None:
    twin = Twin(load("continuum"), {"disks.mass": 0.0051})
    assert read_twin(stored(tmp_path, twin).parent) == twin


def test_a_robot_beside_the_file_is_found_from_there(tmp_path: Path) -> None:
    shutil.copytree(models_folder() / "continuum", tmp_path / "bench/mine", ignore=shutil.ignore_patterns("samples"))
    path = tmp_path / "bench/twin.toml"
    path.write_text('format = "twin/1"\nrobot = "mine"\n')
    twin = read_twin(path)
    assert twin.robot.name == "mine"
    # Written elsewhere, it still points to the same robot.
    (tmp_path / "elsewhere").mkdir()
    assert read_twin(stored(tmp_path / "elsewhere", twin)).robot == twin.robot


def test_standard_errors_and_units_are_kept(tmp_path: Path) -> None:
    twin = Twin(load("continuum"), {"disks.mass": 0.0051, "tendons.radius": 8.1e-3}, (catalogue()["tip_payload"](mass=2e-3),))
    laws = {"tip_payload": {"mass": FittedValue(2e-3, 3e-4, "kg")}}
    payload = {"mass": {"value": 2e-3, "std": 3e-4, "unit": "kg"}, "zeroed": {"value": 0.0, "unit": "1"}}
    path = stored(tmp_path, twin, parameters={"disks.mass": FittedValue(0.0051, 1e-4, "kg")}, effects=laws)
    table = tomllib.loads(path.read_text())
    assert table["format"] == "twin/1"
    assert table["parameters"]["disks.mass"] == {"value": 0.0051, "std": 1e-4, "unit": "kg"}
    assert table["parameters"]["tendons.radius"] == {"value": 8.1e-3, "unit": "m"}
    assert table["effect"] == [{"id": "tip_payload", "parameters": payload}]
    assert table["provenance"] == {"seed": 0}
    assert [p.name for p in tmp_path.iterdir()] == ["twin.toml"]  # no half-written neighbour stays


REFUSED = {
    "no toml": ("format = ", "line 1"),
    "another format": ('format = "twin/2"\nrobot = "continuum"', "twin/2"),
    "no format": ('robot = "continuum"', "twin/1"),
    "no robot": ('format = "twin/1"', "robot"),
    "an unknown robot": ('format = "twin/1"\nrobot = "contineum"', "contineum.*available.*continuum"),
    "an unknown parameter": (HEAD + '[parameters]\n"backbone.radios" = 1.0', "backbone.radios.*available.*backbone.radius"),
    "an unknown effect": (HEAD + '[[effect]]\nid = "tendon_frictoin"', "tendon_frictoin.*available.*tendon_friction"),
    "an effect without an id": (HEAD + "[[effect]]\nparameters = { mu = 0.1 }", "id is missing"),
    "an unknown parameter of an effect": (HEAD + FRICTION + "{ mo = 0.1 }", "mo.*available.*mu"),
    "an unknown unit": (HEAD + '[parameters]\n"disks.mass" = { value = 5.0, unit = "grm" }', "disks.mass.*grm"),
    "a word": (HEAD + '[parameters]\n"disks.mass" = "five"', "disks.mass.*five"),
    "no value": (HEAD + '[parameters]\n"disks.mass" = { unit = "g" }', "disks.mass"),
    "a unit that is no text": (HEAD + '[parameters]\n"disks.mass" = { value = 5.0, unit = 3 }', "disks.mass"),
    "beyond its bounds": (HEAD + '[parameters]\n"disks.mass" = { value = 50.0, unit = "g" }', "disks.mass.*allowed"),
    "no number": (HEAD + '[parameters]\n"disks.mass" = nan', "disks.mass.*allowed"),
    "a step of a robot that has none": (HEAD + "timestep = 0.001", "timestep.*'continuum'.*leave it out"),
    "a step of nothing": (HEAD.replace("continuum", "tendon_leg") + "timestep = 0.0", "timestep"),
    "an effect beyond its bounds": (HEAD + FRICTION + "{ mu = 3.0 }", "tendon_friction.*mu.*allowed"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_broken_twin_is_named_with_what_is_wrong(case: str, tmp_path: Path) -> None:
    text, said = REFUSED[case]
    path = tmp_path / "broken.toml"
    path.write_text(text + "\n")
    named = "" if case == "an unknown robot" else r"broken\.toml.*"
    with pytest.raises(TwinError, match=rf"(?s){named}{said}"):
        read_twin(path)


LEAKY = {
    "an unknown robot": ('format = "twin/1"\nrobot = "contineum"', "contineum"),
    "a unit of another dimension": (HEAD + '[parameters]\n"disks.mass" = { value = 0.005, unit = "s" }', "disks.mass"),
    "parameters that are no table": (HEAD.replace("format", "parameters = 3\nformat"), "parameters"),
    "an effect that is no list": (HEAD + 'effect = "tendon_friction"', "effect"),
    "an effect as one table": (HEAD + '[effect]\nid = "tendon_friction"', "effect"),
    "parameters of an effect that are no table": (HEAD + FRICTION + "0.2", "parameters"),
    "the same effect twice": (HEAD + '[[effect]]\nid = "tip_payload"\n[[effect]]\nid = "tip_payload"', "tip_payload"),
    "a section nobody reads": (HEAD + '[parameter]\n"disks.mass" = 0.005', "parameter"),
}


@pytest.mark.parametrize("case", LEAKY)
def test_any_other_broken_twin_is_named_too(case: str, tmp_path: Path) -> None:
    text, said = LEAKY[case]
    path = tmp_path / "broken.toml"
    path.write_text(text + "\n")
    with pytest.raises(DataError, match=rf"(?s)broken\.toml.*{said}"):
        read_twin(path)


@pytest.mark.parametrize("source", ["nowhere/twin.toml", "twin.toml", "some/folder"])
def test_a_twin_that_is_not_there_says_what_would_be(source: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match=r"no such twin.*continuum"):
        read_twin(source)


def test_a_name_that_is_none_lists_those_there_are() -> None:
    with pytest.raises(UnknownNameError, match=r"contineum.*available.*continuum"):
        read_twin("contineum")


E_MU = ("backbone.youngs_modulus", "tendon_friction.mu")


def test_correlations_are_kept_beside_the_standard_errors(tmp_path: Path) -> None:
    """To the four digits that are written, and by pairs; a twin without them has none, nor one whose matrix is not finite."""
    twin, path = Twin(load("continuum"), {}, (catalogue()["tendon_friction"]({"mu": 0.2}, 3),)), tmp_path / "twin.toml"
    matrix = np.array([[1.0, -0.123456], [-0.123456, 1.0]])
    write_twin(path, twin_table(twin, tmp_path, {}, {}), {"seed": 0}, (E_MU, matrix))
    assert correlations(path) == correlations(tmp_path) == {
        (E_MU[0], E_MU[0]): 1.0, E_MU: -0.1235, E_MU[::-1]: -0.1235, (E_MU[1], E_MU[1]): 1.0
    }  # fmt: skip
    assert read_twin(path).effects == twin.effects
    assert tomllib.loads(path.read_text("utf-8"))["provenance"] == {"seed": 0}
    for other in (None, ((), np.zeros((0, 0))), (E_MU, np.full((2, 2), np.nan))):
        write_twin(path, twin_table(twin, tmp_path, {}, {}), {}, other)
        assert correlations(path) is None
    assert correlations("continuum") is None


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('parameters = ["backbone.young"]\nmatrix = [[1.0]]', "unknown parameter 'backbone.young'"),
        ('parameters = ["disks.mass", "disks.mass"]\nmatrix = [[1.0, 0.0], [0.0, 1.0]]', "names one twice"),
        ('parameters = ["disks.mass"]\nmatrix = [[1.0, 0.5]]', "rows of 2; 1 rows of 1 are needed"),
        ('parameters = ["disks.mass", "tendons.radius"]\nmatrix = [[1.0, 0.5], [0.4, 1.0]]', "not symmetric"),
        ('parameters = ["disks.mass", "tendons.radius"]\nmatrix = [[1.0, 1.5], [1.5, 1.0]]', "beyond"),
        ('parameters = ["disks.mass"]\nmatrix = [[0.5]]', "another than 1 on its diagonal"),
        ('parameters = ["disks.mass"]', "matrix is missing"),
        ('parameters = ["disks.mass"]\nmatrix = [["much"]]', "matrix"),
    ],
)
def test_correlations_that_are_none_are_refused(table: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "twin.toml"
    path.write_text(f"{HEAD}[correlation]\n{table}\n")
    with pytest.raises(DataError, match=words):
        read_twin(path)
