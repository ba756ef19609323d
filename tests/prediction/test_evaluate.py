"""The error of a twin that is off by a known amount: in the units people read, per kind and per channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pint
import pytest

from tests.mechanics.rod.test_transmission import recording as jaw_days
from tests.mechanics.rod.test_transmission import run, sine
from twin.measurements import Channel, Recording, Trial
from twin.prediction.evaluate import OUTPUT_GROUPS, evaluate, headline_group
from twin.prediction.twin import Twin
from twin.robots import load


def shifted(recording: Recording, by: dict[str, float]) -> Recording:
    """Every value of the named channels further by a constant (SI)."""
    trials = tuple(replace(t, values={n: v + by.get(n, 0.0) for n, v in t.values.items()}) for t in recording.trials)
    return replace(recording, trials=trials)


def test_joint_angles_are_said_in_degrees_and_torques_in_newton_metres() -> None:
    twin = Twin.of("cable_tool")
    exact = twin.predict(jaw_days(run(sine(60), 0.0)))
    error = evaluate(twin, shifted(exact, {"joint_2_angle": np.pi / 180.0, "joint_1_torque": 2e-3}))
    assert error["by_kind"]["joint_angle"] == {"unit": "deg", "rmse": pytest.approx(1.0)}
    assert error["by_kind"]["joint_torque"] == {"unit": "N*m", "rmse": pytest.approx(2e-3)}
    assert (error["unit"], error["rmse"]) == ("deg", pytest.approx(1.0))
    assert error["trials"] == ["made"]


def test_positions_are_said_in_millimetres_of_distance_and_channels_alone() -> None:
    channels = (
        *(Channel(f"tendon_{i}_tension", "input", "N") for i in (1, 2, 3)),
        *(Channel(f"disk_{k}_{a}", "output", "mm") for k in (4, 8) for a in "xyz"),
        Channel("tendon_1_displacement", "output", "mm"),
    )
    tension = {f"tendon_{i}_tension": np.linspace(0.0, 0.3 * i, 20) for i in (1, 2, 3)}
    values = {c.name: np.zeros(20) for c in channels} | tension
    twin = Twin(load("continuum"))
    made = Recording(
        "continuum", "made", "simulation", np.array([0.0, 0.0, 9.81]), channels, (Trial("a.csv", np.arange(20.0), values),)
    )
    by = {"disk_4_x": 3e-3, "disk_4_y": 4e-3, "disk_8_z": -12e-3, "tendon_1_displacement": 1e-4}
    off = shifted(twin.predict(made), by)
    error = evaluate(twin, off)
    assert error["unit"] == "mm"
    assert error["rmse"] == pytest.approx(np.sqrt((5.0**2 + 12.0**2) / 2))  # of both markers' distances, not of their coordinates
    assert error["by_kind"]["tendon_displacement"] == {"unit": "mm", "rmse": pytest.approx(0.1)}
    found = {n: e["rmse"] for n, e in error["by_channel"].items()}
    assert found["disk_4_x"] == pytest.approx(3.0)
    assert found["disk_8_z"] == pytest.approx(12.0)
    assert found["disk_8_x"] == pytest.approx(0.0, abs=1e-9)
    # A marker lost in one coordinate is no point there; what is left of it still counts for its own channel.
    lost = {**off.trials[0].values, "disk_4_y": np.full(20, np.nan)}
    error = evaluate(twin, replace(off, trials=(replace(off.trials[0], values=lost),)))
    assert error["rmse"] == pytest.approx(12.0)
    assert error["by_channel"]["disk_4_y"]["rmse"] is None
    assert error["by_channel"]["disk_4_x"]["rmse"] == pytest.approx(3.0)


SI = {
    "marker": "m",
    "displacement": "m",
    "tension": "N",
    "temperature": "K",
    "resistance": "ohm",
    "sensor": "ohm",
    "angle": "rad",
    "torque": "N*m",
    "skin": "m",
    "turn": "rad",
    "angles": "rad",
    "imu rate": "rad/s",
    "imu force": "m/s^2",
    **{f"motor {of}": unit for of, unit in (("angle", "rad"), ("torque", "N*m"), ("current", "A"))},
    **{f"joint {of}": unit for of, unit in (("angle", "rad"), ("shift", "m"), ("torque", "N*m"), ("force", "N"))},
    **{f"actuator {of}": unit for of, unit in (("angle", "rad"), ("length", "m"), ("torque", "N*m"), ("force", "N"))},
    **{f"{of} rate": "rad/s" for of in ("joint", "actuator")},
    **{f"{of} speed": "m/s" for of in ("joint", "actuator", "tendon")},
    "tendon length": "m",
    "tendon tension": "N",
    **{group: group[8:-1] for group in OUTPUT_GROUPS if group.startswith("sensor [")},
}


@pytest.mark.parametrize("group", OUTPUT_GROUPS)
def test_every_unit_shown_is_as_large_as_its_definition(group: str) -> None:
    unit, factor = OUTPUT_GROUPS[group].unit, OUTPUT_GROUPS[group].factor
    si, shown = ("" if u == "1" else u for u in (SI[group], unit))
    assert pint.UnitRegistry().Quantity(1.0, si).to(shown).magnitude == pytest.approx(factor, rel=1e-12)


def test_markers_stand_for_the_twin_wherever_there_are_any() -> None:
    assert headline_group(["tension", "marker"]) == "marker"
    assert headline_group(["sensor", "skin"]) == "skin"
    assert headline_group(["skin", "marker"]) == "marker"
    assert headline_group(["angle", "torque"]) == "angle"
