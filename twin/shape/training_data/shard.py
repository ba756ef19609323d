"""Read and write shards: Parquet files of samples in order, one row a sample, with their inputs.

Columns (SI; the finger's own frame, which `parameter_mounting.angle` turns against the base frame):

    sample, kind      number; "free", "pushed" or "both"            converged      whether an equilibrium was found
    command, tension  (t,) m, N of the tendons                      strain, resistance   (s,) of the cords, resistance in ohm
    vertices          (3 P,) float32 m: displacements of the named points, x, y, z in turn
    nodes             (3 n,) float32 m: of the solver's free nodes, from which every point of the body follows
    push_height, push_azimuth, push_width (2 k,) m, rad, m; push_force (6 k,) N: patches that fade out, then those that fade in
    parameter_NAME    uncertain numbers of the finger
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError
from twin.mechanics.silicone.skin_loads import Pushes
from twin.shape.training_data.draw import CHAIN_KINDS, CHAIN_LENGTH, CHAIN_TARGETS, MOST_PUSHES, STEPS_PER_TARGET, Chain
from twin.shape.training_data.solve import SolvedChain

CHAINS_PER_SHARD = 64
SAMPLES_PER_SHARD = CHAINS_PER_SHARD * CHAIN_LENGTH


def build_table(chains: Sequence[tuple[Chain, SolvedChain]], first: int, vertices: np.ndarray, rows: int) -> pa.Table:
    """Build a table of `rows` samples of chains, numbered from `first`. `vertices` (P, n_free): weights of the named points."""
    solved = [s for _, s in chains]
    nodes = np.concatenate([s.nodes for s in solved])
    columns: dict[str, pa.Array] = {
        "sample": pa.array(first + np.arange(len(nodes))),
        "kind": pa.array([CHAIN_KINDS[c.kind] for c, _ in chains for _ in range(CHAIN_LENGTH)]),
        "converged": pa.array(np.concatenate([s.converged for s in solved])),
        "vertices": _fixed_lists(np.einsum("pn,snk->spk", vertices, nodes).astype(np.float32)),
        "nodes": _fixed_lists(nodes.astype(np.float32)),
    }
    for name in ("command", "tension", "strain", "resistance"):
        columns[name] = _fixed_lists(np.concatenate([getattr(s, name) for s in solved]))
    for name, values in _push_columns([c for c, _ in chains]).items():
        columns[name] = _fixed_lists(values)
    for name in chains[0][0].values:
        columns[f"parameter_{name}"] = pa.array(np.repeat([c.values[name] for c, _ in chains], CHAIN_LENGTH))
    return pa.table(columns).slice(0, rows)


def _fixed_lists(values: np.ndarray) -> pa.Array:
    """Return values (n, ...) as a column of lists of fixed size."""
    flat = values.reshape(len(values), -1)
    return pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), flat.shape[1])


def _push_columns(chains: Sequence[Chain]) -> dict[str, np.ndarray]:
    """Return the columns of the pushes, by name, for all samples of the chains."""
    nothing = Pushes(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 3)))
    rows: dict[str, list[np.ndarray]] = {f"push_{name}": [] for name in ("height", "azimuth", "width", "force")}
    for chain in chains:
        for i in range(CHAIN_LENGTH):
            target, share = i // STEPS_PER_TARGET, (i % STEPS_PER_TARGET + 1) / STEPS_PER_TARGET
            for pushes, part in ((chain.pushes[target - 1] if target else nothing, 1.0 - share), (chain.pushes[target], share)):
                gap = MOST_PUSHES - len(pushes.height)
                for name in ("height", "azimuth", "width"):
                    rows[f"push_{name}"].append(np.pad(getattr(pushes, name), (0, gap)))
                rows["push_force"].append(np.pad(part * pushes.force, ((0, gap), (0, 0))).ravel())
    n = len(chains) * CHAIN_TARGETS * STEPS_PER_TARGET
    return {name: np.concatenate(values).reshape(n, -1) for name, values in rows.items()}


def write_shard(path: Path, rows: pa.Table) -> None:
    """Write a shard, whole or not at all."""
    write_atomically(path, lambda file: pq.write_table(rows, file, compression="zstd"))


def read_columns(folder: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Read columns of all shards of a folder, in order, (n,) or (n, k) each. Raises DataError where there are none or one is
    unreadable."""
    shards = sorted(folder.glob("samples-*.parquet"))
    if not shards:
        raise DataError(f"{folder}: no samples-*.parquet there; make them with twin generate")
    try:
        tables = [pq.read_table(path, columns=list(names)) for path in shards]
    except (OSError, pa.ArrowInvalid) as fault:
        raise DataError(f"{folder}: a shard cannot be read ({fault}); delete it and run twin generate again") from None
    return {name: np.concatenate([_column_array(t[name].combine_chunks()) for t in tables]) for name in names}


def _column_array(column: pa.Array) -> np.ndarray:
    """Return a column as an array (n,) or (n, k)."""
    if pa.types.is_fixed_size_list(column.type):
        return column.flatten().to_numpy(zero_copy_only=False).reshape(len(column), column.type.list_size)
    return column.to_numpy(zero_copy_only=False)
