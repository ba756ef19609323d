"""The main job: from a recording to what the twin lacks, how sure that is, and the error before and after on unseen trials."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from twin.bench import Bench, prepare
from twin.calibrate import Fit, Objective, fit
from twin.diagnose.describe import change, components, describe, misbent, mixed, nearest, since, unlike, where, worst_channel
from twin.diagnose.diagnosis import Claim, Diagnosis, Settings
from twin.diagnose.doubts import strained, unlikely
from twin.diagnose.evidence import Evidence, Spectrum
from twin.diagnose.experiment import next_experiment
from twin.diagnose.held_out import HeldOut
from twin.diagnose.identifiability import identifiability
from twin.diagnose.left_out import left_out
from twin.diagnose.null import ACCEPT, Thresholds, thresholds
from twin.diagnose.objective import objective_of
from twin.diagnose.rigs import rigs
from twin.diagnose.screen import dictionary
from twin.diagnose.search import FORM, Progress, Search, Weighed, refit_without, search, weigh
from twin.diagnose.spikes import without_spikes
from twin.diagnose.split import split
from twin.errors import DataError, SolveError
from twin.evaluate import UNIT
from twin.measurements import Recording
from twin.residual import Noise
from twin.twin import Twin, readings, report, simulate, unstable_starts

SHARE = 0.15  # of the structure before: what is left counts if it is above the design's threshold and above this share
MUCH = 0.45  # sigma of structure that counts whatever was there before
ALONE = 0.3  # sigma of structure that counts where no effect was found: a base model may be off by less
HALF = 0.5  # effects that leave more than this share of the structure do not explain it
EVEN = 0.5  # odds that a name is right where a law of its set is at its limit
TEMPER = 20.0  # odds are exp(score / 20): the likelihood takes the laws' form for exact, which makes raw odds absurd


def diagnose(
    recording: Recording, twin: Twin, settings: Settings | None = None, progress: Progress = lambda words: None
) -> Diagnosis:
    """Diagnose a recording against a twin. Raises TwinError for data that cannot be used."""
    settings = settings or Settings()
    bench = prepare(recording, twin.robot)
    if len(bench.inputs) < 2:
        raise DataError(f"{recording.title}: a diagnosis needs at least two trials, one to fit and one held out")
    progress("nominal prediction")
    nominal_traces = simulate(twin, bench)
    nominal = [readings(bench, report(twin.effects, t.true)) for t in nominal_traces]
    bench, alone = without_spikes(bench, nominal)
    notices = [
        *bench.notices,
        *alone,
        *(f"{n}: unstable start, its shape is one of several" for n in unstable_starts(bench, nominal_traces)),
    ]
    objective, evidence, base, held_out, notes = _calibrated(bench, twin, settings, (), progress)
    odd = held_out.odd(base.fit.model.twin) if base.discrepancy.size < ALONE else []
    if odd and len(odd) < len(bench.inputs) - 1:  # what these trials show would otherwise be seen by no fit
        shown = ", ".join(bench.inputs[k].name for k in odd)
        notices.append(f"{shown}: first held out, but unlike all others; fitted, and others held out in turn")
        objective, evidence, base, held_out, notes = _calibrated(bench, twin, settings, odd, progress)
    notices += notes
    fitted, held = objective.trials, held_out.trials
    patterns = dictionary(objective, base.fit)
    progress("no-effect sets of this design")
    bars = thresholds(objective, evidence, base.fit, patterns, settings.seed)
    bars = replace(bars, material=max(bars.material, _accuracy(bench, objective.whitener.noise, twin.robot.accuracy)))
    table = identifiability(objective, base.fit, patterns, bars.material)
    found = search(objective, evidence, base, patterns, bars, progress)
    progress("verdict")
    found = replace(found, best=_predicting(found, bench, bars.accept))
    if not _halved(objective, held_out, base, found.best):
        core = _most_predictive(found, objective, held_out)
        found = _beside(core, found, objective, evidence, bench, bars, progress) if core else found
    best, dropped, small = _gate(objective, evidence, found, held_out, bars.material, progress)
    if not _solves(best.fit.model.twin, bench):  # without the small ones
        best, dropped = found.base, {}
    before, after = base.discrepancy.size, best.discrepancy.size
    line = Spectrum.of(bench, fitted).peak(best.fit.z.reshape(best.discrepancy.mean.shape) - best.discrepancy.mean)
    own = tuple(e.id for e in twin.effects)
    added = tuple(e for e in best.effects if e not in own)
    predictions = {"nominal": nominal, "calibrated": _predict_all(base.fit.model.twin, bench)}
    off, rest = (w.discrepancy.mean * objective.whitener.noise.sigma for w in (base, best))  # SI
    z = base.fit.z.reshape(off.shape)
    predictions["after"] = _predict_all(best.fit.model.twin, bench)
    calibrated, improved = ([predictions[name][k] for k in fitted] for name in ("calibrated", "after"))
    bent = after > bars.left and bool(misbent(bench, fitted, rest, improved))
    bent_laws = strained(best.fit)
    strange = bent or bool(bent_laws) or (before > bars.left and change(bench, fitted, z) is not None)
    apart = rigs(bench, fitted, base.fit)
    if apart is not None and apart.fall < base.fit.cost - best.fit.cost:  # what the effects explain needs no second robot
        apart = None
    unseen, floor = held_out.structure(best.fit.model.twin)
    halved = _halved(objective, held_out, base, best)
    verdict = "unexplained" if apart else _verdict(added, before, after, unseen, line[0], bars, strange, halved)
    if added and held_out.worse(best.fit.model.twin, base.fit.model.twin):
        verdict = _verdict((), before, before, held_out.structure(base.fit.model.twin)[0], line[0], bars, strange, False)
    final = base if verdict in ("noise", "unexplained") else best
    bent_laws = bent_laws if final is best else []
    if final is base and best is not base:
        unseen, floor = held_out.structure(base.fit.model.twin)
        predictions["after"] = predictions["calibrated"]
    too_small = {c.effect for c in small}
    # What is left over has a cause too, and that cause may be what these effects imitate: by the share of the error they take.
    sure = max(0.0, 1.0 - after / before) if after > bars.left else 1.0
    sure = min(sure, EVEN) if bent_laws else sure
    claims = tuple(
        Claim(
            e,
            final.fit.fitted(e),
            held_out.error(dropped[e].fit.model.twin),
            sure * _probability(found, e, too_small),
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
    left = final.fit.z.reshape(final.discrepancy.mean.shape)
    strongest = tuple(evidence.strongest(final.discrepancy))
    if verdict in ("noise", "explained"):
        description = f"What is left looks like noise (smooth part {final.discrepancy.size:.2f} sigma)."
    else:
        description = describe(bench, fitted, left, final.discrepancy, strongest[0][0], line, bars)
        if final.discrepancy.size > bars.left:
            description += where(bench, fitted, *((rest, improved) if final is best else (off, calibrated)))
        description += since(bench, fitted, z)
        description += mixed(bench, apart) if apart else ""
        description += "".join(f" The {words}." for words in bent_laws)
        description += unlike(unseen, final.discrepancy.size) if unseen > max(MUCH, bars.left) else ""
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
        errors=held_out.errors(predictions, floor, settings.seed),
        noise=objective.whitener.noise,
        structure_before=before,
        structure_after=final.discrepancy.size,
        structure_unseen=unseen,
        bars=bars,
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
        notices=(*notices, *unlikely(final.fit), *bent_laws, *([mixed(bench, apart).strip()] if apart else [])),
        settings=settings,
        scores=tuple((w.effects, w.score) for w in found.all),
    )


def _calibrated(
    bench: Bench, twin: Twin, settings: Settings, shown: Collection[int], progress: Progress
) -> tuple[Objective, Evidence, Weighed, HeldOut, list[str]]:
    """The split with the trials `shown` on the fitted side, the noise there, and the robot's own parameters fitted."""
    fitted, held = split(bench, settings.seed, shown)
    progress("noise")
    start, objective, notes = objective_of(bench, twin, fitted, settings)
    evidence = Evidence(bench, fitted)
    progress("calibration")
    base = weigh(objective, evidence, fit(objective, start, refresh=True))
    return objective, evidence, base, HeldOut(bench, held, objective.whitener.noise), notes


def calibration(recording: Recording, twin: Twin, settings: Settings | None = None) -> tuple[Fit, str, tuple[str, ...]]:
    """The robot's own uncertain parameters fitted, no effect sought; the RMS error on held-out trials in words; and notices."""
    settings = settings or Settings()
    bench = prepare(recording, twin.robot)
    bench, alone = without_spikes(bench, _predict_all(twin, bench))
    fitted, held = split(bench, settings.seed)
    start, objective, _ = objective_of(bench, twin, fitted, settings)
    found = fit(objective, start, refresh=True)
    held_out = HeldOut(bench, held, objective.whitener.noise)
    unit, factor = UNIT[held_out.headline]
    return found, f"{factor * held_out.error(found.model.twin):.3f} {unit}", (*bench.notices, *alone)


def _gate(
    objective: Objective, evidence: Evidence, found: Search, held_out: HeldOut, bar: float, progress: Progress
) -> tuple[Weighed, dict[str, Weighed], tuple[Claim, ...]]:
    """Drop, smallest first: effects below the materiality `bar` (sigma), those that may be what a much larger one's law gets wrong,
    and those of several without which unseen trials do better.

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
            dropped[e] = refit_without(objective, evidence, found.base, best, e)
        if not dropped:
            return best, {}, tuple(small)
        moved = {e: _contribution(best, w, objective) for e, w in dropped.items()}
        least = min(moved, key=lambda e: moved[e])
        beside_large = moved[least] < FORM * max(moved.values()) and not _takes_most(held_out, best, dropped[least])
        if moved[least] < bar or beside_large:
            small.append(Claim(least, best.fit.fitted(least), float("nan"), 0.0, moved[least]))
            best = dropped[least]
            continue
        harmful = [e for e in moved if len(moved) > 1 and _worse(held_out, best, dropped[e])]
        if not harmful:
            return best, dropped, tuple(small)
        best = dropped[min(harmful, key=lambda e: moved[e])]


def _takes_most(held_out: HeldOut, with_effect: Weighed, without: Weighed) -> bool:
    """Whether an effect explains half of all that is left without it, on unseen trials too: a large law's faults leave more."""
    try:
        sizes = [(w.discrepancy.size, held_out.structure(w.fit.model.twin)[0]) for w in (with_effect, without)]
    except SolveError:
        return False
    return all(after <= HALF * before for after, before in zip(*sizes, strict=True))


def _worse(held_out: HeldOut, with_effect: Weighed, without: Weighed) -> bool:
    """On unseen trials; where one of the two has no equilibrium there, it is not said."""
    twins = [w.fit.model.twin for w in (with_effect, without)]
    return all(np.isfinite(held_out.error(t)) for t in twins) and held_out.worse(*twins)


def _accuracy(bench: Bench, noise: Noise, accuracy: float) -> float:
    """The twin's own accuracy (m; rad) in sigmas of the markers, or of the jaw's angle: no less can be claimed."""
    sigma = np.array([s for s, o in zip(noise.sigma, bench.outputs, strict=True) if o.group in ("marker", "angle")])
    return accuracy / float(np.mean(sigma)) if sigma.size else 0.0


def _contribution(best: Weighed, without: Weighed, objective: Objective) -> float:
    """How far (sigma RMS) dropping an effect and refitting everything else moves the fitted trials."""
    fall = float(without.fit.z @ without.fit.z - best.fit.z @ best.fit.z)
    return float(np.sqrt(max(0.0, fall) / objective.n))


def _verdict(
    added: tuple[str, ...], before: float, after: float, unseen: float, line: float, bars: Thresholds, strange: bool, halved: bool
) -> str:
    """From the smooth errors (sigma) before and after on the fitted trials, and after on the unseen ones.

    `strange`: what is left sits at one place of the body, the calibrated error began at once, as that of no known effect does, or
    a law is at its limit. `halved`: the effects take half of the error.
    """
    much = max(after, unseen) > max(MUCH, bars.left) or line > bars.line
    if not added:
        return "unexplained" if much or line > bars.faint or after > max(ALONE, bars.left) else "noise"
    if not much and not (after > bars.left and after > SHARE * before):
        return "partly_explained" if strange else "explained"
    return "partly_explained" if halved else "unexplained"


def _probability(found: Search, effect: str, small: set[str]) -> float:
    """Share of the tempered weight exp(score / 20) of sets with the effect; sets with a `small`, immaterial one do not count."""
    material = [w for w in found.all if not small & set(w.effects)]
    top = max(w.score for w in material)
    weights = np.array([np.exp((w.score - top) / TEMPER) for w in material])
    inside = np.array([effect in w.effects for w in material])
    return float(weights[inside].sum() / weights.sum())


def _predicting(found: Search, bench: Bench, accept: float) -> Weighed:
    """The best set that every trial, fitted or held out, can be predicted with."""
    ranked = [found.best, *sorted(found.all, key=lambda w: accept * len(w.effects) - w.score)]
    return next((w for w in ranked if _solves(w.fit.model.twin, bench)), found.base)


def _most_predictive(found: Search, objective: Objective, held_out: HeldOut) -> Weighed | None:
    """Of the sets whose every effect halves the squared error on trials left out in turn, the one that errs least there.

    Where laws and robot are far from the data, what no law follows is smooth, and to the evidence a smooth error costs the same
    small or large: its names are worth little. What an effect predicts does not depend on that.
    """
    errors = {w.effects: left_out(objective, w.fit) / HALF ** len(w.effects) for w in (found.base, *found.all)}
    better = [w for w in found.all if errors[w.effects] < errors[found.base.effects]]
    ranked = sorted(better, key=lambda w: errors[w.effects])
    return next((w for w in ranked if _halved(objective, held_out, found.base, w)), None)


def _beside(
    core: Weighed, found: Search, objective: Objective, evidence: Evidence, bench: Bench, bars: Thresholds, progress: Progress
) -> Search:
    """What else there is, sought as beside any base: converged first, and nothing of it is dropped."""
    converged = fit(objective, core.fit.model, near=core.fit.evaluation, refresh=True)
    core = weigh(objective, evidence, converged)
    around = search(objective, evidence, core, dictionary(objective, converged), bars, progress)
    best = around.best if _solves(around.best.fit.model.twin, bench) else core
    known = {w.effects: w for w in (*found.all, *around.all)}
    return Search(found.base, best, tuple(sorted(known.values(), key=lambda w: -w.score)))


def _halved(objective: Objective, held_out: HeldOut, base: Weighed, best: Weighed) -> bool:
    """Whether effects halve the smooth error; or the squared error on trials left out in turn, and on the unseen ones."""
    if best.discrepancy.size <= HALF * base.discrepancy.size:
        return True
    if left_out(objective, best.fit) > HALF * left_out(objective, base.fit):
        return False
    return held_out.error(best.fit.model.twin) ** 2 <= HALF * held_out.error(base.fit.model.twin) ** 2


def _solves(twin: Twin, bench: Bench) -> bool:
    """A stiff wall may leave a held-out trial no equilibrium, and a fitted one one that only its neighbours in the fit lead to."""
    try:
        simulate(twin, bench)
    except SolveError:
        return False
    return True


def _predict_all(twin: Twin, bench: Bench) -> list[np.ndarray]:
    return [readings(bench, report(twin.effects, t.true)) for t in simulate(twin, bench)]


def _runners_up(found: Search, claimed: set[str], own: tuple[str, ...], small: set[str], held_out: HeldOut) -> tuple[Claim, ...]:
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
