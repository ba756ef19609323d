"""Every law of an MJCF against a simulator whose equations are written by hand, with equal numbers on both sides."""

from __future__ import annotations

from tools.benchmarks.solvers.articulated_laws import compare
from twin.effects import catalogue

FASTER_THAN_STEPS = {"tendon_elasticity": 1.0}  # a line that falls slack for a moment; the twin's has no memory of its drum


def test_the_laws_of_a_leg_are_those_of_the_simulator() -> None:
    """Differences are those of the twin's steps of 2 ms, a tenth of the noise of a good bench; effects move several times it."""
    found = {c.effect: c for c in compare("leg", each=1)}
    assert len(found) == 18
    assert set(found) - {""} <= set(catalogue())
    for effect, compared in found.items():
        assert compared.difference < FASTER_THAN_STEPS.get(effect, 0.25), compared
        assert not effect or compared.moved > 4.0 * compared.difference, compared
