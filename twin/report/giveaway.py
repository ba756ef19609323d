"""What to plot a residual against, so that an effect shows itself.

Each law says in words what it moves with (`Effect.moves_with`). Those words choose a kind of variable (the loop of a tendon's pull,
time, payload, ...); which tendon, which axis and which channel is chosen by what the effect changed: the pair whose binned
curve carries most of the difference between the two predictions, in sigmas.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from twin.bench import Bench
from twin.diagnose import Diagnosis
from twin.effects import named
from twin.report.stages import before_and_after, markers, residuals

BINS = 14
WORDS = (  # words of a law or a regressor -> kind of variable; the first that occurs counts
    ("direction of pull", "loop"),
    ("direction of t", "loop"),
    ("direction of bending", "azimuth"),
    ("rate", "rate"),
    ("time held", "elapsed"),
    ("over the last", "elapsed"),
    ("time", "clock"),
    ("temperature", "temperature"),
    ("trial", "clock"),
    ("payload", "payload"),
    ("position", "position"),
    ("place along", "reach"),
    ("bending", "reach"),
    ("load", "tension"),
    ("pull", "tension"),
    ("tension", "tension"),
    ("t1", "tension"),
)


@dataclass(frozen=True)
class Variable:
    """A quantity of every sample, (n_k,) per trial, with its axis title; `side` (-1, 0, 1) splits a loop's two branches."""

    words: str
    values: list[np.ndarray]
    side: list[np.ndarray] | None = None


@dataclass(frozen=True)
class Giveaway:
    """An output channel (column of the bench) and the variable its residual is plotted against; `why` in words."""

    column: int
    variable: Variable
    why: str


def giveaways(diagnosis: Diagnosis) -> list[Giveaway]:
    """One per effect in force; without any, one for the strongest regressor of what is left. Those that coincide are shown once."""
    first, second = before_and_after(diagnosis)
    before, after = residuals(diagnosis, first), residuals(diagnosis, second)
    if diagnosis.claims:
        changed = [a - b for a, b in zip(before, after, strict=True)]
        wanted = [(c.effect.replace("_", " "), named(c.effect).moves_with) for c in diagnosis.claims]
    else:
        changed = after
        strongest = diagnosis.strongest[0][0] if diagnosis.verdict == "unexplained" and diagnosis.strongest else "tension"
        wanted = [("what is left", strongest)]
    found = [_choose(diagnosis, changed, kind_of(words), f"{name} moves with {words}") for name, words in wanted]
    unique = {(g.column, g.variable.words): g for g in found if g is not None}
    return list(unique.values())


def kind_of(words: str) -> str | None:
    """The kind of variable that words name; None where they name none."""
    low = words.lower()
    return next((kind for word, kind in WORDS if word in low), None)


def _choose(diagnosis: Diagnosis, changed: list[np.ndarray], kind: str | None, why: str) -> Giveaway | None:
    bench = diagnosis.bench
    every = list(variables(bench))
    fitting = [v for k, v in every if k == kind and _varies(v)] or [v for _, v in every if _varies(v)]
    if not fitting:
        return None
    z = np.concatenate(changed) / diagnosis.noise.sigma
    columns = range(z.shape[1])
    score = {(i, j): _carried(v, z[:, j]) for i, v in enumerate(fitting) for j in columns}
    if not score:
        return None
    i, j = max(score, key=lambda key: score[key])
    return Giveaway(j, fitting[i], why)


def _varies(variable: Variable) -> bool:
    values = np.concatenate(variable.values)
    return bool(np.nanmax(values) - np.nanmin(values) > 1e-9) if np.isfinite(values).any() else False


def _carried(variable: Variable, z: np.ndarray) -> float:
    """How much of z (n,) a binned curve over the variable carries: sum of n (mean of bin - overall mean)^2.

    For a loop, the difference of its two branches instead.
    """
    x = np.concatenate(variable.values)
    side = None if variable.side is None else np.concatenate(variable.side)
    ok = np.isfinite(x) & np.isfinite(z)
    place, count = bins(x[ok])
    z = z[ok]
    if side is None:
        n = np.bincount(place, minlength=count)
        mean = np.bincount(place, z, minlength=count) / np.maximum(n, 1)
        return float((n * (mean - z.mean()) ** 2).sum()) if len(z) else 0.0
    total, half = 0.0, []
    for sign in (-1, 1):
        mine = side[ok] == sign
        n = np.bincount(place[mine], minlength=count)
        half.append((n, np.bincount(place[mine], z[mine], minlength=count) / np.maximum(n, 1)))
    (n0, m0), (n1, m1) = half
    total = n0 * n1 / np.maximum(n0 + n1, 1) * (m1 - m0) ** 2
    return float(total.sum())


def bins(x: np.ndarray) -> tuple[np.ndarray, int]:
    """The bin (n,) of each value and their number: few different values are their own bins, many share `BINS` of equal counts."""
    levels = np.unique(x)
    if len(levels) <= BINS:
        return np.searchsorted(levels, x), len(levels)
    edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)[1:-1]))
    return np.searchsorted(edges, x, side="right"), len(edges) + 1


def variables(bench: Bench) -> Iterator[tuple[str, Variable]]:
    """Everything a residual of this recording can be plotted against: (kind, variable)."""
    inputs = bench.inputs
    for t in range(bench.n_tendon):
        tension = [i.tension[:, t] for i in inputs]
        slope = [_slope(i.time, i.tension[:, t]) for i in inputs]
        still = 0.1 * max(float(np.median(np.abs(np.concatenate(slope)))), 1e-9)
        side = [np.where(np.abs(s) > still, np.sign(s), 0.0) for s in slope]
        title = f"tension of tendon {t + 1} (N)"
        yield "loop", Variable(title, tension, side)
        yield "tension", Variable(title, tension)
        yield "rate", Variable(f"rate of tendon {t + 1}'s tension (N/s)", slope)
    yield "elapsed", Variable("time in the trial (s)", [i.time - i.time[0] for i in inputs])
    yield "clock", Variable("time since the first trial (min)", [i.clock / 60.0 for i in inputs])
    yield "payload", Variable("tip payload (g)", [np.full(len(i.time), 1e3 * i.loads.payload) for i in inputs])
    yield "temperature", Variable("ambient temperature (K)", [i.temperature for i in inputs])
    yield from _of_the_tip(bench)


def _of_the_tip(bench: Bench) -> Iterator[tuple[str, Variable]]:
    whole = markers(bench)
    if not whole:
        return
    name, columns = whole[-1]
    at = [1e3 * y[:, columns] for y in bench.measured]
    for a, axis in enumerate("xyz"):
        yield "position", Variable(f"measured {axis} of {name} (mm)", [p[:, a] for p in at])
    for angle in range(15, 360, 15):
        if angle % 90:
            c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
            yield "position", Variable(f"reach of {name} towards {angle}° (mm)", [c * p[:, 0] + s * p[:, 1] for p in at])
    yield "azimuth", Variable(f"direction {name} is bent to (°)", [np.degrees(np.arctan2(p[:, 1], p[:, 0])) for p in at])
    yield "reach", Variable(f"distance of {name} from the straight axis (mm)", [np.hypot(p[:, 0], p[:, 1]) for p in at])


def _slope(time: np.ndarray, tension: np.ndarray) -> np.ndarray:
    """dT/dt (n,) in N/s, smoothed over five samples so that noise alone makes no direction."""
    if len(time) < 2:
        return np.zeros_like(tension)
    wide = np.convolve(np.pad(tension, 2, mode="edge"), np.ones(5) / 5.0, "valid")
    return np.gradient(wide, time)
