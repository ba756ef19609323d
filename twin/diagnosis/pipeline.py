"""The diagnosis: find what the twin lacks, how sure that is, and the error before and after on held-out trials.

thin -> preview -> calibrate -> screen -> search -> choose -> lag_or_delay -> gate -> resolve_ties -> judge -> systematic ->
describe, all on the fitted trials; then the errors on the held-out trials.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from twin.diagnosis.calibration.calibrate import calibrate
from twin.diagnosis.calibration.fast_motion import fast_motion
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.checks.loops import loops
from twin.diagnosis.checks.preview import DataPreview, preview_data
from twin.diagnosis.checks.spikes import without_spikes
from twin.diagnosis.checks.zero_jumps import jumps_of, without_zero_jumps
from twin.diagnosis.checks.zero_jumps import words as jumped
from twin.diagnosis.conclusion import Conclusion
from twin.diagnosis.diagnosis import Claim, Diagnosis, Errors, Fold, Settings
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.explain.describe import describe
from twin.diagnosis.explain.next_experiment import Experiment, next_experiment
from twin.diagnosis.fit_context import FitContext, Progress, silent
from twin.diagnosis.held_out import HeldOut, predicted
from twin.diagnosis.search.choose import choose
from twin.diagnosis.search.lag_or_delay import lag_or_delay
from twin.diagnosis.search.screen import Screening, screen
from twin.diagnosis.search.search import Search, search
from twin.diagnosis.split import blind, split
from twin.diagnosis.thinning import thinned
from twin.diagnosis.thinning import words as thinning_words
from twin.diagnosis.thresholds import FEWEST_TRIALS_FOR_HELD_OUT, ROWS_FOR_ZERO
from twin.diagnosis.verdict.gate import Gated, gate
from twin.diagnosis.verdict.judge import Judgement, judge, withdraw
from twin.diagnosis.verdict.resolve_ties import resolve_ties
from twin.diagnosis.verdict.systematic import with_systematic
from twin.foundation.display_names import display_name
from twin.foundation.errors import DataError
from twin.foundation.parallel import single_thread
from twin.measurements import Recording
from twin.prediction.evaluate import OUTPUT_GROUPS, headline_group, rms
from twin.prediction.motion import in_steps_that_suffice, motion_as_measured, moving_like
from twin.prediction.own_clocks import on_rows_of_outputs
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.twin import Twin

SWINGING = "commands are so fast that shapes swing: what steps of the robot add to its statics is part of each prediction"
OnPreview = Callable[[DataPreview], None]


def ignore_preview(preview: DataPreview) -> None:
    """Ignore the preview; the diagnosis contains all of it."""


def diagnose(
    recording: Recording,
    twin: Twin | None = None,
    settings: Settings | None = None,
    progress: Progress = silent,
    on_preview: OnPreview = ignore_preview,
) -> Diagnosis:
    """Diagnose a recording against a twin, by default the robot that the recording names, as described.

    About a quarter of the trials is held out. With fewer than `FEWEST_TRIALS_FOR_HELD_OUT` trials each is held out in turn, and the
    claims come from a fit to all of them. `on_preview` is called before any fit, with suspected mistakes in the files and with
    loops; no number depends on it. Raise TwinError for data that cannot be used.
    """
    settings, twin = settings or Settings(), twin or Twin.of_recording(recording)
    log = on_rows_of_outputs(recording)
    whole = prepare(log, twin.robot)
    if len(whole.inputs) < 2:
        raise DataError(f"{recording.title}: a diagnosis needs at least two trials, one to fit and one to hold out")
    part, every = thinned(log, whole, settings.budget)
    with single_thread():
        prepared, twin = in_steps_that_suffice(whole if every == 1 else prepare(part, twin.robot), twin)
        preview = preview_data(prepared, twin, settings, progress)
        on_preview(preview)
        found, held_out = _held_out_diagnosis(recording, preview, twin, settings, progress)
        if every == 1:
            return found
        whole = moving_like(whole, found.prepared, found.twin)
        return replace(found, notices=(*found.notices, thinning_words(log, every, *held_out.in_all_rows(whole))))


def _held_out_diagnosis(
    recording: Recording, preview: DataPreview, twin: Twin, settings: Settings, progress: Progress
) -> tuple[Diagnosis, HeldOut]:
    n = len(preview.prepared.inputs)
    prepared, nominal = preview.prepared, preview.nominal
    if n >= FEWEST_TRIALS_FOR_HELD_OUT:
        found = conclude(prepared, twin, preview.held_out, nominal, settings, progress)
        return _reported(recording, preview, found, [(found, preview.held_out)], settings)
    parts, share = [], replace(settings, budget=settings.budget and settings.budget / (n + 1))
    for k in range(n):

        def report_fold(words: str, k: int = k) -> None:
            progress(f"{n} trials, each held out in turn, {k + 1} of {n}: {words}")

        parts.append((conclude(prepared, twin, [k], nominal, share, report_fold), [k]))
    found = conclude(prepared, twin, [], nominal, share, lambda words: progress(f"all {n} trials: {words}"))
    return _reported(recording, preview, found, parts, settings)


def conclude(
    prepared: PreparedRecording,
    twin: Twin,
    held_out: Sequence[int],
    nominal: Sequence[np.ndarray],
    settings: Settings,
    progress: Progress,
) -> Conclusion:
    """Run all stages without the measurements of the held-out trials.

    Fast motion is predicted by what steps of one robot add to statics: of the calibrated one, where that is nearer to the data than
    the robot as described, and once more of the twin that was found, where that does not explain them.
    """
    calibrated = calibrate(prepared, twin, held_out, nominal, settings, progress)
    again = fast_motion(calibrated[0], calibrated[1], prepared) if settings.budget is None else None
    if again is not None:
        calibrated = calibrate(again, calibrated[1].fit.model.twin, held_out, nominal, settings, progress)
    found = _concluded(*calibrated, settings)
    if settings.budget is None and found.judged.verdict not in ("noise", "explained"):
        again = fast_motion(found.context, found.judged.final, prepared)
        if again is not None:
            found = _concluded(*calibrate(again, found.base, held_out, nominal, settings, progress), settings)
    return found


def _concluded(context: FitContext, base: ScoredModel, notes: Sequence[str], settings: Settings) -> Conclusion:
    screening = screen(context, base, settings.seed)
    found, gated, judged = decide(context, base, screening)
    words = (*notes, *_swing_words(context.prepared), *context.budget.words())
    return Conclusion(context, screening, found, gated, judged, words)


def _swing_words(prepared: PreparedRecording) -> tuple[str, ...]:
    return (SWINGING,) if any(i.swing is not None for i in prepared.inputs) else ()


def decide(context: FitContext, base: ScoredModel, screening: Screening) -> tuple[Search, Gated, Judgement]:
    """Return what the search found beside the calibrated `base`, what passed the gate, and the judgement of it."""
    found = choose(context, search(context, base, screening.patterns, screening.limits), screening.limits)
    found = lag_or_delay(context, found)
    found, gated = resolve_ties(context, found, gate(context, found, screening), screening.limits)
    return found, gated, with_systematic(context, judge(context, found, gated, screening.limits), screening.patterns)


def _reported(
    recording: Recording,
    preview: DataPreview,
    found: Conclusion,
    parts: Sequence[tuple[Conclusion, Sequence[int]]],
    settings: Settings,
) -> tuple[Diagnosis, HeldOut]:
    """Assemble the diagnosis; each held-out trial is predicted by a conclusion that was not fitted to it.

    Claims that do not reduce the error on held-out trials are withdrawn.
    """
    held_out = HeldOut.of(preview.prepared, preview.nominal, parts)
    errors = held_out.errors(settings.seed)
    if not found.judged.claims or errors.improved:
        return _doubted(_diagnosis(recording, preview, found, parts, settings, (held_out, errors))), held_out
    words = _withdrawal_words(found, errors)
    found, parts = _withdrawn(found), [(_withdrawn(c), trials) for c, trials in parts]
    held_out = HeldOut.of(preview.prepared, preview.nominal, parts)
    calibrated = _diagnosis(recording, preview, found, parts, settings, (held_out, held_out.errors(settings.seed)))
    return replace(calibrated, caveats=(words, *calibrated.caveats)), held_out


def _doubted(found: Diagnosis) -> Diagnosis:
    """Return the diagnosis with the held-out trials that it misses as a caveat; then the data are not explained.

    Unless each trial was held out in turn: the final twin was fitted to all of them. Where the fitted trials are not explained
    either, a missed one says nothing new.
    """
    if not found.errors.missed or found.verdict not in ("noise", "explained"):
        return found
    label = {t.name: t.label for t in found.prepared.recording.trials}
    each = []
    for m in found.errors.missed:
        shown = OUTPUT_GROUPS[m.group]
        off, floor = (f"{shown.factor * x:.2g} {shown.unit}" for x in (m.error, m.floor))
        each.append(f"{label[found.prepared.inputs[m.trial].name]} by {off} in {display_name(shown.kind)} (noise floor {floor})")
    words = f"it misses held-out {', '.join(each)}: the fitted trials do not show everything that happens there"
    lowered = "partly_explained" if found.claims else "unexplained"
    return replace(found, verdict=found.verdict if found.folds else lowered, caveats=(*found.caveats, words))


def _diagnosis(
    recording: Recording,
    preview: DataPreview,
    found: Conclusion,
    parts: Sequence[tuple[Conclusion, Sequence[int]]],
    settings: Settings,
    measured_by: tuple[HeldOut, Errors],
) -> Diagnosis:
    """Assemble a diagnosis from a conclusion and the errors on held-out trials."""
    (held_out, errors), prepared, nominal = measured_by, preview.prepared, preview.nominal
    context, judged, limits = found.context, found.judged, found.screening.limits
    final, base = judged.final, found.found.base
    left = describe(context, found.found, found.gated, judged, limits)
    measured = [y if k in context.trials else held_out.prepared.measured[k] for k, y in enumerate(context.prepared.measured)]
    folds = tuple(Fold(trials[0], c.judged.verdict, tuple(x.effect for x in c.judged.claims)) for c, trials in parts)
    return Diagnosis(
        verdict=judged.verdict,
        twin=without_zero_jumps(found.final),
        calibrated=without_zero_jumps(found.base),
        claims=tuple(replace(c, error=held_out.error(lambda x, e=c.effect: x.without(e))) for c in judged.claims),
        runners_up=tuple(
            replace(c, error=held_out.error(lambda x, s=(c.effect, *c.beside): x.weighed(s))) for c in judged.runners_up
        ),
        below_materiality=tuple(
            Claim(s.effect, s.fitted.fit.fitted(s.effect), float("nan"), 0.0, s.contribution) for s in found.gated.small
        ),
        parameters={
            **final.fit.fitted(None),
            **{f"{e}.{p.name}": final.fit.fitted(e)[p.name] for e, p in prepared.robot.uncertain},
        },
        unfixed=tuple(final.fit.unfixed()),
        correlation=final.fit.correlation(),
        errors=errors,
        noise=context.objective.whitener.noise,
        structure_before=base.discrepancy.size,
        structure_after=final.discrepancy.size,
        structure_unseen=judged.signs.unseen,
        limits=limits,
        structure=left.components,
        strongest=left.strongest,
        line=judged.signs.line,
        worst_channel=left.worst_channel,
        description=left.words,
        caveats=judged.signs.caveats,
        identifiability=found.screening.table,
        ambiguous=judged.ambiguous,
        experiment=_experiment(found, settings),
        recording=recording,
        prepared=replace(prepared, inputs=context.prepared.inputs, measured=tuple(measured)),
        fitted_trials=tuple(context.trials),
        held_out_trials=tuple(held_out.trials),
        folds=folds if len(parts) > 1 else (),
        loops=loops(context.prepared),
        suspicions=preview.suspicions,
        predictions=_predictions(found, held_out, nominal),
        notices=(*prepared.notices, *found.notices, *jumped(prepared, final.fit), *_rezeroed(found, held_out), *left.notices),
        settings=settings,
        scores=tuple((w.effects, w.score) for w in found.found.all),
        untried=tuple(context.budget.untried),
    )


def _withdrawn(found: Conclusion) -> Conclusion:
    """Return the conclusion without its claims."""
    return replace(found, judged=withdraw(found.context, found.found, found.judged)) if found.judged.claims else found


def _withdrawal_words(found: Conclusion, errors: Errors) -> str:
    """Return why claims are withdrawn."""
    group = headline_group(errors.after)
    unit, factor = OUTPUT_GROUPS[group].unit, OUTPUT_GROUPS[group].factor
    names = " and ".join(display_name(c.effect) for c in found.judged.claims)
    with_it, without = (f"{factor * e[group]:.3g} {unit}" for e in (errors.after, errors.calibrated))
    return (
        f"{names} explained the fitted trials and is not claimed: on held-out trials the twin with it ({with_it}) is no better "
        f"than the calibrated one ({without})"
    )


def _rezeroed(found: Conclusion, held_out: HeldOut) -> Iterator[str]:
    """Yield, for zeros that jump, the held-out error with the fitted zeros and with each trial's own."""
    for group in dict.fromkeys(j.group for j in jumps_of(found.final)):
        unit, factor = OUTPUT_GROUPS[group].unit, OUTPUT_GROUPS[group].factor
        fitted, own = (factor * e for e in held_out.rezeroed(group))
        yield (
            f"held-out trials, {OUTPUT_GROUPS[group].kind}: {fitted:.3g} {unit} with the fitted zeros, "
            f"{own:.3g} {unit} with each trial's zero from its own first {ROWS_FOR_ZERO} rows; the first counts"
        )


def _experiment(found: Conclusion, settings: Settings) -> Experiment | None:
    """Return the experiment that would separate ambiguous candidates; None where nothing is ambiguous."""
    judged, context = found.judged, found.context
    ambiguous = judged.ambiguous or (judged.verdict != "noise" and judged.runners_up)
    if not ambiguous or judged.between is None:
        return None
    context.progress("next experiment")
    a, b = judged.between
    return next_experiment(context.prepared, context.objective.whitener.noise, a.fit, b.fit, settings.jobs)


def _predictions(found: Conclusion, held_out: HeldOut, nominal: Sequence[np.ndarray]) -> dict[str, list[np.ndarray]]:
    """Return every trial's prediction by stage; held-out trials by a twin that was not fitted to them."""
    out = {"nominal": list(nominal)}
    for name, pick in (("calibrated", lambda c: c.base), ("after", lambda c: c.final)):
        unseen = held_out.predictions(pick)
        open_ = [k for k in range(len(nominal)) if k not in unseen]
        seen = dict(zip(open_, predicted(pick(found), found.context.prepared, open_), strict=True))
        out[name] = [(unseen | seen)[k] for k in range(len(nominal))]
    return out


def calibrate_twin(recording: Recording, twin: Twin | None = None, settings: Settings | None = None) -> Twin:
    """Return the twin with the robot's own uncertain parameters fitted to the recording, without a search for effects.

    The default is the robot that the recording names. About a quarter of the trials is held out of the fit. Raises as `diagnose`.
    """
    fitted, _, _ = calibrated_fit(recording, twin or Twin.of_recording(recording), settings)
    return fitted.model.twin


def calibrated_fit(recording: Recording, twin: Twin, settings: Settings | None = None) -> tuple[Fit, str, tuple[str, ...]]:
    """Fit the robot's own uncertain parameters, without a search for effects.

    Return the fit, the RMS error on held-out trials in words, and notices.
    """
    settings = settings or Settings()
    log = on_rows_of_outputs(recording)
    whole = prepare(log, twin.robot)
    part, every = thinned(log, whole, settings.budget)
    prepared, twin = in_steps_that_suffice(whole if every == 1 else prepare(part, twin.robot), twin)
    as_described = predicted(twin, prepared, list(range(len(prepared.inputs))))
    fitted, held_out = split(prepared, settings.seed)
    prepared, nominal = motion_as_measured(prepared, twin, as_described, fitted, settings.budget is None)
    whole = prepared if every == 1 else moving_like(whole, prepared, twin)
    seen, alone = without_spikes(blind(prepared, held_out), nominal)
    start, objective, _ = objective_of(seen, twin, fitted, settings)
    found = fit(objective, start, refresh=True)
    unseen, _ = without_spikes(blind(prepared, fitted), nominal)
    group = headline_group(o.group for o in prepared.outputs)
    unit, factor = OUTPUT_GROUPS[group].unit, OUTPUT_GROUPS[group].factor
    errors = []
    for of in (unseen, whole):
        raw = [of.measured[k] - y for k, y in zip(held_out, predicted(found.model.twin, of, held_out), strict=True)]
        errors.append(factor * rms(of, raw, group))
    words = () if every == 1 else (thinning_words(log, every, errors[0], errors[1], unit),)
    return found, f"{errors[0]:.3f} {unit}", (*prepared.notices, *alone, *_swing_words(prepared), *words)
