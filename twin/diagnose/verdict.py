"""The main job: from a recording to what the twin lacks, how sure that is, and the error before and after on unseen trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from twin.bench import Bench, prepare
from twin.calibrate import Fit, Model, Objective, fit
from twin.diagnose.describe import change, components, describe, misbent, nearest, since, where, worst_channel
from twin.diagnose.evidence import Evidence, Spectrum
from twin.diagnose.experiment import Experiment, next_experiment
from twin.diagnose.identifiability import Visibility, identifiability
from twin.diagnose.null import ACCEPT, Thresholds, thresholds
from twin.diagnose.screen import dictionary
from twin.diagnose.search import FORM, Progress, Search, Weighed, refit_without, search, weigh
from twin.diagnose.split import split
from twin.errors import DataError, SolveError
from twin.evaluate import rms, squares
from twin.measurements import Recording
from twin.quantities import Fitted
from twin.residual import Noise, Whitener, estimate_noise
from twin.twin import Trace, Twin, readings, report, simulate, unstable_starts

SHARE = 0.3  # of the structure before: what is left counts if it is above the design's threshold and above this share
MUCH = 0.45  # sigma of structure that counts whatever was there before
ALONE = 0.3  # sigma of structure that counts where no effect was found: a base model may be off by less
HALF = 0.5  # effects that leave more than this share of the structure do not explain it
TEMPER = 20.0  # odds are exp(score / 20): the likelihood takes the laws' form for exact, which makes raw odds absurd


@dataclass(frozen=True)
class Settings:
    """How a diagnosis is run: seed of the split, worker threads."""

    seed: int = 0
    jobs: int = 2


@dataclass(frozen=True)
class Claim:
    """An effect in force (or a runner-up): parameters, the held-out error without it (or with it alone), its probability."""

    effect: str
    parameters: dict[str, Fitted]
    error: float
    probability: float
    contribution: float = 0.0  # sigma: how far dropping it moves the fitted trials
    beside: tuple[str, ...] = ()  # the other effects of the set a runner-up was fitted in


@dataclass(frozen=True)
class Errors:
    """RMS on the held-out trials, SI, by group of outputs ("marker": Euclidean per marker); confidence intervals over trials."""

    nominal: dict[str, float]
    calibrated: dict[str, float]
    after: dict[str, float]
    floor: dict[str, float]
    ci_calibrated: dict[str, tuple[float, float]]
    ci_after: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Diagnosis:
    """Everything a report shows. Residuals are measured - predicted (n_k, n_output) SI, by stage, all trials in clock order."""

    verdict: str
    twin: Twin
    calibrated: Twin
    claims: tuple[Claim, ...]
    runners_up: tuple[Claim, ...]
    below_materiality: tuple[Claim, ...]
    parameters: dict[str, Fitted]
    unfixed: tuple[str, ...]
    errors: Errors
    noise: Noise
    structure_before: float  # sigma
    structure_after: float
    structure: dict[str, float]  # component -> RMS in sigmas, after
    strongest: tuple[tuple[str, float], ...]
    line: tuple[float, float]  # z-score, Hz
    worst_channel: str
    description: str
    identifiability: tuple[Visibility, ...]
    ambiguous: tuple[tuple[str, ...], ...]
    experiment: Experiment | None
    bench: Bench
    fitted_trials: tuple[int, ...]
    held_trials: tuple[int, ...]
    predictions: dict[str, list[np.ndarray]]
    notices: tuple[str, ...]
    settings: Settings
    scores: tuple[tuple[tuple[str, ...], float], ...] = field(default=())


def diagnose(
    recording: Recording, twin: Twin, settings: Settings | None = None, progress: Progress = lambda words: None
) -> Diagnosis:
    """Diagnose a recording against a twin. Raises TwinError for data that cannot be used."""
    settings = settings or Settings()
    bench = prepare(recording, twin.robot)
    if len(bench.inputs) < 2:
        raise DataError(f"{recording.title}: a diagnosis needs at least two trials, one to fit and one held out")
    fitted, held = split(bench, settings.seed)
    progress("nominal prediction")
    nominal_traces = simulate(twin, bench)
    notices = [
        *bench.notices,
        *(f"{n}: unstable start, its shape is one of several" for n in unstable_starts(bench, nominal_traces)),
    ]
    progress("noise")
    start, objective, notes = _objective(bench, twin, fitted, settings)
    notices += notes
    evidence = Evidence(bench, fitted)
    progress("calibration")
    base = weigh(objective, evidence, fit(objective, start, refresh=True))
    patterns = dictionary(objective, base.fit)
    progress("no-effect sets of this design")
    bars = thresholds(objective, evidence, base.fit, patterns, settings.seed)
    bars = replace(bars, material=max(bars.material, _accuracy(bench, objective.whitener.noise, twin.robot.accuracy)))
    table = identifiability(objective, base.fit, patterns, bars.material)
    found = search(objective, evidence, base, patterns, bars, progress)
    progress("verdict")
    held_out = _HeldOut(bench, held)
    found = replace(found, best=_predicting(found, held_out, bars.accept))
    best, dropped, small = _gate(objective, evidence, found, bars.material, progress)
    before, after = base.discrepancy.size, best.discrepancy.size
    line = Spectrum.of(bench, fitted).peak(best.fit.z.reshape(best.discrepancy.mean.shape) - best.discrepancy.mean)
    own = tuple(e.id for e in twin.effects)
    added = tuple(e for e in best.effects if e not in own)
    predictions = {name: _predict_all(t, bench) for name, t in (("nominal", twin), ("calibrated", base.fit.model.twin))}
    off, z = base.discrepancy.mean * objective.whitener.noise.sigma, base.fit.z.reshape(base.discrepancy.mean.shape)
    calibrated = [predictions["calibrated"][k] for k in fitted]
    strange = before > bars.left and (bool(misbent(bench, fitted, off, calibrated)) or change(bench, fitted, z) is not None)
    verdict = _verdict(added, before, after, line[0], bars, strange)
    if added and held_out.error(best.fit.model.twin) > held_out.error(base.fit.model.twin):  # it makes unseen trials worse
        verdict = _verdict((), before, before, line[0], bars, strange)
    final = base if verdict in ("noise", "unexplained") else best
    too_small = {c.effect for c in small}
    claims = tuple(
        Claim(
            e,
            final.fit.fitted(e),
            held_out.error(dropped[e].fit.model.twin),
            _probability(found, e, too_small),
            _contribution(final, dropped[e], objective),
        )
        for e in added
        if final is best
    )
    runners = _runners_up(found, set() if verdict == "unexplained" else set(added), own, too_small, held_out)
    ambiguous = _ambiguous(found, final)
    experiment = None
    if ambiguous or (verdict not in ("noise",) and runners):
        rival = _rival(found, final, own)
        if rival is not None:
            progress("next experiment")
            experiment = next_experiment(bench, objective.whitener.noise, final.fit, rival.fit, settings.jobs)
    predictions["after"] = _predict_all(final.fit.model.twin, bench)
    moved = _sensitivity(bench, held, final.fit.model.twin, [predictions["after"][k] for k in held])
    floor = objective.whitener.noise.floor(bench, moved)
    left = final.fit.z.reshape(final.discrepancy.mean.shape)
    strongest = tuple(evidence.strongest(final.discrepancy))
    if verdict in ("noise", "explained"):
        description = f"What is left looks like noise (smooth part {final.discrepancy.size:.2f} sigma)."
    else:
        description = describe(bench, fitted, left, final.discrepancy, strongest[0][0], line, bars)
        description += where(bench, fitted, off, calibrated) if before > bars.left else ""
        description += since(bench, fitted, z)
        if runners:
            share = 1.0 - runners[0].error / held_out.error(final.fit.model.twin)
            description += nearest((runners[0].effect, *runners[0].beside), share)
    return Diagnosis(
        verdict=verdict,
        twin=final.fit.model.twin,
        calibrated=base.fit.model.twin,
        claims=tuple(sorted(claims, key=lambda c: -c.contribution)),
        runners_up=runners,
        below_materiality=small,
        parameters=final.fit.fitted(None),
        unfixed=tuple(final.fit.unfixed()),
        errors=_errors(bench, held, predictions, floor, settings.seed),
        noise=objective.whitener.noise,
        structure_before=before,
        structure_after=final.discrepancy.size,
        structure=components(final.discrepancy),
        strongest=strongest,
        line=line,
        worst_channel=worst_channel(bench, left),
        description=description,
        identifiability=tuple(table),
        ambiguous=ambiguous,
        experiment=experiment,
        bench=bench,
        fitted_trials=tuple(fitted),
        held_trials=tuple(held),
        predictions=predictions,
        notices=tuple(notices),
        settings=settings,
        scores=tuple((w.effects, w.score) for w in found.all),
    )


def calibration(recording: Recording, twin: Twin, settings: Settings | None = None) -> tuple[Fit, str]:
    """The robot's own uncertain parameters fitted, no effect sought; and the RMS error on held-out trials in words."""
    settings = settings or Settings()
    bench = prepare(recording, twin.robot)
    fitted, held = split(bench, settings.seed)
    start, objective, _ = _objective(bench, twin, fitted, settings)
    found = fit(objective, start, refresh=True)
    return found, f"{1e3 * _HeldOut(bench, held).error(found.model.twin):.3f} mm"


def _objective(bench: Bench, twin: Twin, fitted: list[int], settings: Settings) -> tuple[Model, Objective, list[str]]:
    """A first calibration under a guessed noise, and the objective every later fit uses."""
    measured = [bench.measured[k] for k in fitted]
    command = [bench.inputs[k].command for k in fitted]
    rough = np.array([{"marker": 2.5e-4, "displacement": 5e-5, "tension": 2e-2}[o.group] for o in bench.outputs])
    first = Noise(rough, np.zeros(bench.n_tendon), np.zeros(len(rough)), "start")
    none = [np.zeros((*y.shape, bench.n_tendon)) for y in measured]
    objective = Objective(bench, fitted, Whitener(first, measured, none, command), settings.jobs)
    start = fit(objective, Model.base(twin.robot, twin), tolerance=1e-3)
    unmeasured = objective.predict(start.model.twin, start.evaluation.traces)[1]
    sensitivity = _sensitivity(bench, fitted, start.model.twin, unmeasured, start.evaluation.traces)
    noise, notes = estimate_noise(bench, fitted, start.evaluation.raw, sensitivity)
    return start.model, Objective(bench, fitted, Whitener(noise, measured, sensitivity, command), settings.jobs), notes


def _sensitivity(
    bench: Bench, trials: Sequence[int], twin: Twin, predicted: Sequence[np.ndarray], near: list[Trace] | None = None
) -> list[np.ndarray]:
    """dy/du (n_k, n_output, n_tendon) SI: the prediction's answer to a constant change of each driving reading."""
    out = [np.empty((*y.shape, bench.n_tendon)) for y in predicted]
    for t in range(bench.n_tendon):
        step = 2.0 * bench.reading[t]
        push = step * np.eye(bench.n_tendon)[t]
        moved = replace(bench, inputs=tuple(replace(i, command=i.command + push) for i in bench.inputs))
        traces = simulate(twin, moved, trials=trials, near=near)
        for G, y, trace in zip(out, predicted, traces, strict=True):
            G[:, :, t] = (readings(bench, report(twin.effects, trace.true)) - y) / step
    return out


def _gate(
    objective: Objective, evidence: Evidence, found: Search, bar: float, progress: Progress
) -> tuple[Weighed, dict[str, Weighed], tuple[Claim, ...]]:
    """Drop effects below the materiality `bar` (sigma), smallest first.

    Returns what stays, its refits with one effect dropped, and what was too small.
    """
    best, small = found.best, []
    own = set(found.base.effects)
    while True:
        dropped = {}
        for e in best.effects:
            if e in own:
                continue
            progress(f"without {e}")
            dropped[e] = refit_without(objective, evidence, best, e)
        if not dropped:
            return best, {}, tuple(small)
        least = min(dropped, key=lambda e: _contribution(best, dropped[e], objective))
        c = _contribution(best, dropped[least], objective)
        if c >= max(bar, FORM * max(_contribution(best, w, objective) for w in dropped.values())):
            return best, dropped, tuple(small)
        small.append(Claim(least, best.fit.fitted(least), float("nan"), 0.0, c))
        best = dropped[least]


def _accuracy(bench: Bench, noise: Noise, accuracy: float) -> float:
    """The twin's own accuracy (m) in sigmas of the markers: no less can be claimed."""
    sigma = np.array([s for s, o in zip(noise.sigma, bench.outputs, strict=True) if o.group == "marker"])
    return accuracy / float(np.mean(sigma)) if sigma.size else 0.0


def _contribution(best: Weighed, without: Weighed, objective: Objective) -> float:
    """How far (sigma RMS) dropping an effect and refitting everything else moves the fitted trials."""
    fall = float(without.fit.z @ without.fit.z - best.fit.z @ best.fit.z)
    return float(np.sqrt(max(0.0, fall) / objective.n))


def _verdict(added: tuple[str, ...], before: float, after: float, line: float, bars: Thresholds, strange: bool) -> str:
    """`strange`: the calibrated error sits at one place of the body, or began at once, as that of no known effect does."""
    left = (after > bars.left and after > SHARE * before) or after > max(MUCH, bars.left) or line > bars.line
    if not added:
        left = after > max(ALONE, bars.left) or line > bars.line
        return "unexplained" if left else "noise"
    if not left:
        return "partly_explained" if strange else "explained"
    return "unexplained" if after > HALF * before else "partly_explained"


def _probability(found: Search, effect: str, small: set[str]) -> float:
    """Share of the tempered weight exp(score / 20) of sets with the effect; sets with a `small`, immaterial one do not count."""
    material = [w for w in found.all if not small & set(w.effects)]
    top = max(w.score for w in material)
    weights = np.array([np.exp((w.score - top) / TEMPER) for w in material])
    inside = np.array([effect in w.effects for w in material])
    return float(weights[inside].sum() / weights.sum())


def _predicting(found: Search, held_out: _HeldOut, accept: float) -> Weighed:
    """The best set that has an equilibrium in every held-out trial too: a stiff wall may leave a trial none."""
    ranked = [found.best, *sorted(found.all, key=lambda w: accept * len(w.effects) - w.score)]
    return next((w for w in ranked if np.isfinite(held_out.error(w.fit.model.twin))), found.base)


class _HeldOut:
    """Errors on the held-out trials."""

    def __init__(self, bench: Bench, held: Sequence[int]) -> None:
        self.bench, self.held = bench, list(held)

    def error(self, twin: Twin) -> float:
        """RMS on the held-out trials in SI: Euclidean per marker where there are markers, else of the first group.

        NaN where one has no equilibrium.
        """
        try:
            traces: list[Trace] = simulate(twin, self.bench, trials=self.held)
        except SolveError:
            return float("nan")
        raw = [
            self.bench.measured[k] - readings(self.bench, report(twin.effects, t.true))
            for k, t in zip(self.held, traces, strict=True)
        ]
        groups = list(dict.fromkeys(o.group for o in self.bench.outputs))
        return rms(self.bench, raw, "marker" if "marker" in groups else groups[0])


def _errors(bench: Bench, held: list[int], predictions: dict[str, list[np.ndarray]], floor: dict[str, float], seed: int) -> Errors:
    groups = list(dict.fromkeys(o.group for o in bench.outputs))
    raw = {name: [bench.measured[k] - y[k] for k in held] for name, y in predictions.items()}
    error = {name: {g: rms(bench, raw[name], g) for g in groups} for name in raw}
    interval = {name: {g: _interval(squares(bench, raw[name], g), seed) for g in groups} for name in ("calibrated", "after")}
    return Errors(error["nominal"], error["calibrated"], error["after"], floor, interval["calibrated"], interval["after"])


def _interval(squares: list[np.ndarray], seed: int) -> tuple[float, float]:
    """95 % bootstrap interval of an RMS, over whole trials and blocks of ten samples within them, since neighbours are alike."""
    blocks = [b for s in squares for b in np.array_split(s, max(1, len(s) // 10)) if len(b)]
    sums, counts = np.array([b.sum() for b in blocks]), np.array([len(b) for b in blocks])
    pick = np.random.default_rng(seed).integers(len(blocks), size=(1000, len(blocks)))
    values = np.sqrt(sums[pick].sum(axis=1) / counts[pick].sum(axis=1))
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)


def _predict_all(twin: Twin, bench: Bench) -> list[np.ndarray]:
    return [readings(bench, report(twin.effects, t.true)) for t in simulate(twin, bench)]


def _runners_up(found: Search, claimed: set[str], own: tuple[str, ...], small: set[str], held_out: _HeldOut) -> tuple[Claim, ...]:
    """Effects weighed and not claimed, each in its best set, best first; `error` is that set's on the held-out trials."""
    out: dict[str, Claim] = {}
    for w in found.all:
        for e in w.effects:
            if e not in claimed and e not in own and e not in out and e not in small:
                others = tuple(o for o in w.effects if o != e)
                error = held_out.error(w.fit.model.twin)
                out[e] = Claim(e, w.fit.fitted(e), error, _probability(found, e, small), beside=others)
    return tuple(list(out.values())[:6])


def _ambiguous(found: Search, final: Weighed) -> tuple[tuple[str, ...], ...]:
    """Other sets, not just the claimed one with something added, whose evidence comes within `ACCEPT` of it."""
    return tuple(
        w.effects for w in found.all if w.effects and not set(final.effects) <= set(w.effects) and w.score > final.score - ACCEPT
    )


def _rival(found: Search, final: Weighed, own: tuple[str, ...]) -> Weighed | None:
    """The best set that tells another story: not a superset of the claimed one."""
    for w in found.all:
        if w.effects != final.effects and set(w.effects) != set(own) and not set(final.effects) < set(w.effects):
            return w
    return None
