"""A drive whose take-up is not proportional to its command: sought where displacements command, inverted where tensions do."""

from __future__ import annotations

import numpy as np

from twin.body import Drive, Signals
from twin.effects import Effect, effect_class

TRUE = {"turn": 1.2e-2, "sine_2": -4e-4, "cosine_2": 1e-4, "sine_3": 1e-4, "cosine_3": 2e-4}  # m
MOST = 1e-2  # m of cable


def law(**values: float) -> Effect:
    return effect_class("transmission_error")(values, 3)


def test_a_drive_that_never_moves_is_not_fitted() -> None:
    u = np.linspace(0.0, MOST, 9)[:, None] * np.array([0.0, 1.0, 1.0])
    begun = list(effect_class("transmission_error").fit_starts([signals(u, True)], 3))
    assert begun
    assert not any("1" in name for start in begun for name in start.free)


def signals(displacement: np.ndarray, by_length: bool) -> Signals:
    n, z = len(displacement), np.zeros
    return Signals(
        z(n), z(n), z((n, 3)), displacement, z((n, 0, 3)), z(n), (Drive.DISPLACEMENT if by_length else Drive.TENSION,) * 3
    )


def test_reporting_inverts_driving() -> None:
    u = np.repeat(np.linspace(0.0, MOST, 9)[:, None], 3, axis=1)
    bad = law(**TRUE)
    taken_up = bad.drive(signals(u, True)).displacement
    np.testing.assert_allclose(bad.sense(signals(taken_up, False)).displacement, u, atol=1e-9)


def test_it_is_sought_only_where_displacements_command() -> None:
    u = np.repeat(np.linspace(0.0, MOST, 9)[:, None], 3, axis=1)
    assert not list(effect_class("transmission_error").fit_starts([signals(u, False)], 3))
    assert list(effect_class("transmission_error").fit_starts([signals(u, True)], 3))
