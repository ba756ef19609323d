"""What counts as worse on trials that no fit has seen."""

from __future__ import annotations

from dataclasses import replace

from tests.conftest import Day
from twin.bench import prepare
from twin.diagnose import Settings
from twin.diagnose.held_out import HeldOut
from twin.diagnose.objective import objective_of
from twin.effects import named
from twin.robots import load
from twin.twin import Twin


def test_what_only_displacements_show_is_no_worse_for_the_last_digits_of_the_markers(bench: Day) -> None:
    """0.1 mm/N of stretch: the displacements' error falls, the markers' changes with what a refit moves, here 1e-5 of E."""
    robot = load("continuum")
    prepared = prepare(bench("tendon_elasticity", 2.0)[0].select(["slow_1", "pair_3", "circle_1", "circle_2"]), robot)
    plain = Twin.of(robot)
    noise = objective_of(prepared, plain, [0, 1], Settings())[1].whitener.noise
    held_out = HeldOut(prepared, [2, 3], noise)
    E = next(p for p in robot.parameters if p.name == "backbone.youngs_modulus").value
    right = replace(plain, effects=(named("tendon_elasticity")({"stretch": 1e-4}, 3),))
    refitted = (replace(right, values={"backbone.youngs_modulus": E * (1.0 + d)}) for d in (1e-5, -1e-5))
    worst = max(refitted, key=held_out.error)
    assert held_out.error(worst) > held_out.error(plain)
    assert not held_out.worse(worst, plain)
    assert held_out.worse(plain, right)
    # a robot 10 % too soft makes the markers' error worse, though the displacements' falls more
    soft = replace(right, values={"backbone.youngs_modulus": 0.9 * E})
    assert held_out.worse(soft, plain)
