"""Evaluate a trained estimator on held-out fingers: its band, its errors by load and by deformation, and its card.

The band is set on fingers that the network was not trained on, pushed and free apart, by how far the finger is deformed, and point
by point (errors of mode coordinates cancel at one point and add up at another), so that it holds 90 % of the points.
"""

import platform
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import nnls

from twin.prediction.twin import Twin
from twin.robots import Robot
from twin.shape.estimators.estimator import Z90, SensorReadings
from twin.shape.estimators.learned import LearnedEstimator, interpolate_levels, mean_displacement
from twin.shape.training.samples import TrainingSamples, disturb

DISPLACEMENT_BINS = (0.0, 2.0, 5.0, 10.0, 30.0)  # mm, of the mean displacement
# Levels of deformation, equally many samples at each; with fewer samples a level all levels are pooled.
LEVEL_COUNT, FEWEST_PER_LEVEL = 6, 50
SMALLEST_POINT_ERROR = 1e-4  # m, of a pointwise error bar
SMALLEST_WIDENING = 0.05  # for clamped points, which have no error
SAMPLES_AT_ONCE = 256
NOT_TRAINED_ON = "friction, creep, contact with edges sharper than 6 mm, pushes beyond those of twin/shape/training_data/draw.py"


def evaluate_held_out(
    estimator: type[LearnedEstimator], arrays: dict[str, Any], samples: TrainingSamples, robot: Robot
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the weights with their band and training domain, and errors (mm) and coverage on held-out fingers."""
    unwidened = {
        "levels": np.tile(np.arange(LEVEL_COUNT, dtype=float), (2, 1)),
        "widen": np.ones((2, LEVEL_COUNT, len(samples.point_weights))),
    }
    header = {"format": np.array(estimator.weights_format()), "error": np.array([0.0, 1.0])}
    arrays = arrays | _strain_domain(samples) | unwidened | header
    held_out = np.flatnonzero(samples.held_out)
    errors = _held_out_errors(estimator, arrays, samples, robot, held_out)
    share, rest = np.sqrt(
        nnls(np.column_stack([errors.displacement.ravel() ** 2, np.ones(errors.displacement.size)]), errors.error.ravel() ** 2)[0]
    )
    arrays["error"] = np.array([share, max(rest, SMALLEST_POINT_ERROR)])
    errors = _held_out_errors(estimator, arrays, samples, robot, held_out)
    ratio, inside = errors.error / errors.std, np.empty(errors.error.shape, bool)
    for row, rows in enumerate((samples.pushed[held_out], ~samples.pushed[held_out])):
        if rows.any():
            arrays["levels"][row], arrays["widen"][row] = _band_levels(ratio[rows], errors.level[rows])
            arrays |= _estimator_quantiles(estimator, arrays, samples, robot, held_out[rows])
            inside[rows] = ratio[rows] < Z90 * interpolate_levels(errors.level[rows], arrays["levels"][row], arrays["widen"][row])
    error_mm, displacement_mm = 1e3 * errors.error.mean(axis=1), 1e3 * errors.displacement.mean(axis=1)
    kind = samples.kind[held_out]
    by_size = {f"{a:g}-{b:g}": (displacement_mm >= a) & (displacement_mm < b) for a, b in pairwise(DISPLACEMENT_BINS)}
    return arrays, {
        "held_out_mm": float(error_mm.mean()),
        "by_kind_mm": {str(k): float(error_mm[kind == k].mean()) for k in np.unique(kind)},
        "by_mean_displacement_mm": {name: float(error_mm[rows].mean()) for name, rows in by_size.items() if rows.any()},
        "in_band_by_kind": {str(k): float(inside[kind == k].mean()) for k in np.unique(kind)},
        "in_band_by_mean_displacement": {name: float(inside[rows].mean()) for name, rows in by_size.items() if rows.any()},
        "band_widened_by": dict(zip(("pushed", "free"), np.median(arrays["widen"], axis=2).tolist(), strict=True)),
    }


def model_card(estimator: type[LearnedEstimator], robot: Robot, samples: TrainingSamples, errors: dict[str, Any]) -> dict[str, Any]:
    """Return the card of a trained estimator, without how it was trained."""
    versions = {name: version(name) for name in ("tendon-twin", "numpy", "torch")} | {"python": platform.python_version()}
    return errors | {
        "robot": robot.name, "samples": len(samples.held_out), "held_out_samples": int(samples.held_out.sum()),
        "does_not_know": NOT_TRAINED_ON, "versions": versions,
    }  # fmt: skip


@dataclass(frozen=True)
class HeldOutErrors:
    """Errors, spreads before widening, true displacements (n, P) m each, and mean estimated displacements (n,) m."""

    error: np.ndarray
    std: np.ndarray
    displacement: np.ndarray
    level: np.ndarray


def _held_out_errors(
    estimator: type[LearnedEstimator], arrays: dict[str, Any], samples: TrainingSamples, robot: Robot, held_out: np.ndarray
) -> HeldOutErrors:
    """Return the errors on held-out samples, disturbed as in training."""
    strain, displacement = disturb(np.random.default_rng(1), samples, held_out, dead=0.0)
    decode = estimator(Twin.of(robot), _to_double(arrays)).decode
    error, std, displacement_size = (np.empty((len(held_out), len(samples.point_weights))) for _ in range(3))
    levels = np.empty(len(held_out))
    for pushed in (True, False):
        rows = np.flatnonzero(samples.pushed[held_out] == pushed)
        for part in np.array_split(rows, -(-len(rows) // SAMPLES_AT_ONCE)) if len(rows) else ():
            estimated, std[part] = decode(SensorReadings(strain[part], displacement[part], pushed))
            true = np.einsum(
                "pn,bnc->bpc", samples.point_weights, samples.nodes[held_out[part]].reshape(len(part), -1, 3), optimize=True
            )
            error[part] = np.linalg.norm(estimated - true, axis=2)
            displacement_size[part] = np.linalg.norm(true, axis=2)
            levels[part] = mean_displacement(estimated)
    return HeldOutErrors(error, std, displacement_size, levels)


def _estimator_quantiles(
    estimator: type[LearnedEstimator], arrays: dict[str, Any], samples: TrainingSamples, robot: Robot, rows: np.ndarray
) -> dict[str, Any]:
    """Return the estimator's own limits from held-out samples, either all pushed or none, disturbed anew."""
    strain, displacement = disturb(np.random.default_rng(2), samples, rows, dead=0.0)
    readings = SensorReadings(strain, displacement, bool(samples.pushed[rows[0]]))
    found = estimator(Twin.of(robot), _to_double(arrays)).held_out_quantiles(readings)
    return {name: np.array(value) for name, value in found.items()}


def _to_double(arrays: dict[str, Any]) -> dict[str, Any]:
    """Return the arrays with single precision turned to double."""
    return {n: a.astype(float) if a.dtype == np.float32 else a for n, a in arrays.items()}


def _band_levels(ratio: np.ndarray, levels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return levels (k,) and factors (k, P) of the band there, from ratios (n, P) of error to spread and levels (n,)."""
    parts = np.array_split(np.argsort(levels), LEVEL_COUNT)
    groups = parts if len(levels) >= LEVEL_COUNT * FEWEST_PER_LEVEL else [np.arange(len(levels))] * LEVEL_COUNT
    widen = np.stack([np.quantile(ratio[rows], 0.9, axis=0) for rows in groups]) / Z90
    return np.array([np.median(levels[rows]) for rows in parts]), np.maximum(widen, SMALLEST_WIDENING)


def _strain_domain(samples: TrainingSamples) -> dict[str, Any]:
    """Return the mean, the inverse covariance and the limit of the strains trained on."""
    centre, inverse = samples.strain.mean(axis=0), np.linalg.inv(np.cov(samples.strain.T))
    x = samples.strain - centre
    return {
        "known_mean": centre, "known_inverse": inverse, "known_far": np.quantile(np.einsum("ni,ij,nj->n", x, inverse, x), 0.999)
    }  # fmt: skip
