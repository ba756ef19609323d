"""Weights of learned estimators: arrays in an npz file without pickle, and the perceptron that they make."""

import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError

Layers = Sequence[tuple[np.ndarray, np.ndarray]]  # (weight (out, in), bias (out,)) of each layer


def read_weights(path: Path, form: str) -> dict[str, Any]:
    """Read the arrays of a weights file of format `form`. Raises DataError for a missing, truncated or foreign file."""
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
    """Write the arrays, whole or not at all."""
    write_atomically(path, lambda file: np.savez_compressed(file, **arrays))


def pack_layers(name: str, layers: Layers) -> dict[str, np.ndarray]:
    """Return the layers of one perceptron as arrays of a weights file."""
    out: dict[str, np.ndarray] = {f"{name}_layers": np.array(len(layers))}
    for i, (weight, bias) in enumerate(layers):
        out[f"{name}_weight_{i}"], out[f"{name}_bias_{i}"] = weight, bias
    return out


def unpack_layers(name: str, arrays: dict[str, Any]) -> Layers:
    """Return the layers of a perceptron from the arrays of a weights file."""
    count = int(arrays[f"{name}_layers"])
    return [(arrays[f"{name}_weight_{i}"], arrays[f"{name}_bias_{i}"]) for i in range(count)]


def silu(x: np.ndarray) -> np.ndarray:
    """Return the sigmoid linear unit of x."""
    return x / (1.0 + np.exp(-x))


def relu(x: np.ndarray) -> np.ndarray:
    """Return the rectified linear unit of x."""
    return np.maximum(x, 0.0)


def perceptron(x: np.ndarray, layers: Layers, activation: Callable[[np.ndarray], np.ndarray] = silu) -> np.ndarray:
    """Return outputs (..., out) for x (..., in): linear layers with the activation between them."""
    for weight, bias in layers[:-1]:
        x = activation(x @ weight.T + bias)
    weight, bias = layers[-1]
    return x @ weight.T + bias
