"""The repeatability of trials beside the scatter of rows: noise that is constant throughout a trial is not white.

A hold that differs by 3 mm the next day, measured by a camera with a noise of 0.05 mm, has two noises. Declared noise may be
either.
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np

from twin.diagnosis.calibration.first_calibration import sensitivity_at
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.explain.within_trial import within_trial
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.noise.estimate import repeats, row_noise
from twin.diagnosis.thresholds import LASTING_DIFFERENCE, LONG_PAUSE, OVERSTATED_NOISE_RATIO, SIGNIFICANT_STANDARD_ERRORS
from twin.foundation.errors import SolveError
from twin.prediction.evaluate import OUTPUT_GROUPS


def repeatability(context: FitContext, found: Fit) -> tuple[str, ...]:
    """Return notices on each group of outputs, where the two noises differ.

    Declared noise (where no trial repeats another) is reported if it is `OVERSTATED_NOISE_RATIO` times the scatter of rows, s = RMS
    (r_(i-1) - 2 r_i + r_(i+1)) / sqrt(6) of the residuals r under the twin in force, less the inputs' noise: it then is the
    difference between repeated trials. The notice compares the variation of r within trials with s, which a true twin would leave,
    and names the effect that explains it (`within_trial`).

    Pairs of repeats are reported if their means differ, by RMS d / sqrt(2), by more than `LASTING_DIFFERENCE` of the noise and more
    than by chance: between sessions, `LONG_PAUSE` apart, and within one.
    """
    groups = dict.fromkeys(o.group for o in context.prepared.outputs)
    if context.objective.whitener.noise.declared:
        try:
            return tuple(_declared(context, found, groups))
        except SolveError:  # a neighbour of the model in force has no equilibrium: no notice
            return ()
    return tuple(words for g in groups for words in _repeated(context, found.evaluation.raw, g))


def _declared(context: FitContext, found: Fit, groups: Iterable[str]) -> Iterator[str]:
    prepared, raw, noise = context.prepared, found.evaluation.raw, context.objective.whitener.noise
    G = sensitivity_at(context.objective, found.evaluation)
    rows, of = row_noise(prepared, raw, G, noise.drive), [o.group for o in prepared.outputs]
    for group in groups:
        own = np.array([g == group for g in of])
        declared, scatter = _rms(noise.sigma[own]), _rms(rows.sigma[own])
        if not declared > OVERSTATED_NOISE_RATIO * scatter > 0.0:
            continue
        unit, factor = OUTPUT_GROUPS[group].unit, OUTPUT_GROUPS[group].factor
        moves = _rms(np.concatenate([(r - _means(r))[:, own].ravel() for r in raw]))
        d, s, w = (f"{factor * x:.2g} {unit}" for x in (declared, scatter, moves))
        yield (
            f"{OUTPUT_GROUPS[group].kind}: {d} are declared as noise, but rows scatter by {s} within a trial: the rest is constant "
            f"throughout a trial. Errors below the declared noise count as noise, whatever their cause; within trials what is left "
            f"varies by {w}, {within_trial(context, found, rows, G, own).words()}"
        )


def _repeated(context: FitContext, raw: list[np.ndarray], group: str) -> Iterator[str]:
    prepared, place = context.prepared, {k: i for i, k in enumerate(context.trials)}
    own = [o.group == group for o in prepared.outputs]
    noise = context.objective.whitener.noise
    pairs = [(a, b) for a, b in repeats(prepared) if a in place and b in place]
    if not pairs:
        return
    lasting = {p: _means(raw[place[p[0]]][:, own]) - _means(raw[place[p[1]]][:, own]) for p in pairs}
    size = {p: _rms(d) / np.sqrt(2.0) for p, d in lasting.items()}
    sigma = _rms(noise.sigma[own])
    chance = _rms(noise.in_means(min(len(raw[place[a]]) for a, _ in pairs))[own])
    whole = _rms(np.array(list(size.values())))
    if not whole > max(LASTING_DIFFERENCE * sigma, SIGNIFICANT_STANDARD_ERRORS * chance):
        return
    unit, factor = OUTPUT_GROUPS[group].unit, OUTPUT_GROUPS[group].factor

    def shown(x: float) -> str:
        return f"{factor * x:.2g} {unit}"

    far = {p: _session(context, p[0]) != _session(context, p[1]) for p in pairs}
    parts = ""
    if any(far.values()) and not all(far.values()):
        within, between = (_rms(np.array([size[p] for p in pairs if far[p] == apart])) for apart in (False, True))
        parts = f", {shown(within)} within a session and {shown(between)} between sessions"
    yield (
        f"{OUTPUT_GROUPS[group].kind}: repeated trials differ by {shown(whole)} throughout{parts}, where rows scatter by "
        f"{shown(sigma)}: no effect in force explains the difference"
    )


def _session(context: FitContext, trial: int) -> int:
    """Return the number of pauses before a trial."""
    inputs = sorted(context.prepared.inputs, key=lambda i: float(i.clock[0]))
    begun = context.prepared.inputs[trial].clock[0]
    return sum(int(b.clock[0] - a.clock[-1] > LONG_PAUSE and b.clock[0] <= begun) for a, b in pairwise(inputs))


def _means(r: np.ndarray) -> np.ndarray:
    known = np.isfinite(r)
    return np.where(known, r, 0.0).sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)


def _rms(x: np.ndarray) -> float:
    known = x[np.isfinite(x)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0
