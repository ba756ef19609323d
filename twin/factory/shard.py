"""Shards: Parquet files of samples in order, one row a sample, and what they were made from.

Columns (SI; the finger's own frame, which `parameter_mounting.angle` turns against the base frame):

    sample, kind      which; "free", "pushed" or "both"             converged      whether an equilibrium was found
    command, tension  (t,) m, N of the tendons                      strain, resistance   (s,) of the cords, resistance in ohm
    vertices          (3 P,) float32 m: displacements of the named points, x, y, z in turn
    nodes             (3 n,) float32 m: of the solver's free nodes, from which every point of the body follows
    push_height, push_azimuth, push_width (2 k,) m, rad, m; push_force (6 k,) N: patches that fade out, then those that fade in
    parameter_NAME    uncertain numbers of the finger
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from twin.errors import DataError
from twin.factory.draw import KINDS, LENGTH, PUSHES, STEPS, TARGETS, Chain, Pushes
from twin.factory.solve import Solved

CHAINS = 64  # in a shard
SIZE = CHAINS * LENGTH  # samples


def table(chains: Sequence[tuple[Chain, Solved]], first: int, vertices: np.ndarray, rows: int) -> pa.Table:
    """`rows` samples of chains, the first of them number `first`; `vertices` (P, n_free), weights of the named points."""
    solved = [s for _, s in chains]
    nodes = np.concatenate([s.nodes for s in solved])
    columns: dict[str, pa.Array] = {
        "sample": pa.array(first + np.arange(len(nodes))),
        "kind": pa.array([KINDS[c.kind] for c, _ in chains for _ in range(LENGTH)]),
        "converged": pa.array(np.concatenate([s.found for s in solved])),
        "vertices": _lists(np.einsum("pn,snk->spk", vertices, nodes).astype(np.float32)),
        "nodes": _lists(nodes.astype(np.float32)),
    }
    for name in ("command", "tension", "strain", "resistance"):
        columns[name] = _lists(np.concatenate([getattr(s, name) for s in solved]))
    for name, values in _pushed([c for c, _ in chains]).items():
        columns[name] = _lists(values)
    for name in chains[0][0].values:
        columns[f"parameter_{name}"] = pa.array(np.repeat([c.values[name] for c, _ in chains], LENGTH))
    return pa.table(columns).slice(0, rows)


def _lists(values: np.ndarray) -> pa.Array:
    flat = values.reshape(len(values), -1)
    return pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), flat.shape[1])


def _pushed(chains: Sequence[Chain]) -> dict[str, np.ndarray]:
    nothing = Pushes(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 3)))
    rows: dict[str, list[np.ndarray]] = {f"push_{name}": [] for name in ("height", "azimuth", "width", "force")}
    for chain in chains:
        for i in range(LENGTH):
            target, share = i // STEPS, (i % STEPS + 1) / STEPS
            for pushes, part in ((chain.pushes[target - 1] if target else nothing, 1.0 - share), (chain.pushes[target], share)):
                gap = PUSHES - len(pushes.height)
                for name in ("height", "azimuth", "width"):
                    rows[f"push_{name}"].append(np.pad(getattr(pushes, name), (0, gap)))
                rows["push_force"].append(np.pad(part * pushes.force, ((0, gap), (0, 0))).ravel())
    n = len(chains) * TARGETS * STEPS
    return {name: np.concatenate(values).reshape(n, -1) for name, values in rows.items()}


def write(path: Path, rows: pa.Table) -> None:
    """Whole or not at all: to a neighbour first, then renamed."""
    part = path.with_name(path.name + ".part")
    pq.write_table(rows, part, compression="zstd")
    part.replace(path)


def read(folder: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns of all shards of a folder, in order: (n,) or (n, k). Raises DataError where there are none or one cannot be read."""
    shards = sorted(folder.glob("samples-*.parquet"))
    if not shards:
        raise DataError(f"{folder}: no samples-*.parquet there; make them with twin generate")
    try:
        tables = [pq.read_table(path, columns=list(names)) for path in shards]
    except (OSError, pa.ArrowInvalid) as fault:
        raise DataError(f"{folder}: a shard cannot be read ({fault}); delete it and run twin generate again") from None
    return {name: np.concatenate([_array(t[name].combine_chunks()) for t in tables]) for name in names}


def _array(column: pa.Array) -> np.ndarray:
    if pa.types.is_fixed_size_list(column.type):
        return column.flatten().to_numpy(zero_copy_only=False).reshape(len(column), column.type.list_size)
    return column.to_numpy(zero_copy_only=False)
