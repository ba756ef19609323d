"""First-order gains, by hand: against the fall of a least-squares problem written out, priors as rows of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import nnls

from twin.diagnosis.evidence import ranking as stage
from twin.diagnosis.evidence.first_order import Dictionary, Pattern
from twin.diagnosis.evidence.ranking import Candidate, _amplitudes, gains, projected, promised_change, rank
from twin.diagnosis.thresholds import STARTS_PER_EFFECT
from twin.effects import FitStart

N = 60
RNG = np.random.default_rng(0)
STD, STEP = 0.3, 0.6  # of the robot's first parameter: a prior of (0.6 / 0.3)^2 in steps; nothing is believed of the second
J, Z = RNG.normal(size=(N, 2)), 3.0 * RNG.normal(size=N)
OBJECTIVE: Any = SimpleNamespace(prepared=SimpleNamespace(n_tendon=3), n=N)


def fitted(ended: bool = False) -> Any:
    """A robot with two free parameters, the second at an end of its range where `ended`."""
    free = [SimpleNamespace(parameter=SimpleNamespace(std=s, step=STEP)) for s in (STD, None)]
    return SimpleNamespace(J=J, z=Z, model=SimpleNamespace(free=free), at_bound=lambda: np.array([False, ended]))


def fall(columns: np.ndarray, own: list[int], weight: np.ndarray | None = None) -> float:
    """Of z' V^-1 z and the prior's term, when the columns' amplitudes are fitted beside the robot's `own` parameters."""
    root = np.linalg.cholesky(np.eye(N) if weight is None else weight).T

    def left(columns: np.ndarray) -> float:
        A = np.vstack([root @ np.column_stack([J[:, own], columns]), np.zeros((1, len(own) + columns.shape[1]))])
        A[-1, 0] = STEP / STD  # the first parameter's prior
        b = np.append(root @ Z, 0.0)
        return float(((b - A @ np.linalg.lstsq(A, b, rcond=None)[0]) ** 2).sum())

    return left(np.empty((N, 0))) - left(columns)


def gain(effect: str, names: tuple[str, ...], columns: np.ndarray, fit: Any, weight: np.ndarray | None = None) -> float:
    X = np.column_stack([J, columns, Z])
    known = Dictionary((Pattern(effect, FitStart({}, names), names, tuple(range(len(names)))),), columns)
    (found,) = gains(X, X if weight is None else weight @ X, fit, known, OBJECTIVE)
    return found


@pytest.mark.parametrize("ended", [False, True])
def test_a_gain_is_the_fall_of_the_least_squares_less_the_price_of_its_parameters(ended: bool) -> None:
    """A parameter at an end of its range imitates nothing. 1e-6: both are held by 1e-9."""
    two, own = RNG.normal(size=(N, 2)), [0] if ended else [0, 1]
    for columns, names in ((two, ("about_x", "about_y")), (two[:, :1], ("about_x",))):
        expected = fall(columns, own) - len(names) * np.log(N)
        assert gain("base_tilt", names, columns, fitted(ended)) == pytest.approx(expected, rel=1e-6)
    assert fall(two[:, :1], [0]) != pytest.approx(fall(two[:, :1], [0, 1]), rel=1e-3)


@pytest.mark.parametrize("ended", [False, True])
def test_the_promised_change_is_that_of_the_least_squares(ended: bool) -> None:
    """z after a fit of the columns less z after one without them; parameters that are held by priors move along. 1e-6 as above."""
    columns, own = RNG.normal(size=(N, 2)), [0] if ended else [0, 1]
    start = FitStart({}, ("about_x", "about_y"))
    known = Dictionary((Pattern("base_tilt", start, ("about_x", "about_y"), (0, 1)),), columns)
    found = promised_change(OBJECTIVE, fitted(ended), known, Candidate("base_tilt", start, 0.0, 0.0))

    def left(free: np.ndarray) -> np.ndarray:
        A = np.vstack([free, np.zeros((1, free.shape[1]))])
        A[-1, 0] = STEP / STD
        return Z - free @ np.linalg.lstsq(A, np.append(Z, 0.0), rcond=None)[0]

    expected = left(np.column_stack([J[:, own], columns])) - left(J[:, own])
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_beside_a_smooth_error_it_is_the_fall_of_the_weighted_least_squares() -> None:
    smooth = RNG.normal(size=(N, 3))
    weight = np.linalg.inv(np.eye(N) + smooth @ smooth.T)
    columns = RNG.normal(size=(N, 2))
    expected = fall(columns, [0, 1], weight) - 2.0 * np.log(N)
    assert gain("base_tilt", ("about_x", "about_y"), columns, fitted(), weight) == pytest.approx(expected, rel=1e-6)


def test_what_is_projected_is_symmetric_and_leaves_nothing_of_the_robots_own() -> None:
    """But what its prior holds back: for a parameter of |J|^2 = a and prior p alone, a - a^2 / (a + p) = a p / (a + p)."""
    left = projected(J, J, fitted(ended=True))
    a, p = float(J[:, 0] @ J[:, 0]), (STEP / STD) ** 2
    assert left[0, 0] == pytest.approx(a * p / (a + p), rel=1e-9)
    np.testing.assert_allclose(left, left.T, rtol=1e-9)


def test_an_effect_that_only_goes_one_way_gains_nothing_the_other_way() -> None:
    """Columns are changes of the residual: one that is like it would have to be taken off."""
    column = Z[:, None] + 0.1 * RNG.normal(size=(N, 1))
    assert gain("tendon_friction", ("mu",), column, fitted()) == -np.inf
    against = gain("tendon_friction", ("mu",), -4.0 * column, fitted())  # of some quarter of a unit
    assert against == pytest.approx(fall(column, [0, 1]) - np.log(N), rel=1e-6)
    assert gain("base_tilt", ("about_x",), column, fitted()) == pytest.approx(against, rel=1e-9)


@pytest.mark.parametrize("rounding", [0.0, 1e-7])
def test_of_two_columns_that_are_the_same_each_takes_half(rounding: float) -> None:
    """As the springs of two joints that an equality couples; the third goes the other way, and stays at its bound of 0.

    By rounding A has an eigenvalue of -1e-7 along the difference of the two, of which nothing is known.
    """
    A = np.array([[1.0, 1.0 + rounding, 0.2], [1.0 + rounding, 1.0, 0.2], [0.2, 0.2, 1.0]])
    amplitude = _amplitudes(A, np.array([-1.0, -1.0, 0.5]), np.zeros(3))
    np.testing.assert_allclose(amplitude, [0.5, 0.5, 0.0], atol=1e-6)


def test_of_a_law_for_every_tendon_the_worn_one_counts_whatever_the_others_would_do() -> None:
    """Stops in three drives, of which the data want the third, and a little of the second the wrong way: by another library's
    non-negative least squares on what the robot's own parameters leave, and the price of what is used."""
    names = ("loss_1", "loss_2", "loss_3")
    columns = RNG.normal(size=(N, 3))
    columns[:, 2] -= 0.8 * Z
    columns[:, 1] += 0.3 * Z
    rows = np.vstack([J, [STEP / STD, 0.0]])
    left = [np.append(x, 0.0) - rows @ np.linalg.lstsq(rows, np.append(x, 0.0), rcond=None)[0] for x in (*columns.T, Z)]
    amplitude, norm = nnls(np.column_stack(left[:3]), -left[3])
    assert amplitude[2] > 0.0
    assert amplitude[1] == 0.0
    expected = float(left[3] @ left[3]) - norm**2 - np.count_nonzero(amplitude) * np.log(N)
    assert gain("actuator_saturation", names, columns, fitted()) == pytest.approx(expected, rel=1e-6)
    free = fall(columns, [0, 1]) - 3 * np.log(N)
    assert gain("base_tilt", ("about_x", "about_y", "about_z"), columns, fitted()) == pytest.approx(free, rel=1e-6)


def test_what_the_robot_imitates_is_not_paid_for_and_gains_nothing_alone() -> None:
    """The second parameter's own column, with no prior: nothing of it is left."""
    column = RNG.normal(size=(N, 1))
    alone = gain("base_tilt", ("about_x",), column, fitted())
    assert gain("base_tilt", ("about_x", "about_y"), np.column_stack([column, J[:, 1]]), fitted()) == pytest.approx(alone, rel=1e-6)
    assert gain("base_tilt", ("about_x",), J[:, 1:], fitted()) == -np.inf
    assert gain("base_tilt", ("about_x",), np.zeros((N, 1)), fitted()) == -np.inf


def ranked(monkeypatch: pytest.MonkeyPatch, of: list[tuple[str, float, float]], top: int) -> list[tuple[str, float, float]]:
    """What `rank` keeps of candidates (effect, gain white, gain beside)."""
    known = Dictionary(
        tuple(Pattern(e, FitStart({"start": float(i)}, ()), (), ()) for i, (e, _, _) in enumerate(of)), np.empty((N, 0))
    )

    def measured(X: np.ndarray, VX: np.ndarray, *_: Any) -> list[float]:
        np.testing.assert_array_equal(X, np.column_stack([J, Z]))
        return [white if VX is X else beside for _, white, beside in of]

    monkeypatch.setattr(stage, "gains", measured)
    monkeypatch.setattr(stage, "catalogue", lambda: {e: SimpleNamespace(form=lambda free: "") for e, _, _ in of})
    evidence: Any = SimpleNamespace(whiten=lambda discrepancy, X: 0.5 * X)
    found = rank(OBJECTIVE, evidence, fitted(), None, known, top)  # type: ignore[arg-type]
    assert [c.gain for c in found] == sorted((c.gain for c in found), reverse=True)
    return [of[int(c.start.values["start"])] for c in found]


def test_the_best_by_either_measure_are_tried_the_best_first(monkeypatch: pytest.MonkeyPatch) -> None:
    a, b, c, d = ("a", 9.0, 1.0), ("b", 8.0, 2.0), ("c", 1.0, 20.0), ("d", 2.0, 3.0)
    assert ranked(monkeypatch, [a, b, c, d], 2) == [c, a, b, d]
    assert ranked(monkeypatch, [a, b, c, d], 1) == [c, a]


def test_one_that_leads_by_both_measures_takes_a_place_in_both(monkeypatch: pytest.MonkeyPatch) -> None:
    a, b, c = ("a", 9.0, 9.0), ("b", 8.0, 1.0), ("c", 1.0, 8.0)
    assert ranked(monkeypatch, [a, b, c], 1) == [a]
    assert ranked(monkeypatch, [a, b, c], 2) == [a, b, c]


def test_what_promises_nothing_is_not_tried_and_no_effect_crowds_out_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    assert STARTS_PER_EFFECT == 2
    many = [("a", 9.0 - i, -1.0) for i in range(4)]
    assert ranked(monkeypatch, [*many, ("b", 1.0, -1.0), ("c", 0.0, 0.0)], 3) == [many[0], many[1], ("b", 1.0, -1.0)]
    assert ranked(monkeypatch, [("c", 0.0, -np.inf)], 3) == []


def test_forms_of_an_effect_do_not_crowd_out_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two starts of each form: a third of the toe is not tried, the stretch is."""
    frees = [("toe", "toe_tension")] * 3 + [("stretch",)]
    found = [stage.Candidate("tendon_elasticity", FitStart({}, free), 9.0 - i, -1.0) for i, free in enumerate(frees)]
    monkeypatch.setattr(stage, "gains", lambda *args: [c.gain_white for c in found])
    known = SimpleNamespace(columns=np.zeros((N, 0)), patterns=[SimpleNamespace(effect=c.effect, start=c.start) for c in found])
    evidence: Any = SimpleNamespace(whiten=lambda discrepancy, X: X)
    fit: Any = fitted()
    chosen = rank(OBJECTIVE, evidence, fit, None, known, top=4)  # type: ignore[arg-type]
    assert [c.gain_white for c in chosen] == [9.0, 8.0, 6.0]
