"""A trained estimator on held-out fingers: its band, its errors by load and by deformation, and its card.

The band is set here and nowhere else: on factory fingers that the network has not seen, pushed and free apart, by how far the
finger seems deformed, and point by point (coordinates of modes err together, which cancels at one point and adds up at another), so
that it holds 90 % of their places.
"""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import nnls

from twin.robots import Robot
from twin.shape.estimator import Z90, Felt
from twin.shape.learned import Learned, at_level, level
from twin.shape.lesson import Data, disturbed
from twin.twin import Twin

SIZES = (0.0, 2.0, 5.0, 10.0, 30.0)  # mm, of the mean displacement
LEVELS, ENOUGH = 6, 50  # of deformation, equally many samples at each; with fewer than that all levels are taken for one
LEAST = 1e-4  # m, of a pointwise error bar
NARROWEST = 0.05  # a band is narrowed to: of clamped points, whose error is none
AT_ONCE = 256  # samples
UNKNOWN = "friction, creep, contact with edges sharper than 6 mm, pushes beyond those of twin/factory/draw.py"


def judged(law: type[Learned], arrays: dict[str, Any], data: Data, robot: Robot) -> tuple[dict[str, Any], dict[str, Any]]:
    """The weights with their band and what they know, and errors (mm) and coverage on held-out fingers."""
    alike = {"levels": np.tile(np.arange(LEVELS, dtype=float), (2, 1)), "widen": np.ones((2, LEVELS, len(data.weights)))}
    arrays = arrays | _known(data) | alike | {"format": np.array(law.form()), "error": np.array([0.0, 1.0])}
    held = np.flatnonzero(data.held)
    tried = _tried(law, arrays, data, robot, held)
    share, rest = np.sqrt(nnls(np.column_stack([tried.size.ravel() ** 2, np.ones(tried.size.size)]), tried.away.ravel() ** 2)[0])
    arrays["error"] = np.array([share, max(rest, LEAST)])
    tried = _tried(law, arrays, data, robot, held)
    away, size, ratio, inside = tried.away, tried.size, tried.away / tried.std, np.empty(tried.away.shape, bool)
    for row, rows in enumerate((data.pushed[held], ~data.pushed[held])):
        if rows.any():
            arrays["levels"][row], arrays["widen"][row] = _widened(ratio[rows], tried.level[rows])
            arrays |= _levels(law, arrays, data, robot, held[rows])
            inside[rows] = ratio[rows] < Z90 * at_level(tried.level[rows], arrays["levels"][row], arrays["widen"][row])
    each, kind, moved = 1e3 * away.mean(axis=1), data.kind[held], 1e3 * size.mean(axis=1)
    by_size = {f"{a:g}-{b:g}": (moved >= a) & (moved < b) for a, b in pairwise(SIZES)}
    return arrays, {
        "held_out_mm": float(each.mean()),
        "by_kind_mm": {str(k): float(each[kind == k].mean()) for k in np.unique(kind)},
        "by_mean_displacement_mm": {name: float(each[rows].mean()) for name, rows in by_size.items() if rows.any()},
        "in_band_by_kind": {str(k): float(inside[kind == k].mean()) for k in np.unique(kind)},
        "in_band_by_mean_displacement": {name: float(inside[rows].mean()) for name, rows in by_size.items() if rows.any()},
        "band_widened_by": dict(zip(("pushed", "free"), np.median(arrays["widen"], axis=2).tolist(), strict=True)),
    }


def card_of(law: type[Learned], robot: Robot, data: Data, errors: dict[str, Any]) -> dict[str, Any]:
    """What is to be known of a training, but for how it was done."""
    versions = {name: version(name) for name in ("tendon-twin", "numpy", "torch")} | {"python": platform.python_version()}
    unknown = "; ".join(words for words in (UNKNOWN, law.unknown) if words)
    return errors | {
        "robot": robot.name, "samples": len(data.held), "held_out_samples": int(data.held.sum()), "does_not_know": unknown,
        "versions": versions,
    }  # fmt: skip


@dataclass(frozen=True)
class Tried:
    """Errors, spreads before they are widened, true displacements (n, P) m, and mean estimated displacements (n,) m."""

    away: np.ndarray
    std: np.ndarray
    size: np.ndarray
    level: np.ndarray


def _tried(law: type[Learned], arrays: dict[str, Any], data: Data, robot: Robot, held: np.ndarray) -> Tried:
    """Of held-out samples, disturbed as in training."""
    strain, displacement = disturbed(np.random.default_rng(1), data, held, dead=0.0)
    decode = law(Twin.of(robot), _double(arrays)).decode
    away, std, size = (np.empty((len(held), len(data.weights))) for _ in range(3))
    levels = np.empty(len(held))
    for pushed in (True, False):
        rows = np.flatnonzero(data.pushed[held] == pushed)
        for part in np.array_split(rows, -(-len(rows) // AT_ONCE)) if len(rows) else ():
            moved, std[part] = decode(Felt(strain[part], displacement[part], pushed))
            true = np.einsum("pn,bnc->bpc", data.weights, data.nodes[held[part]].reshape(len(part), -1, 3), optimize=True)
            away[part] = np.linalg.norm(moved - true, axis=2)
            size[part] = np.linalg.norm(true, axis=2)
            levels[part] = level(moved)
    return Tried(away, std, size, levels)


def _levels(law: type[Learned], arrays: dict[str, Any], data: Data, robot: Robot, rows: np.ndarray) -> dict[str, Any]:
    """Of held-out samples, all of which are pushed or none, disturbed anew."""
    strain, displacement = disturbed(np.random.default_rng(2), data, rows, dead=0.0)
    felt = Felt(strain, displacement, bool(data.pushed[rows[0]]))
    return {name: np.array(value) for name, value in law(Twin.of(robot), _double(arrays)).levels(felt).items()}


def _double(arrays: dict[str, Any]) -> dict[str, Any]:
    return {n: a.astype(float) if a.dtype == np.float32 else a for n, a in arrays.items()}


def _widened(ratio: np.ndarray, levels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Levels (k,) and by how much (k, P) spreads are widened there, of (n, P) and (n,)."""
    parts = np.array_split(np.argsort(levels), LEVELS)
    alike = parts if len(levels) >= LEVELS * ENOUGH else [np.arange(len(levels))] * LEVELS
    widen = np.stack([np.quantile(ratio[rows], 0.9, axis=0) for rows in alike]) / Z90
    return np.array([np.median(levels[rows]) for rows in parts]), np.maximum(widen, NARROWEST)


def _known(data: Data) -> dict[str, Any]:
    """Where the strains that were trained on lie."""
    centre, inverse = data.strain.mean(axis=0), np.linalg.inv(np.cov(data.strain.T))
    x = data.strain - centre
    return {
        "known_mean": centre, "known_inverse": inverse, "known_far": np.quantile(np.einsum("ni,ij,nj->n", x, inverse, x), 0.999)
    }  # fmt: skip
