"""Every family of bodies keeps what the seam promises (twin/body/body.py); a new one is tested here unasked."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path as File

import mujoco
import numpy as np
import pytest

import twin
from twin.body import Body, Drive, Loads, Problem, Signals, Solution
from twin.foundation.errors import DataError
from twin.measurements import Channel
from twin.prediction.prepared import ORIENTED
from twin.robots import Family, Robot, family_names, load, load_family, robot_names

# Every robot that ships: a family without one fails below.
robots = pytest.mark.parametrize("name", robot_names())
N = 40
SMALL = {
    Drive.TENSION: 1.0, Drive.DISPLACEMENT: 1e-3, Drive.CURRENT: 0.5, Drive.CONTROL: 2e-3,
}  # fmt: skip  # N, m, A, m or rad: what every robot here can take


def through(robot: Robot) -> tuple[Body, tuple[Drive, ...], np.ndarray]:
    """The robot's body, what drives each tendon through the first port of each of its drives, and small commands (N, n_tendon)."""
    body = robot.build()
    ports = [drive[0] for drive in body.ports]
    pull = np.array([p.tendon_gains for p in ports])
    readings = np.stack([np.sin(np.linspace(0, np.pi, N)) ** 2 * (k + 1) / len(ports) for k in range(len(ports))], axis=1)
    kinds = tuple(ports[int(np.argmax(np.abs(pull[:, t])))].drive for t in range(body.n_tendon))
    size = np.array([SMALL[k] for k in kinds]) / np.abs(pull).max()
    return body, kinds, readings @ pull * size


def solved(robot: Robot, loads: Loads | None = None, **changes: object) -> Solution:
    body, kinds, command = through(robot)
    problem = Problem(0.5 * np.arange(N), command, loads or Loads(robot.gravity), drives=kinds)
    return robot.solver(body).solve(replace(problem, **changes))


def test_every_family_has_a_robot() -> None:
    assert {load(name).family for name in robot_names()} == set(family_names())


@robots
def test_its_ports_are_channels_of_the_contract(name: str) -> None:
    body = load(name).build()
    units = {"tension": "N", "displacement": "m", "angle": "rad", "current": "A", "voltage": "V", "torque": "N*m"}
    for ports in body.ports:
        for port in ports:
            assert len(port.tendon_gains) == body.n_tendon
            unit = "m" if port.drive is Drive.CONTROL else units[port.channel.rpartition("_")[2]]
            assert Channel(port.channel, "input", unit).kind
    units |= {"marker": "m", "temperature": "K", "resistance": "ohm", "sensor": "ohm"}
    units |= {"turn": "rad", "angles": "rad", "imu rate": "rad/s", "imu force": "m/s^2"}
    for channel, sense in body.senses.items():
        assert Channel(channel, "output", sense.unit or units[sense.group]).kind, channel
    for channel, field in body.load_channels.items():
        assert Channel(channel, "input", units[channel.rpartition("_")[2]]).kind
        assert field in Loads.__dataclass_fields__


@robots
def test_what_it_senses_is_in_its_signals(name: str) -> None:
    robot = load(name)
    path = solved(robot)
    assert path.status.all()
    seen = Signals(
        0.5 * np.arange(N), 0.5 * np.arange(N), path.tension, path.path, path.markers, np.full(N, 296.15), others=path.others
    )  # fmt: skip
    for channel, sense in robot.build().senses.items():
        if sense.required_drive is None and sense.group not in ORIENTED:
            column = seen.group(sense.group)[:, sense.index, sense.axis]
            assert column.shape == (N,), channel
            assert np.isfinite(column).all(), channel


@robots
def test_nothing_pulls_nothing_moves(name: str) -> None:
    """Unloaded and undriven a body stands at the shape that MuJoCo gives the compiled model, its paths at rest."""
    robot = load(name)
    body, kinds, command = through(robot)
    solver = robot.solver(body)
    path = solver.solve(Problem(np.arange(3.0), 0.0 * command[:3], Loads(np.zeros(3)), drives=kinds))
    # m: solvers stop at 1e-7 rad in every hinge, over half a metre of body at most
    np.testing.assert_allclose(path.path, np.broadcast_to(solver.straight_path, (3, body.n_tendon)), rtol=0, atol=1e-7)
    model = body.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    at_rest = np.array([data.site(site).xpos for site in body.marker_sites]).reshape(-1, 3)
    np.testing.assert_allclose(path.markers[-1], at_rest, rtol=0, atol=1e-7)


@robots
def test_a_trial_does_not_know_what_was_solved_before(name: str) -> None:
    robot = load(name)
    body, kinds, command = through(robot)
    solver = robot.solver(body)
    problem = Problem(0.5 * np.arange(N), command, Loads(robot.gravity), drives=kinds)
    one = solver.solve(problem)
    solver.solve(replace(problem, command=command[::-1].copy(), loads=Loads(-robot.gravity)))
    two = solver.solve(problem)
    np.testing.assert_array_equal(one.q, two.q)
    np.testing.assert_array_equal(one.tension, two.tension)


@robots
def test_two_bodies_share_nothing(name: str) -> None:
    robot = load(name)
    one, other = robot.build(), robot.build()
    before = one.spec.compile().body_mass.copy()
    for body in other.spec.bodies[1:]:
        body.mass = 7.0
    np.testing.assert_array_equal(one.spec.compile().body_mass, before)


@robots
def test_what_was_asked_is_not_changed(name: str) -> None:
    robot = load(name)
    body, kinds, command = through(robot)
    time, loads = 0.5 * np.arange(N), Loads(robot.gravity.copy(), 0.01)
    kept = command.copy(), loads.gravity.copy()
    robot.solver(body).solve(Problem(time, command, loads, drives=kinds))
    np.testing.assert_array_equal(command, kept[0])
    np.testing.assert_array_equal(loads.gravity, kept[1])


@robots
def test_motion_comes_to_rest_where_statics_stands(name: str) -> None:
    robot = load(name)
    if load_family(robot.family).dynamics is None:
        with pytest.raises(Exception, match="statics only"):
            robot.solver(robot.build(), dynamic=True)
        return
    body, kinds, command = through(robot)
    held = np.repeat(0.3 * command[N // 2][None], 3, axis=0)
    still = Problem(np.array([0.0, 0.05, 0.1]), held, Loads(robot.gravity), drives=kinds)
    moving = robot.solver(body, dynamic=True).solve(still)
    standing = robot.solver(robot.build()).solve(still)
    # m: it starts in equilibrium and nothing changes; 1e-5 m is what friction-free statics and stepping agree to elsewhere
    np.testing.assert_allclose(moving.markers[-1], standing.markers[-1], rtol=0, atol=1e-5)


def test_every_family_says_what_its_bodies_can() -> None:
    """All that `Family` declares, None where a body cannot, and a view gives the body itself."""
    for name in robot_names():
        robot, said = load(name), load_family(load(name).family)
        assert set(Family.__annotations__) <= set(vars(said))
        views = [robot.chain, robot.silicone, robot.hand]
        there = [said.chain, said.silicone, said.hand]
        for ask, view in zip(views, there, strict=True):
            body = robot.build()
            if view is None:
                with pytest.raises(DataError, match=f"robot '{name}' .*: give"):
                    ask(body)
            else:
                assert ask(body) is body


HOME = ("robots", "mechanics")  # families, and the mechanics that they are made of


def of_families() -> set[str]:
    """Names of classes that only families know: their bodies, solvers, and what these answer."""
    robots = [load(name) for name in robot_names()]
    moving = [r for r in robots if load_family(r.family).dynamics is not None]
    solvers = [r.solver(r.build()) for r in robots] + [r.solver(r.build(), dynamic=True) for r in moving]
    found, new = {type(s) for s in solvers}, [Body, Solution]
    while new:
        new = [c for kind in new for c in kind.__subclasses__()]
        found |= set(new)
    return {c.__name__ for c in found}


def told_apart(tree: ast.Module, classes: set[str]) -> Iterator[int]:
    """Lines that ask which family a body is of: by its class, by the family's name or by the family's own module."""
    modules = {f"twin.robots.{part}.{name}" for name in family_names() for part in ("families", "schemas")}
    for node in ast.walk(tree):
        named: set[str] = set()
        match node:
            case ast.Call(func=ast.Name(id="isinstance" | "issubclass" | "cast"), args=args):
                inside = [n for a in args for n in ast.walk(a)]
                named = {str(getattr(n, "id", getattr(n, "value", ""))) for n in inside}  # of a name or in quotes
            case ast.MatchClass(cls=ast.Name(id=name)):
                named = {name}
            case ast.Compare(left=left, comparators=others):
                asked = any(isinstance(n, ast.Attribute) and n.attr == "family" for n in (left, *others))
                named = classes if asked else set()
            case ast.ImportFrom(module=module, names=names):
                imported = {str(module), *(f"{module}.{n.name}" for n in names)}
                named = classes if imported & modules else set()
        if named & classes:
            yield node.lineno


def test_outside_a_family_nobody_asks_which_it_is() -> None:
    """A capability is asked for (`Body.parts`, `Family`), never a class: a body that nobody planned then needs no second place."""
    classes, root = of_families(), File(twin.__file__).parent
    assert {"HingeChain", "SoftBody", "HandBody", "Equilibrium", "SoftStatics"} <= classes
    found = [
        f"{file.relative_to(root)}:{line}"
        for file in sorted(root.rglob("*.py"))
        if file.relative_to(root).parts[0] not in HOME and file.parent.name != "mjcf"  # what writes that family's models
        for line in told_apart(ast.parse(file.read_text()), classes)
    ]
    assert found == []


@pytest.mark.parametrize(
    "line",
    [
        "assert isinstance(body, SoftBody)",
        "solver = cast('Equilibrium', solver)",
        "if robot.family != 'hand': pass",
        "from twin.robots.schemas.hand import Hand",
        "from twin.robots.families import continuum",
    ],
)
def test_and_who_asks_is_found(line: str) -> None:
    assert list(told_apart(ast.parse(line), of_families())) == [1]
