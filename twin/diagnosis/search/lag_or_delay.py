"""Stage `lag_or_delay`: decide whether a lag of the drive, a delay of the log, or both make the robot late.

A lag and a delay differ in what they make of a command within a few tenths of a second. There the log knows the command only at its
rows, with the noise of its reading. The search takes one path through the rows for the true one. On it a lag, which smooths, beats
a delay where readings are noisy, and loses to it where corners fall between rows.

The effects are therefore scored again, by the commands that the outputs imply: at each row u, with covariance C, from residuals,
their noise and the outputs' sensitivities. The command between rows is known with a variance (`smooth_command`), of which V is that
of commands as late as the robot is. An effect that makes m of the likeliest path scores 2 sum log t(u - m; C + V) - k log n, t
Student's. V is the same for all effects: an own V each would be a likelihood only if rows were independent; a lag averages the
unknown over rows and would seem more certain than it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize, minimize_scalar

from twin.body import Drive, Signals
from twin.body.drives.lag import lag_response
from twin.diagnosis.calibration.first_calibration import sensitivity
from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.evidence.scored_model import ScoredModel, score_model
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search.command_spline import SmoothedCommand, smooth_command
from twin.diagnosis.search.search import Search
from twin.diagnosis.thresholds import CLEAR_CHI_SQUARE, LAG_OR_DELAY_ROWS, STUDENT_DEGREES
from twin.effects.actuator_lag import ActuatorLag
from twin.effects.time_delay import TimeDelay
from twin.foundation.errors import SolveError
from twin.prediction.prepared import PreparedRecording

LAG, DELAY = ActuatorLag.id, TimeDelay.id
LATE = frozenset({LAG, DELAY})  # effects that depend on when a command came
LateEffects = frozenset[str]
Form = Callable[[np.ndarray], tuple[float, float, float]]  # free numbers -> delay (s), lag (s), inertia


@dataclass(frozen=True)
class Given:
    """The commands that a trial's outputs imply.

    `pull` (n, n_tendon) at `time` (n,), with precision (n, n_tendon, n_tendon), which includes the uncertainty of the command; and
    the logged command.
    """

    time: np.ndarray
    pull: np.ndarray
    precision: np.ndarray
    command: SmoothedCommand


@dataclass(frozen=True)
class Weight:
    """The score (2 ln odds) of a lag, a delay or both, and the parameter values by effect."""

    score: float
    values: Mapping[str, Mapping[str, float]]


def lag_or_delay(context: FitContext, found: Search) -> Search:
    """Return the search with its lag and delay scored again.

    Unchanged if the best candidate has neither, or if tendons are driven in different ways, by controls, or by currents: springs
    have a memory of their own.
    """
    laws = LATE & set(found.best.effects)
    if not laws or not tells_laws(context) or not context.budget.allows("what makes it late"):
        return found
    context.progress("what makes it late")
    trials = given(context, found.best)
    weights = weighed(trials, typical(found.best)) if trials else None
    if weights is None:
        return found
    likely = max(weights, key=lambda f: weights[f].score)
    best = found.best
    if likely != laws:
        best = _in_place(context, best, weights[likely]) or best
    ranked = rescored([best, *(w for w in found.all if w.forms != best.forms)], weights)
    best = next(w for w in ranked if w.forms == best.forms)
    return replace(found, best=best, all=tuple(sorted(ranked, key=lambda w: -w.score)))


def tells_laws(context: FitContext) -> bool:
    """Return whether lag and delay are scored by the implied commands.

    They are if all tendons are driven alike, by tensions or lengths. Controls of an MJCF are known exactly, between rows too: there
    the evidence of the fits decides.
    """
    drives = set(context.prepared.drives)
    return len(drives) == 1 and not drives & {Drive.CURRENT, Drive.CONTROL}


def rescored(sets: list[ScoredModel], weights: Mapping[LateEffects, Weight]) -> list[ScoredModel]:
    """Rescore candidates that differ only in lag and delay by the scores of these; the best of each group keeps its score."""
    top: dict[frozenset[tuple[str, str]], float] = {}
    for w in sets:
        if LATE & set(w.effects):
            top[_rest(w)] = max(top.get(_rest(w), -np.inf), w.score)
    most = max(w.score for w in weights.values())
    out = []
    for w in sets:
        laws = LATE & set(w.effects)
        behind = most - weights[laws].score if laws else 0.0
        out.append(replace(w, score=top[_rest(w)] - behind) if laws else w)
    return out


def _rest(w: ScoredModel) -> frozenset[tuple[str, str]]:
    return frozenset(law for law in w.forms if law[0] not in LATE)


def typical(best: ScoredModel) -> float:
    """Return the lateness (s) of a steady pull."""
    laws = {e.id: e for e in best.fit.model.twin.effects if e.id in LATE}
    return sum(e["time" if n == LAG else "delay"] for n, e in laws.items())


def _in_place(context: FitContext, best: ScoredModel, likely: Weight) -> ScoredModel | None:
    """Return the candidate with these effects in place of its own lag or delay, fitted; None without an equilibrium."""
    model = best.fit.model
    for law in LATE:
        model = model.without_effect(law)
    for law, values in likely.values.items():
        model = model.with_effect(law, dict(values), tuple(values), context.prepared.n_tendon)
    try:
        return score_model(context, fit(context.objective, model))
    except SolveError:
        return None


def weighed(trials: list[Given], late: float) -> dict[LateEffects, Weight] | None:
    """Return the scores of lag, delay and both, for a robot some `late` seconds late; None for an early one, which no drive is.

    A second-order lag must be clearly better than a simpler one, since it adapts to errors of the spline at corners. Both effects
    together must be clearly better than that, since an overdamped lag is nearly a delay and a lag.
    """
    if late <= 0.0:
        return None
    n = sum(g.pull.size for g in trials)
    lag, delay = frozenset({LAG}), frozenset({DELAY})
    delayed = _best(trials, lambda x: (x[0], 0.0, 0.0), np.array([late]))
    first = _best(trials, lambda x: (0.0, x[0], 0.0), np.array([late]))
    second = _best(trials, lambda x: (0.0, x[0], x[1]), np.array([first[1][1], 0.25]))
    both = _best(trials, lambda x: (x[0], x[1], 0.0), 0.5 * np.array([late, late]))
    cost = float(np.log(n))
    lagging = max(
        Weight(first[0] - cost, {LAG: {"time": first[1][1]}}),
        Weight(second[0] - 2 * cost - CLEAR_CHI_SQUARE, {LAG: {"time": second[1][1], "inertia": second[1][2]}}),
        key=lambda w: w.score,
    )
    together = {DELAY: {"delay": both[1][0]}, LAG: {"time": both[1][1]}}
    return {
        delay: Weight(delayed[0] - cost, {DELAY: {"delay": delayed[1][0]}}),
        lag: lagging,
        delay | lag: Weight(both[0] - 2 * cost - 2 * CLEAR_CHI_SQUARE, together),
    }


def _best(trials: list[Given], form: Form, start: np.ndarray) -> tuple[float, tuple[float, float, float]]:
    """Return twice the largest log likelihood of a form, and its parameters."""

    def cost(x: np.ndarray) -> float:
        delay, lag, inertia = form(np.atleast_1d(x))
        if min(delay, lag, inertia) < 0.0 or lag > 5.0 or inertia > 10.0:
            return np.inf
        return -sum(likelihood(g, delay, lag, inertia) for g in trials)

    found: Any
    if len(start) == 1:
        found = minimize_scalar(cost, bounds=(0.0, 3.0 * start[0]), method="bounded", options={"xatol": 1e-3 * start[0]})
        x = np.array([found.x])
    else:
        corners = np.vstack([start, start + np.diag(0.3 * start)])
        found = minimize(cost, start, method="Nelder-Mead", options={"initial_simplex": corners, "xatol": 1e-3, "fatol": 0.1})
        x = found.x
    return -2.0 * float(found.fun), form(x)


def likelihood(seen: Given, delay: float, lag: float, inertia: float) -> float:
    """Return the log likelihood, up to a constant, of a trial's implied commands under a delay (s), a lag (s) and its inertia."""
    way, tendons = seen.command, seen.pull.shape[1]
    delivered = way.mean
    if lag > 0.0:
        chords, delivered = np.diff(way.mean, axis=0) / np.diff(way.time)[:, None], np.empty_like(way.mean)
        lag_response(way.time, np.stack([0.0 * chords, 0.0 * chords, chords, way.mean[:-1]]), lag, inertia, delivered)
    e = seen.pull - shifted(way.time, delivered, seen.time - delay)
    return float(
        -0.5 * (STUDENT_DEGREES + tendons) * np.log1p(np.einsum("na,nab,nb->n", e, seen.precision, e) / STUDENT_DEGREES).sum()
    )


def shifted(time: np.ndarray, values: np.ndarray, when: np.ndarray) -> np.ndarray:
    """Return values (n, m) given at `time` (n,), interpolated at the moments `when`; before the first they equal the first."""
    return make_interp_spline(time, values, k=1)(np.clip(when, time[0], time[-1]))


def given(context: FitContext, best: ScoredModel) -> list[Given]:
    """Return the implied commands of the fitted trials that move fastest, `LAG_OR_DELAY_ROWS` of each at most.

    They are the commands delivered under the best candidate plus what its residuals add.
    """
    prepared, at = context.prepared, best.fit.evaluation
    twin, place = at.model.twin, {k: i for i, k in enumerate(context.trials)}
    laws = [e for e in twin.effects if e.id in LATE]
    chosen = _fastest(prepared, context.trials)
    G = sensitivity(prepared, chosen, twin, [at.traces[k].outputs(twin, prepared) for k in chosen], at.traces)
    noise, late, out = context.objective.whitener.noise, max(0.0, typical(best)), []
    for k, g in zip(chosen, G, strict=True):
        inputs, delivered = prepared.inputs[k], prepared.inputs[k].signals
        for law in laws:
            delivered = law.drive(law.command(delivered))
        rows = slice(0, LAG_OR_DELAY_ROWS)
        raw, time, command = at.raw[place[k]][rows], inputs.time[rows], _driving(prepared, inputs.signals)[rows]
        seen = np.isfinite(raw)
        per_sigma = np.where(seen[:, :, None], g[rows] / noise.sigma[:, None], 0.0)
        r = np.where(seen, raw, 0.0) / noise.sigma
        span = max(float(np.ptp(inputs.command)), 1e-9)  # a command that no output shows lies somewhere within it
        covariance = np.linalg.inv(np.einsum("nma,nmb->nab", per_sigma, per_sigma) + np.eye(prepared.n_tendon) / span**2)
        more = np.einsum("nab,nmb,nm->na", covariance, per_sigma, r)
        way = smooth_command(time, command, float(np.mean(noise.drive)))
        unknown = shifted(way.time, way.variance, time - late)
        precision = np.linalg.inv(covariance + unknown[:, None, None] * np.eye(prepared.n_tendon))
        out.append(Given(time, _driving(prepared, delivered)[rows] + more, precision, way))
    return out


def _driving(prepared: PreparedRecording, signals: Signals) -> np.ndarray:
    """Return whatever drives each tendon (n, n_tendon)."""
    return np.where(prepared.driven_by(Drive.DISPLACEMENT), signals.displacement, signals.tension)


def _fastest(prepared: PreparedRecording, trials: list[int]) -> list[int]:
    """Return trials of three rows or more by the rate of their commands, the fastest first.

    As many as `LAG_OR_DELAY_ROWS` hold, and at least one.
    """
    long = [k for k in trials if len(prepared.inputs[k].time) > 2]
    rate = {k: float(np.abs(np.diff(prepared.inputs[k].command, axis=0)).sum() / np.ptp(prepared.inputs[k].time)) for k in long}
    out, rows = [], 0
    for k in sorted(long, key=lambda k: -rate[k]):
        rows += len(prepared.inputs[k].time)
        if out and rows > LAG_OR_DELAY_ROWS:
            break
        out.append(k)
    return out
