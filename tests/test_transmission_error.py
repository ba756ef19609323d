"""A drive whose take-up is not proportional to its command: found where displacements command, and inverted where tensions do."""

from __future__ import annotations

import numpy as np
import pytest

from tests.conftest import Day
from tools.bench.effects import Effect as Truth
from tools.compared import COMPARED, distance
from twin.bench import Bench, prepare
from twin.calibrate import fit
from twin.diagnose import Settings
from twin.diagnose.objective import objective_of
from twin.effects import Effect, Signals, named
from twin.robots import load
from twin.twin import Twin

TRUE = {"turn": 1.2e-2, "sine_2": -4e-4, "cosine_2": 1e-4, "sine_3": 1e-4, "cosine_3": 2e-4}  # m
MOST = 1e-2  # m of cable


def law(**values: float) -> Effect:
    return named("transmission_error")(values, 3)


@pytest.fixture(scope="module")
def day(bench: Day) -> tuple[Bench, Truth]:
    """Drums 0.4 mm off their centres, motors that command displacements."""
    recording, truth = bench("transmission_error", 4.0, design="by_length")
    assert truth is not None
    return prepare(recording, load("continuum")), truth


def test_off_centre_drums_are_recovered_beside_the_robots_own_parameters(day: tuple[Bench, Truth]) -> None:
    """The bench turns a whole drum, the law knows its first harmonic; what all drives share passes for the hole radius."""
    prepared, truth = day
    model, objective, _ = objective_of(prepared, Twin.of(prepared.robot), list(range(len(prepared.inputs))), Settings(jobs=2))
    base = fit(objective, model, refresh=True)
    predicted = [t.true for t in base.evaluation.traces]
    begun = list(named("transmission_error").starts(predicted, 3))
    fits = [fit(objective, base.model.with_effect("transmission_error", s.values, s.free, 3), J=base.J) for s in begun]
    best = min(fits, key=lambda f: f.cost)
    values = next(e for e in best.model.twin.effects if e.id == "transmission_error").values
    true, found, tolerance = COMPARED["transmission_error"](truth, values)
    assert distance(true, found) < tolerance
    before, after = (float(np.mean(f.z**2)) for f in (base, best))
    assert before > 1.5
    assert after < 1.1, "white noise has a mean square of one"


def test_a_drive_that_never_moves_is_not_fitted() -> None:
    u = np.linspace(0.0, MOST, 9)[:, None] * np.array([0.0, 1.0, 1.0])
    begun = list(named("transmission_error").starts([signals(u, True)], 3))
    assert begun
    assert not any("1" in name for start in begun for name in start.free)


def signals(displacement: np.ndarray, by_length: bool) -> Signals:
    n, z = len(displacement), np.zeros
    return Signals(z(n), z(n), z((n, 3)), displacement, z((n, 0, 3)), z(n), np.full(3, by_length))


def test_reporting_inverts_driving() -> None:
    u = np.repeat(np.linspace(0.0, MOST, 9)[:, None], 3, axis=1)
    bad = law(**TRUE)
    taken_up = bad.drive(signals(u, True)).displacement
    np.testing.assert_allclose(bad.sense(signals(taken_up, False)).displacement, u, atol=1e-9)


def test_it_is_sought_only_where_displacements_command() -> None:
    u = np.repeat(np.linspace(0.0, MOST, 9)[:, None], 3, axis=1)
    assert not list(named("transmission_error").starts([signals(u, False)], 3))
    assert list(named("transmission_error").starts([signals(u, True)], 3))
