"""The data factory: what it makes depends on the order alone, goes on after a stop, and is what the twin's statics says."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twin.foundation.errors import DataError
from twin.mechanics.silicone import SoftBody, SoftStatics
from twin.mechanics.silicone.newton import solve_sample
from twin.mechanics.silicone.single_equilibrium import SoftEquilibrium, hang_at_rest, nodal_weight
from twin.robots import load
from twin.robots.named_points import named_points
from twin.shape.training_data import GenerationOrder, draw, generate_shards, parse_spreads, shard

SAMPLES = shard.SAMPLES_PER_SHARD + 40  # a shard, and two chains and a half of another


@pytest.fixture(scope="module")
def order() -> GenerationOrder:
    robot = load("finger")
    return GenerationOrder(robot, SAMPLES, 3, robot.nuisance)


@pytest.fixture(scope="module")
def made(order: GenerationOrder, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("factory") / "data"
    generate_shards(order, folder, jobs=2)
    return folder


def digests(folder: Path) -> list[str]:
    return [hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(folder.glob("*.parquet"))]


def test_workers_and_a_stop_change_nothing(order: GenerationOrder, made: Path, tmp_path: Path) -> None:
    """Three worker processes against two, and two that go on where a shard was lost and another half written."""
    again = tmp_path / "again"
    generate_shards(order, again, jobs=3)
    assert digests(again) == digests(made)
    sorted(again.glob("*.parquet"))[1].unlink()
    (again / "samples-00001.parquet.part").write_bytes(b"half a shard")
    generate_shards(order, again, jobs=2)
    assert digests(again) == digests(made)


def test_what_was_solved_before_changes_no_bit(order: GenerationOrder) -> None:
    """Forces of another memory layout are solved by the same compiled function: numba would compile one of their own, whose sums
    run in another order, and take it for plain arrays later on."""
    body = order.robot.build()
    assert isinstance(body, SoftBody)
    weight, parts = nodal_weight(body, order.robot.gravity), SoftStatics(body).arrays

    def hanging(force: np.ndarray) -> np.ndarray:
        solid = SoftEquilibrium(parts)
        shape = solid.undeformed()
        hang_at_rest(solid, shape, force)
        return shape.u

    plain, compiled = hanging(weight), len(solve_sample.signatures)
    wide = np.zeros((len(weight), 6))
    wide[:, ::2] = weight
    for other in (wide[:, ::2], np.asfortranarray(weight), np.broadcast_to(weight, weight.shape)):
        assert np.array_equal(hanging(other), plain)
    assert len(solve_sample.signatures) == compiled


def test_a_longer_order_begins_with_the_same_samples(order: GenerationOrder, made: Path, tmp_path: Path) -> None:
    generate_shards(replace(order, samples=16), tmp_path / "short", jobs=2)
    short, long = (shard.read_columns(f, ["nodes", "resistance"]) for f in (tmp_path / "short", made))
    assert np.array_equal(short["nodes"], long["nodes"][:16])
    assert np.array_equal(short["resistance"], long["resistance"][:16])


def test_samples_hold_together(order: GenerationOrder, made: Path) -> None:
    """Vertices and strains follow from the nodes, to the single precision that these are kept in; tendons keep their word."""
    d = shard.read_columns(made, ["sample", "converged", "nodes", "vertices", "strain", "command", "tension"])
    assert d["sample"].tolist() == list(range(SAMPLES))
    assert d["converged"].all()
    body = order.robot.build()
    nodes = d["nodes"].astype(float).reshape(SAMPLES, -1, 3)
    moved = np.einsum("pn,snk->spk", body.lattice.weights(named_points(order.robot).rest), nodes)
    assert np.abs(moved.reshape(SAMPLES, -1) - d["vertices"]).max() < 1e-7  # m: single precision of centimetres
    assert np.abs(SoftStatics(body).sensor_signals(nodes)["strain"] - d["strain"]).max() < 1e-6
    assert (d["tension"] >= 0.0).all()
    assert not d["tension"][(d["command"] < -14e-3)].any()  # paid out: slack


def test_another_order_in_the_same_folder_is_refused(order: GenerationOrder, made: Path) -> None:
    with pytest.raises(DataError, match="another order"):
        generate_shards(replace(order, seed=4), made, jobs=1)


def test_a_robot_that_is_no_finger_is_refused(order: GenerationOrder, tmp_path: Path) -> None:
    robot = load("continuum")
    with pytest.raises(DataError, match="no soft body"):
        generate_shards(GenerationOrder(robot, 16, 0, robot.nuisance), tmp_path / "rod", jobs=1)
    assert not (tmp_path / "rod").exists()


def test_a_broken_shard_is_named(tmp_path: Path) -> None:
    (tmp_path / "samples-00000.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(DataError, match="cannot be read"):
        shard.read_columns(tmp_path, ["nodes"])


def test_routing_differs_between_fingers_by_the_spread_that_was_ordered(tmp_path: Path) -> None:
    """Each tendon by a draw of its own; shapes follow their own finger's tendons, and what is not ordered stays as it was."""
    robot = load("finger")
    routing = parse_spreads(robot, ["tendons.azimuth = 3 deg", "tendons.radius_end = 0.4 mm"])
    assert [p.name for p in routing] == [*(f"tendons.azimuth_{i}" for i in range(1, 5)), "tendons.radius_end"]
    generator = [draw.chain_rng(5, c) for c in range(300)]
    body, azimuth = robot.build(), np.zeros(4)
    assert isinstance(body, SoftBody)
    drawn = [draw.draw_chain(g, body.cone, azimuth, routing).values for g in generator]
    for p in routing:  # 300 draws: a standard deviation is known to 4 %
        assert np.std([v[p.name] for v in drawn]) == pytest.approx(p.std, rel=0.13)
    assert abs(np.corrcoef([[v[p.name] for v in drawn] for p in routing])[0, 1]) < 0.2
    for name, vary in (("as described", ()), ("varied", routing)):
        generate_shards(GenerationOrder(robot, 16, 3, vary), tmp_path / name, jobs=1)
    plain, other = (shard.read_columns(tmp_path / n, ["nodes", "converged"]) for n in ("as described", "varied"))
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
        parse_spreads(load("finger"), [text])
