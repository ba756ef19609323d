"""A twin of a rod as an MJCF: a chain of joints with one spatial tendon and one motor for each tendon, under the twin's loads.

The model is the twin's own with its loads (`loaded_body`) but for its tendons, which the twin divides at each hole so that friction
can lower the tension along them. `chain_of` divides them again and takes the loads out, which `Dynamics` puts in.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco

from twin.body import Loads
from twin.body.hinge_chain import HingeChain, hinge_pairs
from twin.foundation.errors import DataError
from twin.mechanics.mjcf import WrittenModel, check_same, exact_text, with_comments
from twin.mechanics.rod.dynamics import PAYLOAD_BODY, WALL_POST, loaded_body, pair_spring, wall_spring
from twin.prediction.mjcf.comments import Origins, chain_heading
from twin.prediction.twin import Twin
from twin.robots.families.continuum import add_segments

TIGHTEST = 100.0  # N, range of the controls, which only pull: far more than these tendons bear
_WAY_OUT = "remove the effect from the twin, or roll the twin out with `twin rollout`"


def export_chain(twin: Twin, body: HingeChain, origins: Origins) -> WrittenModel:
    """Return the twin of a rod as an MJCF, compiled and compared with the twin's own model.

    Raises DataError for an effect that changes stiffness in a trial, and for contact with a round post.
    """
    if softer := [e.id for e in twin.effects if e.acts_in("soften")]:
        raise DataError(f"effect {softer[0]} changes the stiffness within a trial, which an MJCF does not; {_WAY_OUT}")
    loads = twin.effect_chain.surround(Loads(twin.robot.gravity))
    if loads.wall[4] > 0.0 and loads.wall[9] > 0.0:
        raise DataError(f"effect contact has a round post (curvature above 0), which is not stepped; {_WAY_OUT}")
    spec = loaded_body(body, loads, 1.0).spec
    _remove_segments(spec)
    for spring in filter(None, (spec.tendon(wall_spring(disk)) for disk in body.disks)):
        spring.rgba = [0, 0, 0, 0]
    for i, holes in enumerate(body.tendon_sites, 1):
        _add_tendon(spec, f"tendon_{i}", holes, -TIGHTEST if body.pushes else 0.0)
    spec.modelname, spec.option.gravity = twin.robot.name, loads.gravity
    spec.stat.center, spec.stat.extent = [0, 0, 0.5 * body.length], 1.5 * body.length  # what a viewer shows: no distant post
    compiled = spec.compile()
    made = WrittenModel(with_comments(exact_text(spec), chain_heading(twin, origins), {}, ""), {})
    check_same(made.compile(), compiled, twin.robot.name)
    return made


def chain_of(spec: mujoco.MjSpec, body: HingeChain) -> HingeChain:
    """Return a twin's `body` with the model of its exported file, without the loads that stand there.

    Raises DataError for a file without the twin's tendons.
    """
    for i, holes in enumerate(body.tendon_sites, 1):
        name = f"tendon_{i}"
        tendon, motor = spec.tendon(name), spec.actuator(name)
        if tendon is None or motor is None:
            raise DataError(f"tendon and actuator {name!r} are not both in the model, as the twin beside it has; export it again")
        spec.delete(motor)
        spec.delete(tendon)
        add_segments(spec, i, holes)
    springs = [pair_spring(*pair) for pair in hinge_pairs(body)] + [wall_spring(disk) for disk in body.disks]
    for spring in filter(None, map(spec.tendon, springs)):
        spec.delete(spring)
    for load in (spec.body(PAYLOAD_BODY), spec.site(WALL_POST)):
        if load is not None:
            spec.delete(load)
    return replace(body, spec=spec)


def _remove_segments(spec: mujoco.MjSpec) -> None:
    for motor in list(spec.actuators):
        segment = spec.tendon(motor.target)
        spec.delete(motor)
        spec.delete(segment)


def _add_tendon(spec: mujoco.MjSpec, name: str, holes: tuple[str, ...], least: float) -> None:
    """Add a tendon through its holes, and a motor whose control is the tension in N, from `least`."""
    tendon = spec.add_tendon(name=name, width=2.5e-4, rgba=[0.85, 0.6, 0.15, 1])
    for hole in holes:
        tendon.wrap_site(hole)
    motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    motor.gear, motor.ctrllimited, motor.ctrlrange = [-1, 0, 0, 0, 0, 0], True, [least, TIGHTEST]
