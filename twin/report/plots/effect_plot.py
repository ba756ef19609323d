"""Choose the variable to plot a residual against, so that the effect is visible.

`Effect.plot_against` is the kind of variable (the loop of a tendon's pull, time, payload, ...). The tendon, axis and channel are
those whose binned curve carries most of the difference between the two predictions, in sigmas.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.diagnosis import Diagnosis
from twin.diagnosis.evidence.discrepancy import plot_kind
from twin.effects import effect_class
from twin.foundation.display_names import display_name
from twin.report.plots.predictions import compared_stages, residuals
from twin.report.plots.variables import Variable, variables

MOST_BINS = 14
FEWEST_SAMPLES_PER_BIN = 4  # bins with fewer have no mean drawn


@dataclass(frozen=True)
class ResidualPlot:
    """An output channel (`column` of the prepared recording), the variable on the x axis, and the reason in words."""

    column: int
    variable: Variable
    reason: str


def choose_residual_plots(diagnosis: Diagnosis) -> list[ResidualPlot]:
    """Choose one plot for each effect, or one for the strongest regressor of the remaining error; equal plots once."""
    d = diagnosis
    first, second = compared_stages(d)
    before, after = residuals(d, first), residuals(d, second)
    if d.claims:
        changed = [a - b for a, b in zip(before, after, strict=True)]
        effects = [(display_name(c.effect), effect_class(c.effect)) for c in d.claims]
        wanted = [(effect.plot_against, f"{name} varies with {effect.moves_with}") for name, effect in effects]
    elif d.verdict == "unexplained" and d.strongest:
        changed, name = after, d.strongest[0][0]
        wanted = [(plot_kind(name), f"the remaining error varies most with {name!r}")]
    else:
        changed, wanted = after, [("tension", "for comparison, the residual against the strongest pull")]
    found = [_choose_plot(d, changed, kind, reason) for kind, reason in wanted]
    return list({(g.column, g.variable.title): g for g in found if g is not None}.values())


def _choose_plot(diagnosis: Diagnosis, changed: list[np.ndarray], kind: str | None, reason: str) -> ResidualPlot | None:
    every = [(k, v) for k, v in variables(diagnosis.prepared) if _varies(v)]
    fitting = [v for k, v in every if k == kind] or [v for _, v in every]
    z = np.concatenate(changed) / diagnosis.noise.sigma
    score = {(i, j): _variation_on_curve(v, z[:, j]) for i, v in enumerate(fitting) for j in range(z.shape[1])}
    if not score:
        return None
    i, j = max(score, key=lambda key: score[key])
    return ResidualPlot(j, fitting[i], reason)


def _varies(variable: Variable) -> bool:
    x = variable.values[np.isfinite(variable.values) & variable.relevant]
    return x.size > 3 and float(np.ptp(x)) > 1e-9


def _variation_on_curve(variable: Variable, z: np.ndarray) -> float:
    """Return how much of z (n,) a binned curve over the variable carries: sum of n (mean of bin - overall mean)^2.

    For a loop it is the difference of the two branches: sum of n_1 n_2 / (n_1 + n_2) (mean_1 - mean_2)^2.
    """
    ok = variable.relevant & np.isfinite(variable.values) & np.isfinite(z)
    if not ok.any():
        return 0.0
    place, z, side = assign_bins(variable.values[ok]), z[ok], variable.branch[ok]
    count = place.max() + 1
    if not variable.is_loop:
        n, mean = _bin_counts_and_means(place, z, count)
        return float((n * (mean - z.mean()) ** 2).sum())
    (n1, m1), (n2, m2) = (_bin_counts_and_means(place[side == s], z[side == s], count) for s in (-1, 1))
    return float((n1 * n2 / np.maximum(n1 + n2, 1) * (m1 - m2) ** 2).sum())


def _bin_counts_and_means(place: np.ndarray, z: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the number and the mean of z in every bin."""
    n = np.bincount(place, minlength=count)
    return n, np.bincount(place, z, minlength=count) / np.maximum(n, 1)


def assign_bins(x: np.ndarray) -> np.ndarray:
    """Return the bin (n,) of each finite value: one for each level, or `MOST_BINS` of equal width where levels are many."""
    levels = np.unique(x)
    if len(levels) <= MOST_BINS:
        return np.searchsorted(levels, x)
    return np.minimum((MOST_BINS * (x - x.min()) / np.ptp(x)).astype(int), MOST_BINS - 1)


def bin_means(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of x and y in every bin of x with enough samples, from left to right."""
    place = assign_bins(x)
    count = int(place.max()) + 1
    n, mean_x = _bin_counts_and_means(place, x, count)
    full = n >= FEWEST_SAMPLES_PER_BIN
    return mean_x[full], _bin_counts_and_means(place, y, count)[1][full]
