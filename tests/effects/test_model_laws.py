"""Laws of an MJCF's sensors and drives, against their equations."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from twin.body import Signals
from twin.effects import catalogue
from twin.effects.actuator_saturation import NO_LIMIT
from twin.mechanics.mjcf import ModelBody
from twin.robots import load

LEG = load("tendon_leg")


def test_zeros_drift_at_their_rates_and_level_off() -> None:
    """y + rate t, and y + rate (1 - exp(-k t)) / k; of joints, drives and forces, each by its own."""
    n, clock, nothing = LEG.n_tendon, np.array([0.0, 600.0]), np.zeros((2, 2))
    read = {
        k: np.ones((2, 2))
        for k in ("joint angle", "actuator angle", "actuator length", "actuator force", "joint torque", "tendon length")
    }
    read["tendon tension"] = np.ones((2, 1))
    true = Signals(clock, clock, nothing, nothing, np.zeros((2, 0, 3)), clock, others=read)
    drift = catalogue()["sensor_drift"]
    seen = (
        drift({"angle_hip": 1e-4, "position_2": 2e-6, "force_1": 1e-3, "torque_knee": 1e-4, "tension_flexor": -1e-3}, n)
        .sense(true)
        .others
    )
    np.testing.assert_allclose(seen["joint angle"][1], [1.06, 1.0])
    np.testing.assert_allclose(seen["actuator length"][1], [1.0, 1.0012])
    np.testing.assert_allclose(seen["actuator force"][1], [1.6, 1.0])
    np.testing.assert_allclose(seen["joint torque"][1], [1.0, 1.06])
    np.testing.assert_allclose(seen["tendon tension"][1], [0.4])
    assert (seen["tendon length"] == 1.0).all()
    assert all((seen[k][0] == 1.0).all() for k in read)
    levelled = drift({"angle_hip": 1e-4, "levelling": 0.01}, n).sense(true).others["joint angle"]
    assert levelled[1, 0] == pytest.approx(1.0 + 1e-4 * (1.0 - np.exp(-6.0)) / 0.01)


def test_a_limit_narrows_what_the_model_allows_and_leaves_the_others() -> None:
    plain, body = LEG.build(), LEG.build()
    assert isinstance(plain, ModelBody)
    assert isinstance(body, ModelBody)
    law = catalogue()["actuator_saturation"]
    law({"limit_1": 0.2}, LEG.n_tendon).edit(body)
    assert body.model.actuator_forcelimited[0]
    np.testing.assert_allclose(body.model.actuator_forcerange[0], [-0.2, 0.2])
    np.testing.assert_array_equal(body.model.actuator_forcerange[1], plain.model.actuator_forcerange[1])
    law({"limit_2": NO_LIMIT}, LEG.n_tendon).edit(plain)
    np.testing.assert_array_equal(plain.model.actuator_forcerange, LEG.build().model.actuator_forcerange)  # type: ignore[attr-defined]


@pytest.mark.parametrize("values", [{"stiffness_hip": 0.3, "preload_hip": -0.2}, {"preload_hip": 0.1}, {"stiffness_hip": 0.3}])
def test_a_spring_more_pushes_by_its_preload_less_its_stiffness_times_the_angle(values: dict[str, float]) -> None:
    """MuJoCo's own passive torque at four angles. A push without stiffness is that of a spring 1,000 rad away: a thousandth off."""
    plain, body = LEG.build(), LEG.build()
    assert isinstance(plain, ModelBody)
    assert isinstance(body, ModelBody)
    catalogue()["joint_stiffness"](values, LEG.n_tendon).edit(body)
    k, push = (values.get(f"{name}_hip", 0.0) for name in ("stiffness", "preload"))
    hip = plain.model.joint("hip")
    for angle in (-1.0, 0.0, 0.3, 1.0):
        torque = []
        for model in (plain.model, body.model):
            data = mujoco.MjData(model)
            data.qpos[hip.qposadr[0]] = model.qpos0[hip.qposadr[0]] + angle
            mujoco.mj_forward(model, data)
            torque.append(data.qfrc_passive[hip.dofadr[0]])
        assert torque[1] - torque[0] == pytest.approx(push - k * angle, abs=1.01e-3 * abs(push * angle) * (k == 0.0) + 1e-12)
