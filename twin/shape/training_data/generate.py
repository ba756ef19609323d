"""Generate shards in several processes, each from its own seeds, so that the number of processes and interruptions change
nothing."""

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

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError
from twin.foundation.parallel import run_parallel
from twin.foundation.parameters import Parameter, Values
from twin.mechanics.silicone import SoftBody, SoftStatics
from twin.mechanics.silicone.single_equilibrium import nodal_weight
from twin.prediction.twin_file.storage import read_twin, standard_errors
from twin.robots import Robot
from twin.robots.named_points import named_points
from twin.shape.training_data import shard
from twin.shape.training_data.draw import CHAIN_LENGTH, chain_rng, draw_chain
from twin.shape.training_data.solve import solve_chain

MANIFEST = "factory.json"  # of a folder: the order it was made to
SHARDS_FORMAT = "twin-factory/1"
BYTES_PER_SAMPLE = 9_000  # on disk; 8,050 of 60,000 samples
DISK_MARGIN = 1.1  # of the bytes needed must be free


@dataclass(frozen=True)
class GenerationOrder:
    """An order of `samples` of `robot` from `seed`. Its uncertain numbers are drawn normal, by value and std."""

    robot: Robot
    samples: int
    seed: int
    uncertain: tuple[Parameter, ...]

    def manifest(self) -> dict[str, Any]:
        """Return the order as the folder's manifest states it."""
        described = {p.name: p.value for p in self.robot.parameters}
        digest = hashlib.sha256(json.dumps([described, dict(self.robot.structure)], sort_keys=True).encode()).hexdigest()
        return {
            "format": SHARDS_FORMAT, "robot": self.robot.name, "description": digest, "samples": self.samples, "seed": self.seed,
            "doubts": {p.name: [p.value, p.std] for p in self.uncertain},
        }  # fmt: skip


def uncertain_parameters(source: str) -> tuple[Robot, tuple[Parameter, ...]]:
    """Return the robot of a source and its uncertain numbers with their std.

    `source`: a twin.toml, a folder that holds one, or a robot's name. A robot as described has its own std; a calibrated twin is
    drawn about its fitted values, by the standard errors in its file where it has them.
    """
    twin = read_twin(source)
    errors = standard_errors(source)
    drawn = (replace(p, value=twin.values.get(p.name, p.value), std=errors.get(p.name, p.std)) for p in twin.robot.nuisance)
    return twin.robot, tuple(drawn)


def bytes_needed(samples: int) -> int:
    """Return about how many bytes of disk `samples` take."""
    return BYTES_PER_SAMPLE * samples


def generate_shards(
    order: GenerationOrder, folder: Path, jobs: int, progress: Callable[[int, float], None] = lambda done, rate: None
) -> int:
    """Make the missing shards of an order in `folder` and return how many samples of all shards have no equilibrium.

    `progress` receives the number of samples there are and how many are made a second. Raises DataError for a robot of another
    family, a folder with another order, or too small a disk.
    """
    _finger_body(order.robot)
    named_points(order.robot)
    _start_or_resume(order, folder)
    missing = [k for k in range(-(-order.samples // shard.SAMPLES_PER_SHARD)) if not _shard_path(folder, k).exists()]
    started, made = time.perf_counter(), 0
    done = order.samples - sum(_shard_rows(order, k) for k in missing)
    for rows in run_parallel((delayed(_make_shard)(order, folder, k) for k in missing), jobs):
        made += rows or 0
        progress(done + made, made / (time.perf_counter() - started))
    return int((~shard.read_columns(folder, ["converged"])["converged"]).sum())


def _start_or_resume(order: GenerationOrder, folder: Path) -> None:
    """Create the folder, or check that it holds this order."""
    path, manifest = folder / MANIFEST, order.manifest()
    if path.exists():
        try:
            existing = json.loads(path.read_text("utf-8"))
        except (OSError, ValueError):
            existing = None
        if existing != manifest:
            raise DataError(f"{folder} holds another order; give a new folder with --out, or ask for the same to go on with it")
        return
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DataError(f"{folder} is there already and no order of the factory; give a new folder with --out")
    folder.mkdir(parents=True, exist_ok=True)
    if (free := shutil.disk_usage(folder).free) < DISK_MARGIN * bytes_needed(order.samples):
        folder.rmdir()
        raise DataError(
            f"{folder}: {bytes_needed(order.samples) / 1e9:.2g} GB are needed, {free / 1e9:.2g} GB are free; ask for fewer"
        )
    write_atomically(path, (json.dumps(manifest, indent=1) + "\n").encode())


def _shard_path(folder: Path, k: int) -> Path:
    """Return the file of shard k."""
    return folder / f"samples-{k:05d}.parquet"


def _shard_rows(order: GenerationOrder, k: int) -> int:
    """Return how many samples shard k has."""
    return min(shard.SAMPLES_PER_SHARD, order.samples - k * shard.SAMPLES_PER_SHARD)


def _make_shard(order: GenerationOrder, folder: Path, k: int) -> int:
    """Make shard k and return how many samples it has."""
    robot, rows = order.robot, _shard_rows(order, k)
    points, nominal = named_points(robot).rest, _finger_body(robot)
    azimuth = np.arctan2(nominal.paths[:, 0, 1], nominal.paths[:, 0, 0])
    chains = []
    with threadpool_limits(limits=1):
        for c in range(-(-rows // CHAIN_LENGTH)):
            rng = chain_rng(order.seed, k * shard.CHAINS_PER_SHARD + c)
            chain = draw_chain(rng, nominal.cone, azimuth, order.uncertain)
            body = _finger_body(robot, chain.values)
            chains.append((chain, solve_chain(SoftStatics(body), chain, nodal_weight(body, robot.gravity))))
    shard.write_shard(
        _shard_path(folder, k), shard.build_table(chains, k * shard.SAMPLES_PER_SHARD, nominal.lattice.weights(points), rows)
    )
    return rows


def _finger_body(robot: Robot, values: Values | None = None) -> SoftBody:
    """Return the robot's body, which must be one soft finger."""
    return robot.silicone(robot.build(values))
