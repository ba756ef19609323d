"""Stage `lateness`: whether a drive that lags, a log that is delayed, or both make the robot late.

The laws differ in what they make of a command within a few tenths of a second, and there a log knows the command only at its rows,
and only with the noise of its reading. The search takes one path through the rows for the true one; on it a lag, which smooths,
beats a delay where readings are noisy, and loses to it where corners fall between rows. So the laws are weighed anew, by what the
outputs say the tendons were given: at each row u, with covariance C, from residuals, their noise and the outputs' sensitivities.
What the command was between rows is known with a variance (`path`), of which V is that of commands as late as the robot is. A law
that makes m of the likeliest path is worth 2 sum log t(u - m; C + V) - k log n, t Student's. V is one for all laws: each by its own
would be a likelihood if rows were independent; a lag blurs over rows what is unknown and seems surer than it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize, minimize_scalar

from twin.body import Drive, Signals
from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.calibration.objective import sensitivity
from twin.diagnosis.evidence.scored_model import ScoredModel, score_model
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search.command_spline import SmoothedCommand, smooth_command
from twin.diagnosis.search.search import Search
from twin.diagnosis.thresholds import CLEAR_CHI_SQUARE, LAG_OR_DELAY_ROWS, STUDENT_DEGREES
from twin.effects.actuator_lag import ActuatorLag, lag_response
from twin.effects.time_delay import TimeDelay
from twin.foundation.errors import SolveError
from twin.prediction.prepared import PreparedRecording

LAG, DELAY = ActuatorLag.id, TimeDelay.id
LATE = frozenset({LAG, DELAY})  # effects for which it counts when a command came
LateEffects = frozenset[str]
Form = Callable[[np.ndarray], tuple[float, float, float]]  # free numbers -> delay (s), lag (s), inertia


@dataclass(frozen=True)
class Given:
    """What the outputs of a trial say its tendons were given: `pull` (n, n_tendon) at `time` (n,), with precision (n, n_tendon,
    n_tendon), that of commands counted; and what was commanded."""

    time: np.ndarray
    pull: np.ndarray
    precision: np.ndarray
    command: SmoothedCommand


@dataclass(frozen=True)
class Weight:
    """What a law of lateness is worth (2 ln odds), and its values by effect."""

    score: float
    values: Mapping[str, Mapping[str, float]]


def lag_or_delay(context: FitContext, found: Search) -> Search:
    """`found` with its laws of lateness weighed anew, where its best set has one and all tendons are driven alike, not by currents:
    springs remember by themselves."""
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
    """Whether laws of lateness are weighed by what the tendons were given: all of them driven alike, not by currents."""
    drives = set(context.prepared.drives)
    return len(drives) == 1 and Drive.CURRENT not in drives


def rescored(sets: list[ScoredModel], weights: Mapping[LateEffects, Weight]) -> list[ScoredModel]:
    """Sets that differ in their laws of lateness alone differ in score by what these are worth; the best of them keeps its own."""
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
    """By how much (s) a steady pull is late."""
    laws = {e.id: e for e in best.fit.model.twin.effects if e.id in LATE}
    return sum(e["time" if n == LAG else "delay"] for n, e in laws.items())


def _in_place(context: FitContext, best: ScoredModel, likely: Weight) -> ScoredModel | None:
    """The set with these laws in place of its own, fitted; None without equilibrium."""
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
    """Every law by itself and both, for a robot some `late` seconds late; None for one that is early, which no drive is.

    A lag of second order must be clearly better than what is simpler, since it bends to what `path` does not know of corners and
    smooths its errors; both laws clearly better than that, of which an overdamped one is nearly a delay and a lag.
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
    """Twice the largest log likelihood of a form, and where it is."""

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
    """Log likelihood, up to a constant, of what the tendons of a trial were given, under such a law."""
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
    """Values (n, m) at `time` (n,) as they were at the moments `when`; what was before the first of them is as the first."""
    return make_interp_spline(time, values, k=1)(np.clip(when, time[0], time[-1]))


def given(context: FitContext, best: ScoredModel) -> list[Given]:
    """Of the fitted trials that move fastest, `LAG_OR_DELAY_ROWS` of each at most, under the best set: what it has the tendons
    given, and what its residuals add."""
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
        span = max(float(np.ptp(inputs.command)), 1e-9)  # what no output shows is somewhere within it
        covariance = np.linalg.inv(np.einsum("nma,nmb->nab", per_sigma, per_sigma) + np.eye(prepared.n_tendon) / span**2)
        more = np.einsum("nab,nmb,nm->na", covariance, per_sigma, r)
        way = smooth_command(time, command, float(np.mean(noise.drive)))
        unknown = shifted(way.time, way.variance, time - late)
        precision = np.linalg.inv(covariance + unknown[:, None, None] * np.eye(prepared.n_tendon))
        out.append(Given(time, _driving(prepared, delivered)[rows] + more, precision, way))
    return out


def _driving(prepared: PreparedRecording, signals: Signals) -> np.ndarray:
    """(n, n_tendon) of whatever drives each tendon."""
    return np.where(prepared.driven_by(Drive.DISPLACEMENT), signals.displacement, signals.tension)


def _fastest(prepared: PreparedRecording, trials: list[int]) -> list[int]:
    """Trials of three rows or more by the rate of their commands, as many as `LAG_OR_DELAY_ROWS` hold and at least one."""
    long = [k for k in trials if len(prepared.inputs[k].time) > 2]
    rate = {k: float(np.abs(np.diff(prepared.inputs[k].command, axis=0)).sum() / np.ptp(prepared.inputs[k].time)) for k in long}
    out, rows = [], 0
    for k in sorted(long, key=lambda k: -rate[k]):
        rows += len(prepared.inputs[k].time)
        if out and rows > LAG_OR_DELAY_ROWS:
            break
        out.append(k)
    return out
