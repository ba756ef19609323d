"""What to plot a residual against, so that an effect shows itself.

Each law says in words what it moves with (`Effect.moves_with`). Those words choose a kind of variable (the loop of a tendon's pull,
time, payload, ...); which tendon, which axis and which channel is chosen by what the effect changed: the pair whose binned
curve carries most of the difference between the two predictions, in sigmas.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from twin.diagnose import Diagnosis
from twin.effects import named
from twin.report.stages import before_and_after, residuals
from twin.report.variables import Variable, variables
from twin.wording import in_words

BINS = 14
FEWEST = 4  # samples in a bin whose mean is drawn
WORDS = (  # words of a law or of a regressor -> kind of variable; the first that matches counts
    (r"^trial ", "clock"),
    (r"\bdirection of (pull|travel|strain|[td]\d)", "loop"),
    (r"\bdirection of bending", "azimuth"),
    (r"\brate\b", "rate"),
    (r"\btime held|over the last", "elapsed"),
    (r"\btime\b|\bsession\b", "clock"),
    (r"\btemperature\b", "temperature"),
    (r"\bpayload\b", "payload"),
    (r"\btorque\b", "torque"),
    (r"\bposition\b", "position"),
    (r"\bbending\b|\bstrain\b|\balong the body\b", "reach"),
    (r"\btension|\bpull\b|\bload|^[td]\d", "tension"),
)


@dataclass(frozen=True)
class Giveaway:
    """An output channel (column of the bench) and the variable its residual is plotted against; `why` in words."""

    column: int
    variable: Variable
    why: str


def giveaways(diagnosis: Diagnosis) -> list[Giveaway]:
    """One per effect in force; without any, one for the strongest regressor of what is left. Those that coincide are shown once."""
    d = diagnosis
    first, second = before_and_after(d)
    before, after = residuals(d, first), residuals(d, second)
    if d.claims:
        changed = [a - b for a, b in zip(before, after, strict=True)]
        laws = [(in_words(c.effect), named(c.effect).moves_with) for c in d.claims]
        wanted = [(kind_of(moves), f"{name} moves with {moves}") for name, moves in laws]
    elif d.verdict == "unexplained" and d.strongest:
        changed, name = after, d.strongest[0][0]
        wanted = [(kind_of(name), f"what is left moves most with {name!r}")]
    else:
        changed, wanted = after, [("tension", "for comparison, the residual against the strongest pull")]
    found = [_choose(d, changed, kind, why) for kind, why in wanted]
    return list({(g.column, g.variable.words): g for g in found if g is not None}.values())


def kind_of(words: str) -> str | None:
    """The kind of variable that words name; None where they name none."""
    return next((kind for pattern, kind in WORDS if re.search(pattern, words.lower())), None)


def _choose(diagnosis: Diagnosis, changed: list[np.ndarray], kind: str | None, why: str) -> Giveaway | None:
    every = [(k, v) for k, v in variables(diagnosis.bench) if _varies(v)]
    fitting = [v for k, v in every if k == kind] or [v for _, v in every]
    z = np.concatenate(changed) / diagnosis.noise.sigma
    score = {(i, j): _carried(v, z[:, j]) for i, v in enumerate(fitting) for j in range(z.shape[1])}
    if not score:
        return None
    i, j = max(score, key=lambda key: score[key])
    return Giveaway(j, fitting[i], why)


def _varies(variable: Variable) -> bool:
    x = variable.values[np.isfinite(variable.values) & variable.shown]
    return x.size > 3 and float(np.ptp(x)) > 1e-9


def _carried(variable: Variable, z: np.ndarray) -> float:
    """How much of z (n,) a binned curve over the variable carries: sum of n (mean of bin - overall mean)^2.

    For a loop, the difference of its two branches instead: sum of n_1 n_2 / (n_1 + n_2) (mean_1 - mean_2)^2.
    """
    ok = variable.shown & np.isfinite(variable.values) & np.isfinite(z)
    if not ok.any():
        return 0.0
    place, z, side = bins(variable.values[ok]), z[ok], variable.side[ok]
    count = place.max() + 1
    if not variable.loop:
        n, mean = _tally(place, z, count)
        return float((n * (mean - z.mean()) ** 2).sum())
    (n1, m1), (n2, m2) = (_tally(place[side == s], z[side == s], count) for s in (-1, 1))
    return float((n1 * n2 / np.maximum(n1 + n2, 1) * (m1 - m2) ** 2).sum())


def _tally(place: np.ndarray, z: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Number and mean of z in every bin."""
    n = np.bincount(place, minlength=count)
    return n, np.bincount(place, z, minlength=count) / np.maximum(n, 1)


def bins(x: np.ndarray) -> np.ndarray:
    """The bin (n,) of each finite value: few different values are their own bins, many share `BINS` of equal width."""
    levels = np.unique(x)
    if len(levels) <= BINS:
        return np.searchsorted(levels, x)
    return np.minimum((BINS * (x - x.min()) / np.ptp(x)).astype(int), BINS - 1)


def means(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of x and of y in every bin of x with enough samples, from left to right."""
    place = bins(x)
    count = int(place.max()) + 1
    n, mean_x = _tally(place, x, count)
    full = n >= FEWEST
    return mean_x[full], _tally(place, y, count)[1][full]
