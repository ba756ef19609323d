"""Tendon friction in the static solve: the capstan's loss, memory, and no clock."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.mechanics.rod.statics.test_balance import Energy, slope
from tests.mechanics.rod.statics.test_equilibrium import EXACT, FRICTION, HANGING, NOWHERE, SIDEWAYS, solver, swept, tips
from tools.simulators.rod.mechanics.rod import Rod, follow
from twin.body import Loads, Problem, Route
from twin.mechanics.rod import Equilibrium
from twin.robots import load


@pytest.mark.parametrize("pulling", [True, False])
def test_a_sliding_tendon_loses_what_the_capstan_says(pulling: bool) -> None:
    """The tensions of all segments are what balances the solved shape: least squares, 8 unknowns in 48 equations."""
    mu, body = 0.2, load("continuum").build()
    energy, e = Energy(body), Equilibrium(body)
    t, T = swept((0, 0, 0), (3, 0, 0), each=60) if pulling else swept((0, 0, 0), (4, 0, 0), (2, 0, 0), each=60)
    path = e.solve(Problem(t, T, Loads(NOWHERE), Route(mu, 2e-5), tolerance=EXACT))
    q = path.q[-1]
    np.testing.assert_array_equal(path.slip[0, 1:], 1.0 if pulling else -1.0)
    lengths = slope(lambda x: energy.segments(x)[0], q)  # (nv, 8)
    elastic = slope(lambda x: energy.elastic(x, np.zeros(48), T[-1].sum()), q)
    tension, rest, *_ = np.linalg.lstsq(lengths, -elastic, rcond=None)
    assert rest[0] < 1e-16  # (N m)^2: eight tensions explain all 48 equations, to the differences' 1e-9 N m
    d = energy.at(q)
    hole = np.array([d.site(n).xpos for n in body.tendon_sites[0]])
    u = np.diff(hole, axis=0) / np.linalg.norm(np.diff(hole, axis=0), axis=1)[:, None]
    turned = np.cumsum(np.arccos(np.clip((u[1:] * u[:-1]).sum(axis=1), -1, 1)))
    expected = T[-1, 0] * np.exp((-mu if pulling else mu) * np.append(0.0, turned))
    # N: the turn angle is rounded below 1e-3 rad, so up to mu * 1e-3 of the tension is missing at each of 7 holes
    np.testing.assert_allclose(tension, expected, rtol=0, atol=1.01 * mu * 7e-3 * expected.max())


def test_friction_remembers_the_way_and_holds_still() -> None:
    t, T = swept((0, 0, 0), (4, 0, 0), (2, 0, 0), (2, 0, 0))
    with_it = 1e3 * tips(solver().solve(Problem(t, T, Loads(HANGING), FRICTION)))
    without = 1e3 * tips(solver().solve(Problem(t, T, Loads(HANGING))))
    up, down = 20, 80  # samples at 2 N
    # mm: a released tendon pulls harder along the robot than a pulled one: 66.6 and 72.5 mm of x around 69.5 at mu 0.2 without
    # gravity (equilibrium.md); gravity takes part of it. A millimetre either way is a fifth of that.
    assert with_it[up, 0] < without[up, 0] - 1.0 < without[down, 0] < with_it[down, 0] - 1.0
    # mm: without friction there is no memory; two solves within 1e-7 rad in every hinge agree within 1e-3 mm
    np.testing.assert_allclose(without[up], without[down], rtol=0, atol=1e-3)
    # mm: held, nothing moves but the solver's last digits
    np.testing.assert_allclose(with_it[81:], with_it[80] + np.zeros((40, 3)), rtol=0, atol=1e-3)


def test_friction_does_not_know_the_clock() -> None:
    t, T = swept((0, 0, 0), (3, 1, 0), (1, 2, 0))
    fast, slow = (tips(solver().solve(Problem(x, T, Loads(HANGING), FRICTION))) for x in (t / 50, 7 * t**1.1))
    np.testing.assert_array_equal(fast, slow)


def test_loads_come_in_the_stated_order() -> None:
    """Gravity and payload first, then the first tensions from slack: a log that starts pulled is one that was ramped there."""
    loads = Loads(SIDEWAYS, 0.03)
    t, T = swept((0, 0, 0), (3, 1, 0), each=64)
    ramped = tips(solver().solve(Problem(t, T, loads, FRICTION)))[-1]
    at_once = tips(solver().solve(Problem(np.zeros(1), T[-1:], loads, FRICTION)))[0]
    # m: the documented difference of 8 steps from 64
    np.testing.assert_allclose(at_once, ramped, rtol=0, atol=5e-5)
    # The order matters: pulled while weightless and loaded afterwards, the same robot hangs millimetres away. That it does in
    # the rod's own law, too, is why the order is part of the answer.
    lead = np.linspace(0, 1, 64)
    drive = np.vstack([T[1:], np.repeat(T[-1:], 64, axis=0)])
    weight = np.append(np.zeros(64), lead)
    late = follow(Rod(), drive, gravity=SIDEWAYS, payload=0.03, weight=weight, mu=0.2)[-1].disks[-1]
    assert np.linalg.norm(late - ramped) > 1e-3


def test_more_steps_on_the_way_change_nothing_much() -> None:
    """Slip is integrated implicitly from sample to sample: a log of every tenth sample gives the same loop."""
    t, T = swept((0, 0, 0), (3, 0, 1), (0.5, 2, 0), (3, 0, 0), each=100)
    fine = tips(solver().solve(Problem(t, T, Loads(SIDEWAYS, 0.02), FRICTION)))
    coarse = tips(solver().solve(Problem(t[::10], T[::10], Loads(SIDEWAYS, 0.02), FRICTION)))
    # m: 0.3 N a sample against 0.03 N. Worst measured 0.22 mm between one step and 16 where a hole reverses on the way.
    np.testing.assert_allclose(coarse, fine[::10], rtol=0, atol=2.2e-4)


def test_few_samples_tell_the_same_history_as_many() -> None:
    """Jumps of up to 3 N from row to row, strong friction, pre-sliding of hundredths of a millimetre: the robot is pulled there, as
    in 64 rows. A robot let go in between was off by 20 mm; Newton's single steps, where they succeed, turn some holes' slip
    otherwise than the way there does, which is worth half a millimetre."""
    corner = np.array([[0, 0, 0], [3, 0, 0], [0.3, 0.4, 0], [0, 2.6, 0], [2, 0, 0], [0, 0, 3], [1, 0.2, 0]], float) + 0.1
    solver = Equilibrium(load("continuum").build())
    loads, rubbing = Loads(np.array([0.0, 0.0, 9.81]), payload=0.01), Route(mu=0.28, presliding=2e-5)
    fine = np.concatenate([corner[:1], *(a + (b - a) * np.arange(1, 65)[:, None] / 64 for a, b in pairwise(corner))])
    few = solver.solve(Problem(np.arange(len(corner)) * 1.0, corner, loads, rubbing))
    many = solver.solve(Problem(np.arange(len(fine)) / 64, fine, loads, rubbing))
    assert few.status.all()
    assert np.linalg.norm(few.markers - many.markers[::64], axis=2).max() < 8e-4
