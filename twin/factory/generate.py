"""The factory's floor: shards made by several processes, each shard from its own seeds, so that how many there are, or a kill in
between, changes nothing."""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed
from threadpoolctl import threadpool_limits

from twin.errors import DataError
from twin.factory import shard
from twin.factory.draw import LENGTH, draw, generator
from twin.factory.points import named_points
from twin.factory.solve import walk, weight_of
from twin.quantities import Parameter, Values
from twin.robots import Robot
from twin.soft import SoftBody, SoftStatics
from twin.spread import as_they_come
from twin.storage import read_twin, standard_errors

MANIFEST = "factory.json"
FORMAT = "twin-factory/1"
BYTES = 9_000  # a sample takes on disk; 8,050 of 60,000
SPARE = 1.1  # of what is needed must be free


@dataclass(frozen=True)
class Order:
    """What is to be made: `samples` of `robot` from `seed`; its uncertain numbers `doubts` are drawn normal, by value and std."""

    robot: Robot
    samples: int
    seed: int
    doubts: tuple[Parameter, ...]

    def manifest(self) -> dict[str, Any]:
        described = {p.name: p.value for p in self.robot.parameters}
        digest = hashlib.sha256(json.dumps([described, dict(self.robot.structure)], sort_keys=True).encode()).hexdigest()
        return {
            "format": FORMAT, "robot": self.robot.name, "description": digest, "samples": self.samples, "seed": self.seed,
            "doubts": {p.name: [p.value, p.std] for p in self.doubts},
        }  # fmt: skip


def doubts(source: str) -> tuple[Robot, tuple[Parameter, ...]]:
    """The robot of a twin.toml, a folder that holds one, or a robot's name; and its uncertain numbers: of a robot as described by
    its own std, of a calibrated twin around what was found, by the standard errors in its file where it has them."""
    twin = read_twin(source)
    errors = standard_errors(source)
    drawn = (replace(p, value=twin.values.get(p.name, p.value), std=errors.get(p.name, p.std)) for p in twin.robot.nuisance)
    return twin.robot, tuple(drawn)


def need(samples: int) -> int:
    """Bytes of disk that `samples` take, about."""
    return BYTES * samples


def generate(order: Order, folder: Path, jobs: int, progress: Callable[[int, float], None] = lambda done, rate: None) -> int:
    """Make what is missing of an order in `folder`; the number of samples without an equilibrium, all shards counted.

    `progress` hears how many samples there are and how many are made a second. Raises DataError for a robot of another family, a
    folder with another order, or too small a disk.
    """
    _finger(order.robot)
    named_points(order.robot)
    _begin(order, folder)
    todo = [k for k in range(-(-order.samples // shard.SIZE)) if not _path(folder, k).exists()]
    begun, made = time.perf_counter(), 0
    done = order.samples - sum(_rows(order, k) for k in todo)
    for rows in as_they_come((delayed(_shard)(order, folder, k) for k in todo), jobs):
        made += rows or 0
        progress(done + made, made / (time.perf_counter() - begun))
    return int((~shard.read(folder, ["converged"])["converged"]).sum())


def _begin(order: Order, folder: Path) -> None:
    path, mine = folder / MANIFEST, order.manifest()
    if path.exists():
        try:
            there = json.loads(path.read_text("utf-8"))
        except (OSError, ValueError):
            there = None
        if there != mine:
            raise DataError(f"{folder} holds another order; give a new folder with --out, or ask for the same to go on with it")
        return
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DataError(f"{folder} is there already and no order of the factory; give a new folder with --out")
    folder.mkdir(parents=True, exist_ok=True)
    if (free := shutil.disk_usage(folder).free) < SPARE * need(order.samples):
        folder.rmdir()
        raise DataError(f"{folder}: {need(order.samples) / 1e9:.2g} GB are needed, {free / 1e9:.2g} GB are free; ask for fewer")
    part = path.with_suffix(".part")
    part.write_text(json.dumps(mine, indent=1) + "\n", "utf-8")
    part.replace(path)


def _path(folder: Path, k: int) -> Path:
    return folder / f"samples-{k:05d}.parquet"


def _rows(order: Order, k: int) -> int:
    return min(shard.SIZE, order.samples - k * shard.SIZE)


def _shard(order: Order, folder: Path, k: int) -> int:
    """Make shard k; how many samples it has."""
    robot, rows = order.robot, _rows(order, k)
    points, nominal = named_points(robot).rest, _finger(robot)
    azimuth = np.arctan2(nominal.paths[:, 0, 1], nominal.paths[:, 0, 0])
    chains = []
    with threadpool_limits(limits=1):
        for c in range(-(-rows // LENGTH)):
            rng = generator(order.seed, k * shard.CHAINS + c)
            chain = draw(rng, nominal.cone, azimuth, order.doubts)
            body = _finger(robot, chain.values)
            chains.append((chain, walk(SoftStatics(body), chain, weight_of(body, robot.gravity))))
    shard.write(_path(folder, k), shard.table(chains, k * shard.SIZE, nominal.lattice.weights(points), rows))
    return rows


def _finger(robot: Robot, values: Values | None = None) -> SoftBody:
    return robot.silicone(robot.build(values))
