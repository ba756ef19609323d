"""What a robot's description is good for, in sigmas of each output, and what of |z|^2 that excuses: by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from twin.diagnosis.fit_context import FitContext
from twin.robots import load

OUTPUTS = (("sensor", 1, 0.3), ("sensor", 0, 0.6), ("marker", 0, 2e-4), ("tension", 0, 0.01))  # group, index, sigma


def studied(robot: Any) -> FitContext:
    """Of four outputs, of which the second is missing in two rows of five."""
    outputs = [SimpleNamespace(group=g, index=i) for g, i, _ in OUTPUTS]
    noise = SimpleNamespace(sigma=np.array([s for *_, s in OUTPUTS]))
    objective: Any = SimpleNamespace(prepared=SimpleNamespace(outputs=outputs, robot=robot), whitener=SimpleNamespace(noise=noise))
    present = np.ones((5, 4), bool)
    present[:2, 1] = False
    evidence: Any = SimpleNamespace(present=present)
    return FitContext(objective, evidence)


def test_ohms_are_as_good_as_the_cords_strains_and_markers_as_said() -> None:
    """dR = 2 R0 d(strain): 9e-5 of 1 kohm are 0.18 ohm; the finger's markers are good to 0.1 mm; of tensions nothing is said."""
    study = studied(load("finger"))
    np.testing.assert_allclose(study.accuracy, [0.18 / 0.3, 0.18 / 0.6, 0.1e-3 / 2e-4, 0.0])
    np.testing.assert_allclose(study.excused, [5 * 0.6**2 + 3 * 0.3**2, 5 * 0.5**2, np.inf])


def test_each_cord_has_its_own_resistance() -> None:
    parameters = [SimpleNamespace(name="sensors.accuracy", value=1e-4)]
    parameters += [SimpleNamespace(name=f"sensors.resistance_{i}", value=r) for i, r in ((1, 600.0), (2, 1500.0))]
    robot = SimpleNamespace(accuracy=0.0, parameters=parameters, structure={"sensors": 2})
    np.testing.assert_allclose(studied(robot).accuracy, [0.3 / 0.3, 0.12 / 0.6, 0.0, 0.0])


def test_a_robot_without_cords_excuses_its_markers_alone() -> None:
    study = studied(load("continuum"))
    assert study.accuracy[2] > 0.0
    np.testing.assert_array_equal(study.accuracy[[0, 1, 3]], 0.0)
    np.testing.assert_array_equal(np.isinf(study.excused), [True, False, True])
