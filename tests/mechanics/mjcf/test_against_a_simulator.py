"""Every law of an MJCF against a simulator whose equations are written by hand, with equal numbers on both sides."""

from __future__ import annotations

from tools.benchmarks.solvers.articulated_laws import compare
from twin.effects import catalogue

# sigma: the robot as described differs by 0.1 in steps of 2 ms; where a force jumps (a limit, a tendon that turns back) by 0.18
MOST = 0.25


def test_the_laws_of_a_leg_are_those_of_the_simulator() -> None:
    """They differ by the twin's steps; effects move several times as much."""
    found = {c.effect: c for c in compare("leg", each=1)}
    assert len(found) == 18
    assert set(found) - {""} <= set(catalogue())
    for effect, compared in found.items():
        assert compared.difference < MOST, compared
        assert not effect or compared.moved > 4.0 * compared.difference, compared
