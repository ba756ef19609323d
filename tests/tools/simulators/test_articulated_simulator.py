"""The simulator of articulated robots against closed forms, hand calculations, its own halved step and the file contract."""

from __future__ import annotations

import csv
import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipk

from tools.simulators.articulated.bench import Trial, observe
from tools.simulators.articulated.day import Recipe, make_set
from tools.simulators.articulated.describe import mjcf, robot_toml
from tools.simulators.articulated.drives import all_effects
from tools.simulators.articulated.dynamics import inertial, march, place, rest_state
from tools.simulators.articulated.plant import Plant, plant
from tools.simulators.articulated.robots import BASE, ROBOTS, Joint, Link, Robot, Via, Winch, delivered, tolerances
from tools.simulators.articulated.trials import session

FREE = {"stiffness": 0.0, "damping": 0.0, "armature": 0.0, "low": -1e3, "high": 1e3}


def one_joint(**changes: float) -> Robot:
    """A single link on a spring with one tendon over its hinge, base via (-30, 10) mm, link via (40, 8) mm."""
    joint = Joint("hinge", 0.2, 0.1, 0.02, 0.0, -3.0, 3.0, 0.1, 0.1, 1.0)
    return replace(
        ROBOTS["tendon_finger"](), sense=1.0, links=(Link("link", 0.1, 0.05, 0.04, 2e-5),), joints=(replace(joint, **changes),),
        vias=(Via("t_1", "t", BASE, -0.03, 0.01), Via("t_2", "t", 0, 0.04, 0.008)),
        drives=(Winch("t_winch", "t", 1500.0, 5.0, 50.0, 0.068, 5.0),), encoders=("hinge",), moves=(),
    )  # fmt: skip


def run(made: Plant, start: np.ndarray, command: np.ndarray, every: float, h: float = 1e-4) -> np.ndarray:
    """Rows of the simulator from rest in a pose, without settling."""
    return march(made, rest_state(made, start, command[0]), command, every, 0.0, h)


def passive(robot: Robot, **joints: float) -> Plant:
    """A robot without drives, tendons and friction."""
    bare = replace(robot, drives=(), vias=(), joints=tuple(replace(j, **(FREE | joints)) for j in robot.joints))
    return plant(bare, 0.0)


def energy(made: Plant, q: np.ndarray, w: np.ndarray) -> tuple[float, float]:
    """Kinetic and potential energy of a passive chain from the positions of its masses alone, no Jacobian."""
    chain = made.chain

    def centres(q: np.ndarray) -> np.ndarray:
        angles = chain.sense * np.cumsum(q)
        along = np.column_stack([np.cos(angles), np.sin(angles)])
        ends = np.cumsum(chain.length[:, None] * along, axis=0)
        return ends - chain.length[:, None] * along + chain.com[:, None] * along

    speed = (centres(q + 1e-5 * w) - centres(q - 1e-5 * w)) / 2e-5
    kinetic = 0.5 * np.sum(chain.mass * np.sum(speed**2, axis=1)) + 0.5 * np.sum(chain.inertia * np.cumsum(w) ** 2)
    return float(kinetic + 0.5 * np.sum(chain.armature * w**2)), float(-np.sum(chain.mass * (centres(q) @ chain.gravity)))


@pytest.mark.parametrize("name", ROBOTS)
def test_mass_matrix_is_the_hessian_of_the_kinetic_energy(name: str) -> None:
    made = plant(ROBOTS[name](), 0.03)
    rng, n = np.random.default_rng(0), len(made.chain.mass)
    q, frame, M = rng.uniform(-1, 1, n), np.zeros((n + 2, 4)), np.zeros((n, n))
    place(made.chain, q, frame)
    inertial(made.chain, frame, np.zeros(n), M, np.zeros(n))
    one = np.eye(n)
    # A quadratic form has exact polarisation; the positions' differences leave 1e-10 of the energy.
    bent = [[energy(made, q, one[i] + one[j])[0] - energy(made, q, one[i] - one[j])[0] for j in range(n)] for i in range(n)]
    np.testing.assert_allclose(M, 0.5 * np.array(bent), rtol=1e-7)


def test_undriven_chain_without_friction_keeps_its_energy() -> None:
    made = passive(ROBOTS["leg"]())
    start = np.array([1.2, -0.4, 0.7])
    rows = run(made, start, np.zeros((3001, 0)), 1e-3, 1e-4)
    q, before = rows[1:-1, :3], energy(made, start, np.zeros(3))[1]
    w = (rows[2:, :3] - rows[:-2, :3]) / 2e-3
    kinetic, potential = np.array([energy(made, *at) for at in zip(q, w, strict=True)]).T
    # The speeds are central differences over 2 ms, (omega dt)^2 / 6 < 1e-4 of the kinetic energy at 15 rad/s.
    swing = np.ptp(potential)
    assert swing > 1.0
    assert np.max(np.abs(kinetic + potential - before)) < 3e-4 * swing


def test_pendulum_swings_with_the_period_of_the_elliptic_integral() -> None:
    robot = replace(one_joint(**FREE), vias=(), drives=(), sense=-1.0, gravity=(9.81, 0.0))
    made = plant(robot, 0.0)
    reach = 1.5
    inertia = 2e-5 + 0.05 * 0.04**2
    period = 4.0 * np.sqrt(inertia / (0.05 * 9.81 * 0.04)) * ellipk(np.sin(reach / 2) ** 2)
    q = run(made, np.array([reach]), np.zeros((4001, 0)), 1e-3)[:, 0]
    down = np.flatnonzero((q[:-1] > 0) & (q[1:] <= 0))
    crossed = 1e-3 * (down + q[down] / (q[down] - q[down + 1]))
    # (omega h)^2 / 24 of a leapfrog is 1e-7; the crossing between rows is good to 1e-6 s.
    np.testing.assert_allclose(np.diff(crossed), period, rtol=1e-5)


def test_one_joint_rests_where_spring_weight_and_tendon_balance() -> None:
    """The tendon pulls the link's via along the line to the base's: torque T |r x d| / |d| towards the winch side."""
    command = 0.066

    def out_of_balance(q: float) -> float:
        c, s = np.cos(q), np.sin(q)
        x, z = 0.04 * c - 0.008 * s, 0.04 * s + 0.008 * c
        dx, dz = -0.03 - x, 0.01 - z
        length = np.hypot(dx, dz)
        pulled = 1500.0 * max(length - command, 0.0) * (x * dz - z * dx) / length
        return -0.2 * (q - 0.1) - 0.05 * 9.81 * 0.04 * c + pulled

    rows = run(plant(one_joint(), 0.0), np.array([0.1]), np.full((200, 1), command), 0.01)
    q, tension = rows[-1, 0], rows[-1, 4]
    assert tension > 1.0
    assert out_of_balance(q - 1e-8) > 0.0 > out_of_balance(q + 1e-8)


def test_a_sliding_tendon_loses_the_capstan_share_of_its_tension() -> None:
    """A stiff spring that a tendon winds up over one bend feels its tension less by e^{-mu theta}, mu = 0.3."""
    robot = one_joint(stiffness=0.0, rest=0.0)
    bend = (Via("t_1", "t", BASE, -0.03, 0.0), Via("t_2", "t", BASE, -0.01, 0.02), Via("t_3", "t", 0, 0.05, 0.01))
    robot = replace(robot, vias=bend, gravity=(0.0, 0.0))
    made = plant(robot, 0.0)
    tendons = made.tendons._replace(mu=np.array([0.3]), slip=2e-5)
    made = made._replace(tendons=tendons, chain=made.chain._replace(stiffness=np.array([5.0]), damping=np.array([0.5])))
    base = np.hypot(0.02, 0.02) + np.hypot(0.06, 0.01)
    command = (base - np.linspace(0.0, 0.02, 201))[:, None]
    rows = run(made, np.array([0.0]), command, 0.02)
    q, tension = rows[100:, 0], rows[100:, 4]
    end = np.column_stack([0.05 * np.cos(q) - 0.01 * np.sin(q), 0.05 * np.sin(q) + 0.01 * np.cos(q)])
    last = end - np.array([-0.01, 0.02])
    turn = np.abs(np.arctan2(last[:, 1], last[:, 0]) - 0.25 * np.pi)
    arm = np.abs(end[:, 0] * last[:, 1] - end[:, 1] * last[:, 0]) / np.hypot(*last.T)
    felt = (5.0 * np.abs(q) + 0.5 * np.abs(np.gradient(q, 0.02))) / arm
    assert np.all(turn > 0.5)
    # Without the log's ends, where the speed is one-sided; what is left is the distance to full sliding and the speed's difference.
    np.testing.assert_allclose((tension / felt)[1:-1], np.exp(0.3 * turn)[1:-1], rtol=1e-5)


@pytest.mark.parametrize("name", ROBOTS)
def test_halving_the_step_changes_nothing_that_is_seen(name: str) -> None:
    robot = ROBOTS[name]()
    day = session(robot, np.random.default_rng(1), camera=True)
    steps = next(t for t in day.trials if t.name == "held_steps")
    effects = [replace(all_effects()["joint_friction"].draw(robot, np.random.default_rng(2)), strength=0.05)]
    coarse, fine = observe(robot, effects, steps), observe(robot, effects, steps, 5e-5)
    for name, values in fine.items():
        kind = next(k for k in ("motor", "angle", "torque", robot.tip, robot.force) if k in name)
        sigma = robot.instruments[{robot.tip: "tip", robot.force: "tension"}.get(kind, kind)].sigma
        assert np.sqrt(np.mean((coarse[name] - values) ** 2)) < 0.1 * sigma, name


@pytest.mark.parametrize("name", ROBOTS)
def test_an_effect_of_strength_nothing_changes_nothing_and_else_something(name: str) -> None:
    robot = ROBOTS[name]()
    day = session(robot, np.random.default_rng(1), camera=True)
    trial = replace(next(t for t in day.trials if t.name == "held_steps"), start=300.0)
    trial = replace(trial, command=trial.command[: 3 * trial.rate])
    clean = observe(robot, [], trial, 2e-4)
    for id, effect in all_effects().items():
        if effect.fits(robot):
            drawn = effect.draw(robot, np.random.default_rng(3))
            off, on = (
                observe(robot, [replace(drawn, strength=s)], trial, 2e-4) for s in (0.0, min(6 * drawn.strength, drawn.most))
            )
            assert all(np.allclose(off[c], clean[c], rtol=0, atol=1e-9) for c in clean), id
            assert any(not np.allclose(on[c], clean[c], rtol=0, atol=1e-4) for c in clean), id


@pytest.mark.parametrize("name", ROBOTS)
def test_description_names_the_numbers_that_a_built_robot_differs_in(name: str) -> None:
    robot = ROBOTS[name]()
    described = tomllib.loads(robot_toml(robot))["parameters"]
    assert set(described) == {t.key for t in tolerances(robot)}
    root = ElementTree.fromstring(mjcf(robot))
    for key in described:
        kind, of, attribute = key.split(".")
        tag = {"actuator": "general"}.get(kind, kind)
        (element,) = [e for e in root.iter(tag) if e.get("name") == of]
        assert attribute in {"kp", "kv", "mass", "inertia"} or attribute in element.attrib
    assert np.max(np.abs(delivered(robot, np.random.default_rng(0)))) <= 2.0


def test_a_written_day_has_the_contracts_columns_and_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = Recipe("servo_arm", ("time_delay",), 3.0, 4)
    planned = session(ROBOTS["servo_arm"](), np.random.default_rng([4, 1]))
    kept = [t for t in planned.trials if t.name in ("steps", "random_1", "held_steps")]
    short = [replace(t, command=t.command[: 2 * t.rate]) for t in kept]
    monkeypatch.setattr("tools.simulators.articulated.day.session", lambda *_, **__: replace(planned, trials=tuple(short)))
    truth = make_set(tmp_path / "a", recipe)
    make_set(tmp_path / "b", recipe)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert [(tmp_path / "b" / p).read_bytes() for p in files] == [(tmp_path / "a" / p).read_bytes() for p in files]
    assert truth["truth"] == ["time_delay"]
    assert abs(truth["level"] - 3.0) < 0.2
    for part, names in (("measured", {"steps", "random_1"}), ("holdout", {"held_steps"})):
        folder = tmp_path / "a" / part
        told = tomllib.loads((folder / "measurements.toml").read_text())
        assert told["format"] == "twin-measurements/1"
        assert {t["file"] for t in told["trial"]} == {f"{n}.csv" for n in names}
        assert (folder / told["robot"] / "servo_arm.xml").exists()
        for trial in told["trial"]:
            with (folder / trial["file"]).open() as lines:
                rows = list(csv.DictReader(lines))
            assert list(rows[0]) == ["time", *(c["name"] for c in told["channel"])]
            assert np.all(np.diff([float(r["time"]) for r in rows]) > 0.0)
    # A white noise rounded to steps of its own size keeps its variance plus a twelfth of the step's square; 400 samples give 7 %.
    assert abs(truth["floor_by_channel"]["elbow_angle"] / (0.05 * np.sqrt(13 / 12)) - 1.0) < 0.25


def test_logs_leave_from_rest() -> None:
    robot = ROBOTS["leg"]()
    home = np.array([d.home for d in robot.drives])
    held = observe(robot, [], Trial("rest", np.tile(home, (100, 1)), 100, 0.1))
    assert np.ptp(held["hip_angle"]) < 0.01
    assert np.ptp(held["knee_angle"]) < 0.01
