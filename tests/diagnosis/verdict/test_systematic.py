"""Systematic errors of parameters, against effects drawn at random and refits by another least squares."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import twin.diagnosis.pipeline as pipeline
from tests.recorded_days import half, recorded_day
from twin.diagnosis import Settings, diagnose
from twin.diagnosis.evidence.first_order import Dictionary, Pattern
from twin.diagnosis.verdict.systematic import systematic, with_systematic
from twin.effects import FitStart
from twin.prediction.twin import Twin
from twin.robots import load

N, STEP = 400, np.array([1.0, 0.1, 3.0])
RNG = np.random.default_rng(5)
J = RNG.normal(size=(N, 3)) @ np.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.2], [0.0, 0.0, 0.5]])
PRIOR = np.array([0.0, 4.0, 1.0])  # information per step
# Three columns, two that resemble the robot's own, and one that these imitate altogether.
C = np.column_stack([RNG.normal(size=(N, 3)), J[:, 0] + 0.3 * RNG.normal(size=N), J[:, 1] + 0.1 * RNG.normal(size=N), J[:, 2]])


def fitted(bound: tuple[bool, ...] = (False, False, False)) -> Any:
    free = [SimpleNamespace(parameter=SimpleNamespace(step=s)) for s in STEP]
    return SimpleNamespace(
        J=J, model=SimpleNamespace(free=free), information=lambda: J.T @ J + np.diag(PRIOR), at_bound=lambda: np.array(bound)
    )


def dictionary(**where: tuple[int, ...]) -> Dictionary:
    of = {name: [w] if isinstance(w, tuple) else w for name, w in where.items()}
    found = [Pattern(name, FitStart({}, ()), tuple(map(str, w)), w) for name, ways in of.items() for w in ways]
    return Dictionary(tuple(found), C)


def refitted(disturbance: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a disturbance (n,) moves each parameter by (SI), by least squares with the priors as rows; and what of it is left."""
    rows = np.vstack([J, np.diag(np.sqrt(PRIOR))])[:, free]
    x = np.zeros(3)
    x[free] = np.linalg.lstsq(rows, np.append(disturbance, np.zeros(3)), rcond=None)[0]
    return x * STEP, np.append(disturbance, np.zeros(3)) - rows @ x[free]


def drawn(where: tuple[int, ...], left: float, free: np.ndarray, draws: int = 4000) -> np.ndarray:
    """Mean squares of how far effects of a pattern, any way in it alike by what they leave, and as much as `left`, move each."""
    unit = [refitted(C[:, w], free) for w in where]
    visible = np.stack([rest for _, rest in unit], axis=1)
    back = np.linalg.inv(np.linalg.cholesky(visible.T @ visible)).T
    ways = np.random.default_rng(1).normal(size=(draws, len(where)))
    amplitude = left * (ways / np.linalg.norm(ways, axis=1)[:, None]) @ back.T
    assert np.linalg.norm(visible @ amplitude[0]) == pytest.approx(left)
    moved = np.stack([shift for shift, _ in unit], axis=1)
    return ((amplitude @ moved.T) ** 2).mean(axis=0)


@pytest.mark.parametrize("bound", [(False, False, False), (False, True, False)])
def test_it_is_how_far_effects_that_leave_as_much_move_the_fit(bound: tuple[bool, ...]) -> None:
    """4000 draws: their mean squares scatter by 2 % of themselves at most (1.4 / sqrt(4000)); three times that is allowed, half in
    the root. A parameter at its bound stays."""
    free = ~np.array(bound)
    found = systematic(fitted(bound), dictionary(a=(0, 1, 2), b=(3, 4)), 7.0)
    expected = np.sqrt(0.5 * (drawn((0, 1, 2), 7.0, free) + drawn((3, 4), 7.0, free)))
    np.testing.assert_allclose(found, expected, rtol=0.035)
    assert (found[~free] == 0.0).all()


def test_of_several_starts_the_one_that_moves_a_parameter_most_counts() -> None:
    one, other = (systematic(fitted(), dictionary(a=(w,)), 1.0) for w in (3, 4))
    assert np.any(one > other)
    assert np.any(other > one)
    several: Any = [(3,), (4,)]
    np.testing.assert_allclose(systematic(fitted(), dictionary(a=several), 1.0), np.maximum(one, other), rtol=1e-12)


def test_what_shows_nowhere_moves_nothing() -> None:
    """An effect that the robot's own parameters imitate altogether leaves nothing, and nothing that is left is its."""
    blind = SimpleNamespace(**{**vars(fitted()), "information": lambda: J.T @ J})
    assert (systematic(blind, dictionary(a=(5,)), 1.0) == 0.0).all()  # type: ignore[arg-type]
    seen = systematic(blind, dictionary(b=(4,)), 1.0)  # type: ignore[arg-type]
    np.testing.assert_allclose(systematic(blind, dictionary(a=(5,), b=(4,)), 1.0), seen, rtol=1e-12)  # type: ignore[arg-type]
    np.testing.assert_allclose(systematic(blind, dictionary(b=(4, 5)), 1.0), seen, rtol=1e-12)  # type: ignore[arg-type]
    assert (systematic(fitted(), dictionary(), 1.0) == 0.0).all()


def test_claimed_numbers_are_as_unsure_as_what_is_left_makes_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A day with an effect: standard errors of its final twin and of its claim are by noise, law and systematics."""
    recording = half(recorded_day("tendon_friction", 3.0, seed=6)[0])
    seen: dict[str, Any] = {}

    def keep(study: Any, judged: Any, known: Any) -> Any:
        seen["before"], seen["study"], seen["known"] = judged, study, known
        seen["after"] = with_systematic(study, judged, known)
        return seen["after"]

    monkeypatch.setattr(pipeline, "with_systematic", keep)
    found = diagnose(recording, Twin.of(load("continuum")), Settings())
    before, after = seen["before"], seen["after"]
    left = before.final.discrepancy.size * np.sqrt(seen["study"].objective.n)
    off = systematic(before.final.fit, seen["known"].beside(before.final.effects), left)
    names = [f.parameter.name for f in before.final.fit.model.free if f.effect == "tendon_friction"]
    at = [f.label for f in before.final.fit.model.free].index(f"tendon_friction.{names[0]}")
    (claim,) = found.claims
    was, now = before.claims[0].parameters[names[0]], claim.parameters[names[0]]
    assert now.value == was.value
    assert off[at] > 0.0
    assert now.std == pytest.approx(np.hypot(was.std, off[at]))
    np.testing.assert_allclose(after.final.fit.systematic, off, rtol=1e-9)  # sums over threads
    assert found.parameters == after.final.fit.fitted(None)
