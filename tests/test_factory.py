"""The data factory: what it makes depends on the order alone, goes on after a stop, and is what the twin's statics says."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twin.errors import DataError
from twin.factory import Order, draw, generate, named_points, shard, varied
from twin.factory.solve import hang, weight_of
from twin.robots import load
from twin.soft import SoftBody, SoftStatics
from twin.soft.newton import settle
from twin.soft.solid import Solid

SAMPLES = shard.SIZE + 40  # a shard, and two chains and a half of another


@pytest.fixture(scope="module")
def order() -> Order:
    robot = load("finger")
    return Order(robot, SAMPLES, 3, robot.nuisance)


@pytest.fixture(scope="module")
def made(order: Order, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("factory") / "data"
    generate(order, folder, jobs=2)
    return folder


def digests(folder: Path) -> list[str]:
    return [hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(folder.glob("*.parquet"))]


def test_workers_and_a_stop_change_nothing(order: Order, made: Path, tmp_path: Path) -> None:
    """Three worker processes against two, and two that go on where a shard was lost and another half written."""
    again = tmp_path / "again"
    generate(order, again, jobs=3)
    assert digests(again) == digests(made)
    sorted(again.glob("*.parquet"))[1].unlink()
    (again / "samples-00001.parquet.part").write_bytes(b"half a shard")
    generate(order, again, jobs=2)
    assert digests(again) == digests(made)


def test_what_was_solved_before_changes_no_bit(order: Order) -> None:
    """Forces of another memory layout are solved by the same compiled function: numba would compile one of their own, whose sums
    run in another order, and take it for plain arrays later on."""
    body = order.robot.build()
    assert isinstance(body, SoftBody)
    weight, parts = weight_of(body, order.robot.gravity), SoftStatics(body).parts

    def hanging(force: np.ndarray) -> np.ndarray:
        solid = Solid(parts)
        shape = solid.rest()
        hang(solid, shape, force)
        return shape.u

    plain, compiled = hanging(weight), len(settle.signatures)
    wide = np.zeros((len(weight), 6))
    wide[:, ::2] = weight
    for other in (wide[:, ::2], np.asfortranarray(weight), np.broadcast_to(weight, weight.shape)):
        assert np.array_equal(hanging(other), plain)
    assert len(settle.signatures) == compiled


def test_a_longer_order_begins_with_the_same_samples(order: Order, made: Path, tmp_path: Path) -> None:
    generate(replace(order, samples=16), tmp_path / "short", jobs=2)
    short, long = (shard.read(f, ["nodes", "resistance"]) for f in (tmp_path / "short", made))
    assert np.array_equal(short["nodes"], long["nodes"][:16])
    assert np.array_equal(short["resistance"], long["resistance"][:16])


def test_samples_hold_together(order: Order, made: Path) -> None:
    """Vertices and strains follow from the nodes, to the single precision that these are kept in; tendons keep their word."""
    d = shard.read(made, ["sample", "converged", "nodes", "vertices", "strain", "command", "tension"])
    assert d["sample"].tolist() == list(range(SAMPLES))
    assert d["converged"].all()
    body = order.robot.build()
    nodes = d["nodes"].astype(float).reshape(SAMPLES, -1, 3)
    moved = np.einsum("pn,snk->spk", body.lattice.weights(named_points(order.robot).rest), nodes)
    assert np.abs(moved.reshape(SAMPLES, -1) - d["vertices"]).max() < 1e-7  # m: single precision of centimetres
    assert np.abs(SoftStatics(body).sensed(nodes)["strain"] - d["strain"]).max() < 1e-6
    assert (d["tension"] >= 0.0).all()
    assert not d["tension"][(d["command"] < -14e-3)].any()  # paid out: slack


def test_another_order_in_the_same_folder_is_refused(order: Order, made: Path) -> None:
    with pytest.raises(DataError, match="another order"):
        generate(replace(order, seed=4), made, jobs=1)


def test_a_robot_that_is_no_finger_is_refused(order: Order, tmp_path: Path) -> None:
    robot = load("continuum")
    with pytest.raises(DataError, match="no soft body"):
        generate(Order(robot, 16, 0, robot.nuisance), tmp_path / "rod", jobs=1)
    assert not (tmp_path / "rod").exists()


def test_a_broken_shard_is_named(tmp_path: Path) -> None:
    (tmp_path / "samples-00000.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(DataError, match="cannot be read"):
        shard.read(tmp_path, ["nodes"])


def test_routing_differs_between_fingers_by_the_spread_that_was_ordered(tmp_path: Path) -> None:
    """Each tendon by a draw of its own; shapes follow their own finger's tendons, and what is not ordered stays as it was."""
    robot = load("finger")
    routing = varied(robot, ["tendons.azimuth = 3 deg", "tendons.radius_end = 0.4 mm"])
    assert [p.name for p in routing] == [*(f"tendons.azimuth_{i}" for i in range(1, 5)), "tendons.radius_end"]
    generator = [draw.generator(5, c) for c in range(300)]
    body, azimuth = robot.build(), np.zeros(4)
    assert isinstance(body, SoftBody)
    drawn = [draw.draw(g, body.cone, azimuth, routing).values for g in generator]
    for p in routing:  # 300 draws: a standard deviation is known to 4 %
        assert np.std([v[p.name] for v in drawn]) == pytest.approx(p.std, rel=0.13)
    assert abs(np.corrcoef([[v[p.name] for v in drawn] for p in routing])[0, 1]) < 0.2
    for name, vary in (("as described", ()), ("varied", routing)):
        generate(Order(robot, 16, 3, vary), tmp_path / name, jobs=1)
    plain, other = (shard.read(tmp_path / n, ["nodes", "converged"]) for n in ("as described", "varied"))
    assert plain["converged"].all()
    assert other["converged"].all()
    assert np.abs(plain["nodes"] - other["nodes"]).max() > 5e-4  # m: 3 deg of 60 degrees' bend move a tip by millimetres


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("tendons.azimuth", "says no spread"),
        ("tendons.azimut = 2 deg", "did you mean"),
        ("tendons.azimuth = 2 mm", "wrong dimension"),
        ("tendons.azimuth = 2", "unit"),
        ("tendons.radius_end = 0 mm", "above zero"),
        ("tendons.radius_end = 9 mm", "at most 0.00115 m"),
        ("tendons.radius_end = nan mm", "above zero"),
    ],
)
def test_a_spread_that_makes_no_sense_is_refused(text: str, said: str) -> None:
    with pytest.raises(DataError, match=said):
        varied(load("finger"), [text])
