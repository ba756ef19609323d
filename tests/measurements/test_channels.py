"""The grammar of channel names, both ways: every name in it is understood, and nothing else is."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.foundation.errors import DataError
from twin.measurements import CHANNEL_KINDS, Channel, ChannelName, parse_channel_name

INDEX = st.integers(1, 9999)


AXES = {"@": ("x", "y", "z"), "%": ("qw", "qx", "qy", "qz"), "&": ("roll", "pitch", "yaw")}


@given(st.sampled_from(sorted(CHANNEL_KINDS)), INDEX, st.integers(0, 3), st.none() | INDEX)
def test_names_say_what_they_were_made_of(kind: str, index: int, which: int, finger: int | None) -> None:
    pattern, _ = CHANNEL_KINDS[kind]
    (axis,) = {axes[which % len(axes)] for mark, axes in AXES.items() if mark in pattern} or {None}
    spelled = pattern.replace("#", str(index))
    for mark in AXES:
        spelled = spelled.replace(mark, str(axis))
    name = (f"finger_{finger}_" if finger else "") + spelled
    assert parse_channel_name(name) == ChannelName(kind, index if "#" in pattern else None, axis, finger)


@given(st.text("tendo_1289xyzkispamr", max_size=24) | st.text(max_size=12))
def test_no_other_text_has_a_meaning(name: str) -> None:
    with contextlib.suppress(DataError):
        said = parse_channel_name(name)  # drawn by luck: then it is spelled as its meaning spells it
        pattern, _ = CHANNEL_KINDS[said.kind]
        spelled = pattern.replace("#", str(said.index))
        for mark in AXES:
            spelled = spelled.replace(mark, str(said.axis))
        assert name.endswith(spelled)


@pytest.mark.parametrize(
    "name",
    ["", "time", "tendon_tension", "tendon_01_tension", "tendon_-1_tension", "tendon_1_tensions", "xtip_x", "tip", "tip_w",
     "disk_1", "disk_x", "TIP_X", "tip_x ", "tip_x\n", "finger_0_tip_x", "finger_1_finger_2_tip_x", "tendon_\u0661_tension",
     "sensor_1_strain"],
)  # fmt: skip
def test_near_misses_are_refused(name: str) -> None:
    with pytest.raises(DataError, match="allowed: tendon_I_tension"):
        parse_channel_name(name)


@pytest.mark.parametrize(
    ("name", "unit", "one"),
    [
        ("tendon_1_tension", "lbf", 4.4482216152605),
        ("tendon_2_displacement", "µm", 1e-6),
        ("disk_8_z", "cm", 1e-2),
        ("sma_1_voltage", "mV", 1e-3),
        ("sma_1_resistance", "kohm", 1e3),
        ("sensor_1_resistance", "Ω", 1.0),
        ("joint_1_angle", "deg", 0.017453292519943295),
        ("joint_1_torque", "N mm", 1e-3),
        ("finger_2_joint_1_torque", "kg*m²/s²", 1.0),
        ("ambient_temperature", "degF", 273.15 + (1 - 32) * 5 / 9),
        ("sma_1_temperature", "K", 1.0),
    ],
)
def test_one_of_a_unit_in_si(name: str, unit: str, one: float) -> None:
    assert Channel(name, "output", unit).scale.to_si(1.0) == pytest.approx(one, rel=1e-14)


@pytest.mark.parametrize("unit", ["1", "count", "percent", "N", "rad/s"])
def test_an_angle_is_not_just_any_number(unit: str) -> None:
    with pytest.raises(DataError, match="rad, deg"):
        Channel("joint_1_angle", "output", unit)


NONSENSE = [("tip_x", "result", "m"), ("tip_x", "output", "s"), ("tip_x", "output", "m", 0.0), ("tip_w", "output", "m")]


@pytest.mark.parametrize("arguments", NONSENSE)
def test_a_channel_refuses_nonsense(arguments: tuple) -> None:
    with pytest.raises(DataError):
        Channel(*arguments)
