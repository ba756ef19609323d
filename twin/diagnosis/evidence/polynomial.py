"""A prediction without physics: a polynomial of the commands and loads, with a branch for the direction of travel.

Any lab has such a fit, and a twin must predict better to be useful. Each output is ridge regression on

    1, u_a, u_a u_b, s_a, s_a u_a, m, m u_a        (u commands over their span, s = tanh(du/dt / typical), m payload or gravity)

Degree, branch and ridge are chosen for each output by trials left out in turn.
"""

from collections.abc import Sequence
from itertools import combinations_with_replacement, product
from typing import NamedTuple

import numpy as np

from twin.body import Drive
from twin.diagnosis.evidence.discrepancy import slope
from twin.prediction.prepared import PreparedRecording

DEGREES, BRANCHES, RIDGES = (1, 2, 3), (False, True), (1e-6, 1e-4, 1e-2)


def predict_by_polynomial(prepared: PreparedRecording, known: Sequence[int], wanted: Sequence[int]) -> list[np.ndarray]:
    """Return outputs (n_k, n_output) SI of the `wanted` trials from the measurements of the `known` ones.

    NaN throughout for outputs that no known trial has. With fewer than three known trials the simplest form is taken.
    """
    order = [*known, *wanted]
    forms = {form: dict(zip(order, _features(prepared, order, *form), strict=True)) for form in product(DEGREES, BRANCHES)}
    measured = np.concatenate([prepared.measured[k] for k in known])
    out = [np.full((len(forms[1, False][k]), measured.shape[1]), np.nan) for k in wanted]
    present = np.isfinite(measured)
    for mask in np.unique(present[:, present.any(axis=0)], axis=1).T:  # outputs that are missing together share their products
        columns = np.flatnonzero((present == mask[:, None]).all(axis=0))
        products = {form: [_products(X[k], prepared.measured[k][:, columns]) for k in known] for form, X in forms.items()}
        choices = list(product(forms, RIDGES)) if len(known) > 2 else [((1, False), RIDGES[0])]
        best = np.argmin([_left_out_errors(products[form], ridge) for form, ridge in choices], axis=0)
        for c in np.unique(best):
            form, ridge = choices[c]
            whole = _together(products[form])
            weights = _ridge(whole.gram, whole.moment[:, best == c], ridge)
            for y, k in zip(out, wanted, strict=True):
                y[:, columns[best == c]] = forms[form][k] @ weights
    return out


class _Products(NamedTuple):
    """X'X (p, p), X'Y (p, m), and the squares of Y (m,), over the rows of a trial that were measured."""

    gram: np.ndarray
    moment: np.ndarray
    square: np.ndarray


def _products(X: np.ndarray, Y: np.ndarray) -> _Products:
    there = np.isfinite(Y).all(axis=1)
    X, Y = X[there], Y[there]
    return _Products(X.T @ X, X.T @ Y, (Y**2).sum(axis=0))


def _together(products: Sequence[_Products]) -> _Products:
    return _Products(*(np.sum(parts, axis=0) for parts in zip(*products, strict=True)))


def _left_out_errors(products: Sequence[_Products], ridge: float) -> np.ndarray:
    """Return the squared error (m,) of trials left out in turn."""
    whole, found = _together(products), np.zeros(products[0].moment.shape[1])
    for p in products:
        w = _ridge(whole.gram - p.gram, whole.moment - p.moment, ridge)
        found += p.square - 2.0 * (w * p.moment).sum(axis=0) + np.einsum("pm,pq,qm->m", w, p.gram, w, optimize=True)
    return found


def _ridge(gram: np.ndarray, moment: np.ndarray, ridge: float) -> np.ndarray:
    """Return weights (p, m), zero without rows; the constant, whose square sum is the number of rows, is not shrunk."""
    if not gram[0, 0] > 0.5:  # less than one row: one trial alone measures these outputs, and it is left out
        return np.zeros_like(moment)
    shrink = ridge * gram[0, 0] * np.eye(len(gram))
    shrink[0, 0] = 1e-12
    return np.linalg.solve(gram + shrink, moment)


def _features(prepared: PreparedRecording, trials: Sequence[int], degree: int, branch: bool) -> list[np.ndarray]:
    """Return features (n_k, p) of each trial."""
    inputs = [prepared.inputs[k] for k in trials]
    span = np.max([np.abs(i.pull).max(axis=0) for i in inputs], axis=0)
    held = prepared.driven_by(Drive.DISPLACEMENT)
    for kind in (held, ~held):
        span[kind] = max(span[kind].max(initial=0.0), 1e-9)
    slopes = [slope(i, i.pull / span) for i in inputs]
    typical = np.median(np.abs(np.concatenate(slopes))) + 1e-9
    loads = np.array([[i.loads.payload, *i.loads.gravity, float(np.mean(i.loads.torque))] for i in inputs])
    varying = np.ptp(loads, axis=0) > 1e-9
    loads = loads[:, varying] / np.maximum(np.abs(loads[:, varying]).max(axis=0, initial=0.0), 1e-12)
    out = []
    for i, du, load in zip(inputs, slopes, loads, strict=True):
        u = i.pull / span
        columns = [np.ones(len(u))]
        for d in range(1, degree + 1):
            columns += [np.prod(u[:, list(pick)], axis=1) for pick in combinations_with_replacement(range(u.shape[1]), d)]
        columns += [m * c for m in load for c in (np.ones(len(u)), *u.T)]
        if branch:
            s = np.tanh(du / typical)
            columns += [*s.T, *(s * u).T]
        out.append(np.stack(columns, axis=1))
    return out
