"""The tables of a measurement set as columns of numbers, as they are written."""

import csv
from pathlib import Path

import numpy as np

Columns = dict[str, np.ndarray]


def write_columns(path: Path, columns: Columns) -> None:
    """Write a CSV; NaN becomes an empty cell."""
    rows = [",".join(columns)]
    rows += [",".join("" if np.isnan(v) else f"{v:.6g}" for v in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(rows) + "\n")


def read_columns(path: Path) -> Columns:
    """Read a CSV; an empty cell becomes NaN."""
    with path.open() as file:
        header, *rows = csv.reader(file)
    return {name: np.array([float(r[i] or "nan") for r in rows]) for i, name in enumerate(header)}
