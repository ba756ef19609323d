"""Laws of an MJCF's sensors and drives, against their equations."""

from __future__ import annotations

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
    read = {k: np.ones((2, 2)) for k in ("joint angle", "actuator angle", "actuator length", "actuator force", "tendon length")}
    true = Signals(clock, clock, nothing, nothing, np.zeros((2, 0, 3)), clock, others=read)
    drift = catalogue()["sensor_drift"]
    seen = drift({"angle_hip": 1e-4, "position_2": 2e-6, "force_1": 1e-3}, n).sense(true).others
    np.testing.assert_allclose(seen["joint angle"][1], [1.06, 1.0])
    np.testing.assert_allclose(seen["actuator length"][1], [1.0, 1.0012])
    np.testing.assert_allclose(seen["actuator force"][1], [1.6, 1.0])
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
