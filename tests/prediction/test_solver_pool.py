"""Solvers are kept and lent: to one borrower at a time, for the body that was asked for, and as good as new ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from twin.body import Drive, Loads, Problem
from twin.effects import effect_class
from twin.foundation.errors import DataError
from twin.prediction import solver_pool as solvers
from twin.prediction.twin import Twin

G = np.array([-9.81, 0.0, 0.0])


@pytest.fixture(autouse=True)
def nothing_kept():
    solvers._idle.clear()
    yield
    solvers._idle.clear()


def statics(twin: Twin):
    with twin.statics() as (_, solver):
        return solver


def test_the_same_body_is_lent_again_and_another_is_not() -> None:
    twin = Twin.of("continuum")
    first = statics(twin)
    assert statics(Twin.of("continuum")) is first
    rubbed = Twin(twin.robot, {}, (effect_class("tendon_friction")({"mu": 0.2}, 3),))
    assert statics(rubbed) is first  # friction acts along tendons, not on the body
    tapered, bent = Twin(twin.robot, {"backbone.radius_taper": 0.01}), effect_class("backbone_precurvature")({"about_x": 1.0}, 3)
    assert statics(tapered) is not first
    assert statics(Twin(twin.robot, {}, (bent,))) is not first


def test_a_robot_read_anew_or_changed_is_another_one() -> None:
    """Its description may have changed meanwhile, under the same name."""
    twin = Twin.of("continuum")
    first = statics(twin)
    for other in (replace(twin.robot), replace(twin.robot, gravity=-twin.robot.gravity)):
        assert statics(Twin(other)) is not first


def test_two_borrowers_at_once_have_two_solvers() -> None:
    twin = Twin.of("continuum")
    with twin.statics() as (_, one), twin.statics() as (_, other):
        assert one is not other


def test_no_more_are_kept_than_said_and_those_lately_used_stay() -> None:
    made = []

    def use(key: int) -> object:
        with solvers.borrow_solver(key, lambda: made.append(key) or (object(), object())) as (_, solver):  # type: ignore[arg-type, func-returns-value]
            return solver

    first = use(0)
    for key in range(1, solvers.MOST_IDLE_SOLVERS):
        use(key)
    assert use(0) is first
    use(solvers.MOST_IDLE_SOLVERS)
    assert sum(map(len, solvers._idle.values())) == solvers.MOST_IDLE_SOLVERS
    assert use(0) is first  # 1 had to go, the least lately used
    made.clear()
    use(1)
    assert made == [1]


def test_a_borrower_that_fails_gives_back() -> None:
    with pytest.raises(ZeroDivisionError), solvers.borrow_solver("a", lambda: ("body", "solver")):  # type: ignore[arg-type, return-value]
        raise ZeroDivisionError
    assert solvers._idle["a"] == [("body", "solver")]


def test_an_effect_that_finds_nothing_is_refused_by_a_kept_body_too() -> None:
    twin = Twin.of("continuum")
    first = statics(twin)
    with pytest.raises(DataError, match="sensor_gain acts on"):
        statics(Twin(twin.robot, {}, (effect_class("sensor_gain")({}, 3),)))
    assert statics(twin) is first


@pytest.mark.parametrize("drive", [Drive.TENSION, Drive.DISPLACEMENT])
def test_what_was_solved_before_leaves_no_trace(drive: Drive) -> None:
    twin, n = Twin.of("continuum"), 5
    scale = 2.0 if drive is Drive.TENSION else 4e-3
    way = np.linspace(0.0, scale, n)[:, None] * np.array([1.0, 0.3, 0.0]) - (drive is Drive.DISPLACEMENT) * np.array([0, 0, 5e-3])

    def solve(gravity: np.ndarray, command: np.ndarray) -> np.ndarray:
        with twin.statics() as (_, solver):
            path = solver.solve(Problem(np.arange(n, dtype=float), command, Loads(gravity), drives=(drive,) * 3))
        assert path.status.all()
        return path.markers

    fresh = solve(G, way)
    solve(-G, way[::-1])
    assert np.array_equal(solve(G, way), fresh)  # to the last bit
