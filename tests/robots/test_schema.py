"""What `robot.toml` may say: every key of a family, its range and shape; all that is wrong comes in one message."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from twin.foundation.errors import DataError, TwinError
from twin.foundation.parameters import check_bounds
from twin.foundation.units import unit_scale
from twin.robots import Robot, load, robot_names
from twin.robots.family import family_names, load_family
from twin.robots.numbers import file_entries
from twin.robots.robot import models_folder
from twin.robots.schema import Row, UncertainEntry, row_parameters

WIRE = (models_folder() / "continuum/robot.toml").read_text("utf-8")
CAST = (models_folder() / "tentacle/robot.toml").read_text("utf-8")
JAW = (models_folder() / "cable_tool/robot.toml").read_text("utf-8")


def written(folder: Path, text: str, *changes: tuple[str, str]) -> Robot:
    for old, new in changes:
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
        text = text.replace(old, new)
    (folder / "robot.toml").write_text(text, "utf-8")
    return load(str(folder))


RADIUS = '"backbone.radius"          = { value = 0.4, unit = "mm"'
MODULUS = 'value = 77.59, unit = "GPa", std = 4.66, low = 62.0, high = 93.0'
PITCH = "[15.0, 15.0, 15.0, 15.0, 15.0, 15.0, 15.0, 15.0]"
HANGS = 'value = [0.0, 0.0, 9.81]\nunit = "m/s^2"'
# (file, old, new, what the message must hold)
REFUSED = {
    "a misspelt key": (WIRE, 'title  = "', 'titel  = "', ["'titel'", "did you mean 'title'", "title is missing"]),
    "a misspelt table": (WIRE, "[accuracy]", "[acuracy]", ["'acuracy'", "did you mean 'accuracy'"]),
    "a misspelt spread": (WIRE, "std = 4.66", "Std = 4.66", ["backbone.youngs_modulus", "'Std'", "did you mean 'std'"]),
    "a misspelt parameter": (WIRE, '"damping.time"   ', '"damping.tiem"', ["damping.tiem", "did you mean 'damping.time'"]),
    "a name nobody reads": (WIRE, "[gravity]", '"tendons.twist" = { value = 1, unit = "deg", source = "x" }\n[gravity]', ["twist"]),
    "a number of another body": (
        WIRE, "[gravity]", '"backbone.density" = { value = 1, unit = "g/cm^3", source = "x" }\n[gravity]', ["density", "cast"]
    ),
    "a count as text": (WIRE, "disks   = 8", 'disks = "8"', ["structure: disks", "'8'", "integer"]),
    "a count that is none": (WIRE, "disks   = 8", "disks = true", ["structure: disks", "True"]),
    "half a disk": (WIRE, "disks   = 8", "disks = 8.5", ["structure: disks", "8.5"]),
    "too many disks": (WIRE, "disks   = 8", "disks = 9223372036854775807", ["structure: disks", "less than or equal to 200"]),
    "an unknown choice": (WIRE, 'markers = "disk"', 'markers = "tip"', ["structure: markers", "'tip'"]),
    "a marker on no disk": (CAST, "markers     = [4, 9, 16, 24, ", "markers = [4, 9, 16, 25, ", ["markers", "1 to 24"]),
    "an end on no disk": (CAST, "tendons_end = 20", "tendons_end = 25", ["tendons_end", "1 to 24"]),
    "one tendon for a jaw": (JAW, "tendons = 2", "tendons = 1", ["structure: tendons", "2"]),
    "crossed in numbers": (JAW, "crossed = true", "crossed = 1", ["structure: crossed", "boolean"]),
    "true for a number": (WIRE, RADIUS, RADIUS.replace("0.4", "true"), ["backbone.radius", "True is not a number"]),
    "a list for a number": (WIRE, RADIUS, RADIUS.replace("0.4", "[0.4]"), ["backbone.radius", "one number is needed"]),
    "nothing for a number": (WIRE, RADIUS, RADIUS.replace("0.4", "[]"), ["backbone.radius", "one number is needed"]),
    "a spread as a list": (WIRE, "std = 4.66", "std = [4.66]", ["backbone.youngs_modulus", "std", "not a number"]),
    "a spread below zero": (WIRE, "std = 4.66", "std = -4.66", ["backbone.youngs_modulus", "std is -4.66"]),
    "a spread beyond its bounds": (WIRE, "std = 4.66", "std = 46.6", ["backbone.youngs_modulus", "std is 46.6", "wider"]),
    "bounds the wrong way": (WIRE, "low = 62.0, high = 93.0", "low = 93.0, high = 62.0", ["youngs_modulus", "not below"]),
    "a bound below zero": (WIRE, "low = 7.5,", "low = -7.5,", ["tendons.radius", "low = -7.5 mm", "0.1 to 1000 mm"]),
    "a bound that leaves the value out": (WIRE, "low = 62.0", "low = 80.0", ["youngs_modulus", "77.59", "low = 80"]),
    "a radius below zero": (WIRE, RADIUS, RADIUS.replace("0.4", "-0.4"), ["backbone.radius", "-0.4 mm", "allowed is"]),
    "no mass": (WIRE, "value = 0.6", "value = 0", ["backbone.mass", "0 g", "allowed is"]),
    "a pitch of nothing": (WIRE, PITCH, PITCH.replace("15.0]", "0.0]"), ["disks.pitch", "0 mm", "allowed is"]),
    "a pitch in km": (WIRE, PITCH + ', unit = "mm"', PITCH + ', unit = "km"', ["disks.pitch", "15 km", "allowed is"]),
    "one pitch too few": (WIRE, PITCH, PITCH.replace("15.0, 15.0]", "15.0]"), ["disks.pitch", "7 numbers", "8"]),
    "angles as one number": (WIRE, "value = [0.0, 120.0, 240.0]", "value = 0.0", ["tendons.angle", "a list is needed"]),
    "angles without unit": (WIRE, '240.0], unit = "deg"', '240.0], unit = "1"', ["tendons.angle", "'1'", "deg"]),
    "angles squared": (WIRE, '240.0], unit = "deg"', '240.0], unit = "deg**2"', ["tendons.angle", "wrong dimension"]),
    "angles a second": (WIRE, '240.0], unit = "deg"', '240.0], unit = "rad/s"', ["tendons.angle", "wrong dimension"]),
    "an empty unit": (WIRE, RADIUS, RADIUS.replace('"mm"', '""'), ["backbone.radius", "unit is empty"]),
    "a tower of powers": (WIRE, RADIUS, RADIUS.replace('"mm"', '"9**9**9"'), ["backbone.radius", "not a unit"]),
    "Poisson's ratio of -1": (WIRE, "value = 0.33", "value = -1", ["poisson_ratio", "-1", "-0.99 to 0.5"]),
    "a modulus no solid has": (WIRE, '"GPa"', '"TPa"', ["youngs_modulus", "allowed is 1e-06 to 2000 GPa"]),
    "another length": (WIRE, "value = 120.0", "value = 130.0", ["backbone.length", "130 mm", "120 mm"]),
    "holes beyond the disks": (WIRE, 'value = 10.0, unit = "mm"', 'value = 7.0, unit = "mm"', ["tendons.radius", "8 mm", "7 mm"]),
    "stations that fall": (CAST, "value = [0.0, 305.0, 360.0]", "value = [0.0, 360.0, 305.0]", ["station", "rise"]),
    "a radius too few": (CAST, "value = [15.41, 6.42, 4.80]", "value = [15.41, 6.42]", ["station has 3", "radius 2"]),
    "a body too short": (CAST, "value = [0.0, 305.0, 360.0]", "value = [0.0, 150.0, 180.0]", ["station", "180 mm", "360"]),
    "a part of the springs": (WIRE, '"springs.capacity"   ', '"springs.capacty"', ["springs.capacty", "missing: springs.capacity"]),
    "a spring's temperatures": (WIRE, "value = 316.15", "value = 346.15", ["springs.martensite_finish is not below"]),
    "gravity as one number": (WIRE, HANGS, HANGS.replace("[0.0, 0.0, 9.81]", "9.81"), ["gravity", "a list is needed"]),
    "a spread of gravity": (WIRE, HANGS, HANGS + "\nstd = 0.1", ["gravity", "'std'"]),
    "a spread of what is only checked": (WIRE, "value = 120.0,", "value = 120.0, std = 1,", ["backbone.length", "std"]),
    "gravity of a star": (WIRE, HANGS, HANGS.replace("9.81", "9810"), ["gravity", "9810 m/s^2", "-50 to 50"]),
    "no source": (WIRE, 'source = "Peng Table 2: r"', 'source = " "', ["backbone.radius", "source is empty"]),
    "a number of 5,000 digits": (WIRE, RADIUS, RADIUS.replace("0.4", "9" * 5000), ["not TOML"]),
    "brackets 5,000 deep": (WIRE, RADIUS, RADIUS.replace("0.4", "[" * 5000 + "]" * 5000), ["not TOML"]),
    "a title that steers a terminal": (WIRE, 'title  = "', 'title  = "\\u001b[31m', ["title", "control characters"]),
    **{
        f"family {name!r}": (WIRE, 'family = "continuum"', f'family = "{name}"', ["no family", "hand, mjcf, soft, transmission"])
        for name in ("..", "continuum.x", "robot", "schema", "continuum_schema", "continuum_flex", "os", "")
    },
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_in_order_is_refused_by_name(case: str, tmp_path: Path) -> None:
    text, old, new, said = REFUSED[case]
    if 'family = ""' in new:
        said = ["family"]
    with pytest.raises(DataError) as caught:
        written(tmp_path, text, (old, new))
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "robot.toml"))
    assert message.isprintable()  # one line
    assert all(part in message for part in said), message


def test_all_that_is_wrong_is_told_at_once(tmp_path: Path) -> None:
    mistakes = (
        (RADIUS, RADIUS.replace("0.4", "-0.4")), ("value = 0.6", "value = true"), ('"damping.time"   ', '"damping.tiem"'),
        ("std = 4.66", "std = 0"), ('"disks.radius"', '"disk.radius"'),
    )  # fmt: skip
    with pytest.raises(DataError) as caught:
        written(tmp_path, WIRE, *mistakes)
    message = str(caught.value)
    assert "6 things are wrong" in message  # five, and the two they leave missing
    for part in (
        "backbone.radius",
        "backbone.mass",
        "damping.tiem",
        "std is 0",
        "disk.radius",
        "missing: disks.radius, damping.time",
    ):
        assert part in message


def test_what_is_left_out_has_its_default(tmp_path: Path) -> None:
    without = re.sub(r'(?m)^"(backbone.radius_taper|markers.axial_offset)".*\n', "", WIRE)
    robot = written(tmp_path, without)
    found = {p.name: p for p in robot.parameters}
    assert (found["backbone.radius_taper"].value, found["markers.axial_offset"].value) == (0.0, 0.0)
    assert found["backbone.radius_taper"].std is None
    assert np.allclose(site(robot, "disk_8"), [0, 0, 0.12], rtol=0, atol=1e-15)


def site(robot: Robot, name: str) -> np.ndarray:
    import mujoco

    model = robot.build().spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.site(name).xpos


def test_one_number_stands_for_all(tmp_path: Path) -> None:
    """One pitch for all disks is one uncertain number, and the same body as a list of equal ones."""
    robot = written(tmp_path, WIRE, (PITCH, "15.0"))
    assert [p.name for p in robot.parameters if p.name.startswith("disks.pitch")] == ["disks.pitch"]
    assert np.array_equal(site(robot, "tendon_2_hole_8"), site(load("continuum"), "tendon_2_hole_8"))


GRID = Row("holes.angle", "rad", "deg", "angle of each hole", -10.0, 10.0, ("tendon", "disk"))


def test_a_row_may_run_over_two_counts() -> None:
    entry = UncertainEntry(value=[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], unit="deg", source="x")
    found = {p.name: p.value for p in row_parameters(GRID, entry, {"tendon": 2, "disk": 3})}
    assert list(found) == [f"holes.angle_{i}_{k}" for i in (1, 2) for k in (1, 2, 3)]
    assert found["holes.angle_2_3"] == pytest.approx(np.radians(6.0), rel=1e-15)
    (one,) = row_parameters(GRID, UncertainEntry(value=1.0, unit="deg", source="x"), {"tendon": 2, "disk": 3})
    assert one.name == "holes.angle"
    for wrong in ([1.0, 2.0], [[1.0, 2.0, 3.0]], [[1.0, 2.0], [3.0, 4.0]], [[[1.0]], 2.0]):
        with pytest.raises(DataError, match="a list of"):
            row_parameters(GRID, UncertainEntry(value=wrong, unit="deg", source="x"), {"tendon": 2, "disk": 3})


def test_a_number_without_bounds_has_room_for_its_spread(tmp_path: Path) -> None:
    robot = written(tmp_path, WIRE, (MODULUS, 'value = 77.59, unit = "GPa", std = 4.66'))
    p = next(p for p in robot.parameters if p.name == "backbone.youngs_modulus")
    assert p.low == pytest.approx((77.59 - 5 * 4.66) * 1e9)
    assert p.high == pytest.approx((77.59 + 5 * 4.66) * 1e9)
    with pytest.raises(TwinError, match="allowed is"):
        check_bounds(p, -1.0)


def test_the_stated_length_is_no_parameter() -> None:
    assert "backbone.length" not in {p.name for p in load("continuum").parameters}


@pytest.mark.parametrize("name", family_names())
def test_every_row_is_whole(name: str) -> None:
    schema = load_family(name).SCHEMA
    assert len(schema.diagram.splitlines()) > 4
    for row in (*schema.rows, schema.accuracy):
        unit_scale(row.usual_unit, row.unit)
        assert row.meaning.strip()
        assert row.low < row.high
        assert row.default is None or row.low <= row.default <= row.high
    for field in schema.structure.model_fields.values():
        assert field.description


@pytest.mark.parametrize("name", robot_names())
def test_numbers_are_shown_as_written(name: str) -> None:
    """What `twin robots` prints are the file's own numbers and units, read here by the test itself."""
    import tomllib

    file = tomllib.loads((models_folder() / name / "robot.toml").read_text("utf-8"))["parameters"]
    for line in file_entries(load(name)):
        if "value" in file.get(line.row.name, {}):  # left out, it is the number of a model beside the file
            entry = file[line.row.name]
            assert line.unit == entry["unit"]
            values = entry["value"] if isinstance(entry["value"], list) else [entry["value"]]
            assert line.values == pytest.approx(values, rel=1e-12)  # a product and a quotient round once each
            assert (line.std is None) == ("std" not in entry)
