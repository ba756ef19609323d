"""Weights of a learned estimator on disk: arrays in an npz file, no pickle, written whole or not at all; and the perceptron they
make."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import DataError

Layers = Sequence[tuple[np.ndarray, np.ndarray]]  # (weight (out, in), bias (out,)) of each layer


def read_weights(path: Path, form: str) -> dict[str, Any]:
    """The arrays of a weights file of format `form`. Raises DataError for a missing, truncated or foreign file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        if str(arrays["format"]) != form:
            raise DataError(f"{path}: format {arrays['format']}; {form} is needed, train it again: twin train")
    except FileNotFoundError:
        raise DataError(f"{path}: no weights there; train them: twin train") from None
    except (OSError, KeyError, ValueError, EOFError, TypeError, zipfile.BadZipFile, zlib.error) as fault:
        raise DataError(f"{path}: no weights of this program ({fault}); train them again: twin train") from None
    return {name: a.astype(float) if a.dtype == np.float32 else a for name, a in arrays.items()}


def write_weights(path: Path, arrays: dict[str, Any]) -> None:
    part = path.with_name(path.name + ".part")
    with part.open("wb") as file:
        np.savez_compressed(file, **arrays)
    part.replace(path)


def pack(name: str, layers: Layers) -> dict[str, np.ndarray]:
    """The layers of one perceptron as arrays of a weights file."""
    out: dict[str, np.ndarray] = {f"{name}_layers": np.array(len(layers))}
    for i, (weight, bias) in enumerate(layers):
        out[f"{name}_weight_{i}"], out[f"{name}_bias_{i}"] = weight, bias
    return out


def unpack(name: str, arrays: dict[str, Any]) -> Layers:
    count = int(arrays[f"{name}_layers"])
    return [(arrays[f"{name}_weight_{i}"], arrays[f"{name}_bias_{i}"]) for i in range(count)]


def silu(x: np.ndarray) -> np.ndarray:
    return x / (1.0 + np.exp(-x))


def relu(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0.0)


def perceptron(x: np.ndarray, layers: Layers, bend: Callable[[np.ndarray], np.ndarray] = silu) -> np.ndarray:
    """(..., out) of x (..., in): linear layers with `bend` between them."""
    for weight, bias in layers[:-1]:
        x = bend(x @ weight.T + bias)
    weight, bias = layers[-1]
    return x @ weight.T + bias
