"""Lines that stretch and via points that are elsewhere, against closed forms on one hinge, and on a finger of two."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.mechanics.mjcf.models import PENDULUM, robot
from twin.body import Drive, Loads, Problem, Route, Signals, Start
from twin.diagnosis.calibration.model import Model
from twin.effects import Effect, effect_class
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.mechanics.mjcf import ModelBody, geared
from twin.prediction.twin import Twin
from twin.robots import Robot, load
from twin.robots.schemas.mjcf import counts_of

KP, SPRING, C, GEAR = 800.0, 0.5, 4e-4, 2.0  # N/m, N m/rad, m/N
ARM = 0.02  # m

# A tendon from a post beside the hinge to a post on the lever: both `arm` from the axis, so that at zero it passes there.
LEVER = """
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <site name="eye" pos="-0.05 0 {arm}"/>
    <body name="lever">
      <inertial pos="0.05 0 0" mass="0.05" diaginertia="1e-5 1e-4 1e-4"/>
      <joint name="turn" axis="0 -1 0" stiffness="{spring}" damping="0.01"/>
      <site name="end" pos="0.05 0 {arm}"/>
    </body>
  </worldbody>
  <tendon><spatial name="line"><site site="eye"/><site site="end"/></spatial></tendon>
  <actuator>
    <general name="winch" tendon="line" gear="{gear}" gainprm="{kp}" biastype="affine" biasprm="0 -{kp} -2" forcerange="{low} 0"/>
  </actuator>
</mujoco>"""
OUTPUTS = ("joint.turn.position", "actuator.winch.position", "actuator.winch.force", "tendon.line.length", "tendon.line.tension")


def lever(folder: Path, gear: float = 1.0, low: float = -100.0) -> Robot:
    return robot(folder, LEVER.format(arm=ARM, spring=SPRING, gear=gear, kp=KP, low=low))


def at_rest(made: Robot, control: float, effects: tuple[Effect, ...]) -> dict[str, float]:
    """What the lever shows where it rests under a control."""
    units = dict(zip(OUTPUTS, ("rad", "m", "N", "m", "N"), strict=True))
    outputs = tuple(Channel(f"o{i}", "output", units[name], 1e-4, name) for i, name in enumerate(OUTPUTS))
    channels = (Channel("u", "input", "m", quantity="actuator.winch.ctrl"), *outputs)
    time = np.arange(3) * 0.01
    trial = Trial("a.csv", time, {"u": np.full(3, control), **{c.name: np.zeros(3) for c in outputs}}, {"settle": 5.0}, start=0.0)
    twin = Twin(made, {}, effects)
    seen = twin.predict(Recording("made", "made", "simulation", None, channels, (trial,))).trials[0].values
    return {name: float(seen[f"o{i}"][-1]) for i, name in enumerate(OUTPUTS)}


def elastic(made: Robot) -> tuple[Effect, ...]:
    return (effect_class("tendon_elasticity")({"stretch_line": C}, made.n_tendon),)


def test_a_line_is_a_spring_in_series_with_its_winch(tmp_path: Path) -> None:
    """T = kp / (1 + kp c) (path - ctrl), which balances the spring; the drum is at path - c T, and nothing is changed at rest."""
    made = lever(tmp_path)
    plain, seen = at_rest(made, 0.09, ()), at_rest(made, 0.09, elastic(made))
    T, path = seen["tendon.line.tension"], seen["tendon.line.length"]
    assert pytest.approx(KP / (1.0 + KP * C) * (path - 0.09), rel=1e-6) == T  # of the rest of the swing
    assert seen["actuator.winch.position"] == pytest.approx(path - C * T, abs=1e-12)
    assert pytest.approx(KP * (seen["actuator.winch.position"] - 0.09), rel=1e-6) == T  # what the winch itself holds
    assert seen["actuator.winch.force"] == pytest.approx(-T, rel=1e-12)
    assert plain["tendon.line.tension"] > T + 0.3  # N
    q = seen["joint.turn.position"]
    lever_arm = (0.05**2 + ARM**2) * np.sin(2.0 * np.arctan2(0.05, ARM) - q) / path
    assert T * lever_arm == pytest.approx(SPRING * q, rel=1e-6)


def test_a_gear_stretches_as_its_tendon_does(tmp_path: Path) -> None:
    """The actuator has `gear` times the tendon's length and 1 / gear of its tension: x = gear (path - c T), T = -gear F."""
    made = lever(tmp_path, gear=GEAR)
    seen = at_rest(made, 0.19, elastic(made))
    T, path, drum = (seen[name] for name in ("tendon.line.tension", "tendon.line.length", "actuator.winch.position"))
    assert pytest.approx(-GEAR * seen["actuator.winch.force"], rel=1e-12) == T
    assert drum == pytest.approx(GEAR * (path - C * T), abs=1e-12)
    assert seen["actuator.winch.force"] == pytest.approx(-KP * (drum - 0.19), rel=1e-6)


def test_limits_of_the_force_stay(tmp_path: Path) -> None:
    made = lever(tmp_path, low=-2.0)
    seen = at_rest(made, 0.06, elastic(made))
    assert seen["tendon.line.tension"] == pytest.approx(2.0, abs=1e-9)
    assert seen["actuator.winch.position"] == pytest.approx(seen["tendon.line.length"] - 2.0 * C, abs=1e-12)
    slack = at_rest(made, 0.11, elastic(made))
    assert slack["actuator.winch.position"] == slack["tendon.line.length"]


@pytest.mark.parametrize("out", [2e-3, -3e-3])
def test_a_lever_grows_by_as_much_as_its_tendon_is_out(out: float, tmp_path: Path) -> None:
    """d length / d angle of the straight finger is the arm; with its eye on the axis's height it is constant to first order."""
    body = lever(tmp_path).build()
    assert isinstance(body, ModelBody)
    effect_class("tendon_routing")({"out_line": out}, body.n_tendon).edit(body)
    data = mujoco.MjData(body.model)

    def length(q: float) -> float:
        data.qpos[0] = q
        mujoco.mj_forward(body.model, data)
        return float(data.ten_length[0])

    assert (length(-1e-4) - length(1e-4)) / 2e-4 == pytest.approx(ARM + out, abs=1e-9)
    np.testing.assert_allclose(body.model.site_pos, [[-0.05, 0, ARM + out], [0.05, 0, ARM + out]], atol=1e-15)


TWO = """
<mujoco>
  <compiler angle="degree" autolimits="true"/>
  <worldbody>
    <site name="a" pos="-0.05 0 -0.02"/><site name="b" pos="-0.01 0 -0.01"/>
    <body name="first" euler="0 0 180">
      <geom size="0.01"/><joint name="one" axis="0 1 0"/>
      <site name="c" pos="-0.01 0 -0.01"/><site name="d" pos="-0.04 0 0.01"/>
      <body name="second" pos="-0.05 0 0">
        <geom size="0.01"/><joint name="two" axis="0 1 0"/>
        <site name="e" pos="-0.01 0 0.01"/>
      </body>
    </body>
    <body name="slider" pos="0 1 0"><geom size="0.01"/><joint name="slide" type="slide"/><site name="s" pos="0.1 0 0"/></body>
    <site name="t" pos="0 1 0"/><geom name="g" size="0.01" pos="1 0 0"/>
  </worldbody>
  <tendon>
    <spatial name="through"><site site="a"/><site site="b"/><site site="c"/><site site="d"/><site site="e"/></spatial>
    <spatial name="straight"><site site="t"/><site site="s"/></spatial>
    <spatial name="wrapped"><site site="b"/><geom geom="g"/><site site="c"/></spatial>
    <fixed name="sum"><joint joint="one" coef="1"/><joint joint="two" coef="1"/></fixed>
  </tendon>
  <actuator>
    <position name="p" tendon="straight" kp="10"/><motor name="m" tendon="through"/><motor name="f" tendon="sum"/>
    <motor name="j" joint="one"/>
  </actuator>
</mujoco>"""


def test_each_site_goes_out_from_the_hinge_it_is_nearest_to(tmp_path: Path) -> None:
    """Below the first hinge and above the second, in a frame turned about z.

    A tendon that crosses no hinge, wraps or adds joints has no parameter, and only what pulls spatial tendons winds.
    """
    made = robot(tmp_path, TWO)
    body = made.build()
    assert isinstance(body, ModelBody)
    assert body.n_tendon.crossing == ("through",)  # type: ignore[attr-defined]
    assert [(w.tendon, w.actuator) for w in body.n_tendon.winches] == [("straight", 0), ("through", 1)]  # type: ignore[attr-defined]
    before = body.model.site_pos.copy()
    law = effect_class("tendon_routing")
    assert [p.name for p in law.all_parameters(body.n_tendon)] == ["out_through"]
    law({"out_through": 1e-3}, body.n_tendon).edit(body)
    moved = {name: 1e3 * d for name, d in zip(body.loaded.names("site"), body.model.site_pos - before, strict=True)}
    for name, down in (("a", -1.0), ("b", -1.0), ("c", -1.0), ("d", 1.0), ("e", 1.0), ("s", 0.0), ("t", 0.0)):
        assert moved[name] == pytest.approx([0.0, 0.0, down], abs=1e-12), name


def test_only_models_with_tendons_are_screened_for_them(tmp_path: Path) -> None:
    arm, leg = robot(tmp_path, PENDULUM.format(joint="", key="")), load("tendon_leg")
    for name, parameter in (("tendon_elasticity", "stretch_flexor"), ("tendon_routing", "out_flexor")):
        law = effect_class(name)
        assert not law.needs <= arm.build().features
        assert law.needs <= leg.build().features
        assert [(s.free, set(s.values)) for s in law.fit_starts([], leg.n_tendon)] == [((parameter,), {parameter})]
        assert list(law.fit_starts([], arm.n_tendon)) == []
        with pytest.raises(DataError, match="acts on"):
            Twin(arm, {}, (law({}, arm.n_tendon),)).body()
    model = Model(Twin(leg), ()).with_effect("tendon_elasticity", {"stretch_flexor": 1e-5}, ("stretch_flexor",), leg.n_tendon)
    assert list(model.twin.effects[0].extended_starts([])) == []


def test_a_backbones_readings_are_left_alone() -> None:
    law = effect_class("tendon_elasticity")(stretch=1e-4)
    z = np.zeros
    seen = Signals(z(1), z(1), z((1, 1)), z((1, 1)), z((1, 0, 3)), z(1))
    assert not law.acts_in("edit", "sense")
    assert law.acts_in("route")
    assert law.sense(seen) is seen


def test_every_winch_of_the_leg_is_known() -> None:
    body = load("tendon_leg").build()
    assert isinstance(body, ModelBody)
    assert counts_of(body.loaded).winches == (("flexor", 1, 1.0),)


def exact_tension(time: np.ndarray, ctrl: np.ndarray, path: float, kv: float) -> np.ndarray:
    """Of a winch on a path of fixed length: (1 + kp c) T + kv c T' = kp (path - ctrl), from rest, in steps of an exact filter."""
    s, T = 1.0 + KP * C, np.empty(len(time))
    goal, e = KP * (path - ctrl) / s, np.exp(-np.diff(time) * s / (kv * C))
    T[0] = goal[0]
    for k in range(len(time) - 1):  # straight between rows, which are a fiftieth of the filter's time apart
        T[k + 1] = 0.5 * (goal[k] + goal[k + 1]) + (T[k] - 0.5 * (goal[k] + goal[k + 1])) * e[k]
    return T


def test_a_damped_winch_pulls_late_through_its_line(tmp_path: Path) -> None:
    """A stiff spring holds the lever, so that the path hardly moves; kv = 200 N s/m on 4e-4 m/N delays T by 61 ms."""
    text = LEVER.format(arm=ARM, spring=1000.0, gear=1.0, kp=KP, low=-100.0).replace(f"-{KP} -2", f"-{KP} -200")
    text = text.replace("1e-5 1e-4 1e-4", "0.01 0.01 0.01")
    made, time = robot(tmp_path, text), np.arange(0.0, 1.0, 1e-3)
    ctrl = 0.09 - 0.005 * np.sin(8.0 * time)
    body = made.build()
    for law in elastic(made):
        law.edit(body)
    found = made.solver(body).solve(Problem(time, ctrl[:, None], Loads(np.zeros(3)), Route(), (Drive.CONTROL,), start=Start(1.0)))
    wanted = exact_tension(time, ctrl, 0.1, 200.0)
    # N: the lever still turns by 1e-4 rad, and so the path by 2 um
    assert np.abs(found.tension[:, 0] - wanted).max() < 0.01
    assert np.ptp(wanted) > 4.0


def test_load_rubs_in_the_gears_of_joints_that_an_actuator_turns_by_itself() -> None:
    """The leg's hip has a servo; its knee is pulled by a tendon and has no gear, however large the share."""
    leg = load("tendon_leg")
    body = leg.build()
    assert isinstance(body, ModelBody)
    assert [bool(row.any()) for row in geared(body.model)] == [True, False]  # hip, knee
    assert "load friction" in body.features
    spec = body.spec.copy()
    spec.delete(spec.actuators[0])
    assert not geared(spec.compile()).any()


def test_a_weak_winch_delivers_a_share_of_what_it_delivered_at_its_limit_too(tmp_path: Path) -> None:
    """Its controller limits the current, so that F' = gain F whatever F is."""
    made = lever(tmp_path, low=-0.5)
    weak = (effect_class("actuator_gain")({"gain_1": 0.4}, made.n_tendon),)
    full, found = at_rest(made, 0.09, ()), at_rest(made, 0.09, weak)
    assert full["actuator.winch.force"] == pytest.approx(-0.5, rel=1e-9)
    assert found["actuator.winch.force"] == pytest.approx(0.4 * -0.5, rel=1e-9)
