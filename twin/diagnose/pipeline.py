"""The main job: from a recording to what the twin lacks, how sure that is, and the error before and after on sealed trials.

look -> calibrate -> screen -> search -> choose -> lateness -> gate -> judge -> systematic -> describe, all on the fitted trials;
then the seal is opened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from twin.bench import Bench, prepare
from twin.calibrate import Fit, fit
from twin.diagnose.calibrate import calibrate
from twin.diagnose.choose import choose
from twin.diagnose.conclusion import Conclusion
from twin.diagnose.describe import describe
from twin.diagnose.diagnosis import Claim, Diagnosis, Fold, Settings
from twin.diagnose.experiment import Experiment, next_experiment
from twin.diagnose.gate import gate
from twin.diagnose.judge import judge
from twin.diagnose.lateness import lateness
from twin.diagnose.look import Looked, looked_at
from twin.diagnose.loops import loops
from twin.diagnose.objective import objective_of
from twin.diagnose.screen import screen
from twin.diagnose.seal import Opened, predicted
from twin.diagnose.search import search
from twin.diagnose.settle import settle
from twin.diagnose.spikes import without_spikes
from twin.diagnose.split import blind, split
from twin.diagnose.study import Progress, silent
from twin.diagnose.systematic import with_systematic
from twin.diagnose.thresholds import FEW, FIRST
from twin.diagnose.zeros import jumps_of, lasting
from twin.diagnose.zeros import words as jumped
from twin.errors import DataError
from twin.evaluate import KIND, UNIT, headline, rms
from twin.measurements import Recording
from twin.shape.under_hand import under_hand
from twin.threads import single_thread
from twin.twin import Twin

Hear = Callable[[Looked], None]


def unheard(looked: Looked) -> None:
    """Nobody listens; all of it stands in the diagnosis."""


def diagnose(
    recording: Recording, twin: Twin, settings: Settings | None = None, progress: Progress = silent, hear: Hear = unheard
) -> Diagnosis:
    """Diagnose a recording against a twin. Raises TwinError for data that cannot be used.

    What was seen before anything is fitted is told to `hear`: what the files may mean otherwise, and loops; no number depends on
    it.

    About a quarter of the trials is sealed; of fewer than `FEW` trials each in turn, the claims coming from all of them.
    """
    settings = settings or Settings()
    bench = prepare(recording, twin.robot)
    if len(bench.inputs) < 2:
        raise DataError(f"{recording.title}: a diagnosis needs at least two trials, one to fit and one sealed")
    with single_thread():
        looked = looked_at(bench, twin, settings, progress)
        hear(looked)
        return _by_hand(recording, _sealed(looked, twin, settings, progress))


def _sealed(looked: Looked, twin: Twin, settings: Settings, progress: Progress) -> Diagnosis:
    n = len(looked.bench.inputs)
    bench, nominal = looked.bench, looked.nominal
    if n >= FEW:
        found = conclude(bench, twin, looked.sealed, nominal, settings, progress)
        return _reported(looked, twin, found, [(found, looked.sealed)], settings)
    parts, share = [], replace(settings, budget=settings.budget and settings.budget / (n + 1))
    for k in range(n):

        def told(words: str, k: int = k) -> None:
            progress(f"{n} trials, each sealed in turn and the others diagnosed, {k + 1} of {n}: {words}")

        parts.append((conclude(bench, twin, [k], nominal, share, told), [k]))
    found = conclude(bench, twin, [], nominal, share, lambda words: progress(f"all {n} trials: {words}"))
    return _reported(looked, twin, found, parts, settings)


def _by_hand(recording: Recording, found: Diagnosis) -> Diagnosis:
    """What trials under a hand, which nothing was fitted to, say of the sensors that the diagnosis speaks of."""
    try:
        return replace(found, under_hand=under_hand(recording, found.calibrated, found.twin))
    except DataError as error:
        return replace(found, notices=(*found.notices, f"trials under a hand say nothing of the sensors: {error}"))


def conclude(
    bench: Bench, twin: Twin, sealed: Sequence[int], nominal: Sequence[np.ndarray], settings: Settings, progress: Progress
) -> Conclusion:
    """Everything a diagnosis decides, without what was measured on the sealed trials."""
    study, base, notes = calibrate(bench, twin, sealed, nominal, settings, progress)
    screening = screen(study, base, settings.seed)
    found = choose(study, search(study, base, screening.patterns, screening.bars), screening.bars)
    found = lateness(study, found)
    found, gated = settle(study, found, gate(study, found, screening), screening.bars)
    judged = with_systematic(study, judge(study, found, gated, screening.bars), screening.patterns)
    return Conclusion(study, screening, found, gated, judged, (*notes, *study.budget.words()))


def _reported(
    looked: Looked, twin: Twin, found: Conclusion, parts: Sequence[tuple[Conclusion, Sequence[int]]], settings: Settings
) -> Diagnosis:
    """All that is said of `found`, the seal unopened; then the errors, by the conclusions that had not seen each trial."""
    bench, nominal = looked.bench, looked.nominal
    study, judged, bars = found.study, found.judged, found.screening.bars
    final, base = judged.final, found.found.base
    seen = loops(study.bench)
    said = describe(study, found.found, found.gated, judged, bars)
    experiment = _experiment(found, settings)
    opened = Opened.of(bench, nominal, parts)
    measured = [y if k in study.trials else opened.bench.measured[k] for k, y in enumerate(study.bench.measured)]
    folds = tuple(Fold(trials[0], c.judged.verdict, tuple(x.effect for x in c.judged.claims)) for c, trials in parts)
    return Diagnosis(
        verdict=judged.verdict,
        twin=lasting(found.final),
        calibrated=lasting(found.base),
        claims=tuple(replace(c, error=opened.error(lambda x, e=c.effect: x.without(e))) for c in judged.claims),
        runners_up=tuple(
            replace(c, error=opened.error(lambda x, s=(c.effect, *c.beside): x.weighed(s))) for c in judged.runners_up
        ),
        below_materiality=tuple(
            Claim(s.effect, s.fitted.fit.fitted(s.effect), float("nan"), 0.0, s.contribution) for s in found.gated.small
        ),
        parameters={**final.fit.fitted(None), **{f"{e}.{p.name}": final.fit.fitted(e)[p.name] for e, p in bench.robot.uncertain}},
        unfixed=tuple(final.fit.unfixed()),
        correlation=final.fit.correlation(),
        errors=opened.errors(settings.seed),
        noise=study.objective.whitener.noise,
        structure_before=base.discrepancy.size,
        structure_after=final.discrepancy.size,
        structure_unseen=judged.signs.unseen,
        bars=bars,
        structure=said.components,
        strongest=said.strongest,
        line=judged.signs.line,
        worst_channel=said.worst_channel,
        description=said.words,
        identifiability=found.screening.table,
        ambiguous=judged.ambiguous,
        experiment=experiment,
        bench=replace(bench, measured=tuple(measured)),
        fitted_trials=tuple(study.trials),
        sealed_trials=tuple(opened.trials),
        folds=folds if len(parts) > 1 else (),
        loops=seen,
        suspicions=looked.suspicions,
        predictions=_predictions(bench, found, opened, nominal),
        notices=(*bench.notices, *found.notices, *jumped(bench, final.fit), *_anew(found, opened), *said.notices),
        settings=settings,
        scores=tuple((w.effects, w.score) for w in found.found.all),
        untried=tuple(study.budget.untried),
    )


def _anew(found: Conclusion, opened: Opened) -> Iterator[str]:
    """Where zeros jump, the sealed trials' error with those that were fitted, and with each trial's own."""
    for group in dict.fromkeys(j.group for j in jumps_of(found.final)):
        unit, factor = UNIT[group]
        fitted, own = (factor * e for e in opened.rezeroed(group))
        yield (
            f"sealed trials, {KIND[group]}: {fitted:.3g} {unit} with the zeros that were fitted, {own:.3g} {unit} where each "
            f"trial's is taken from its own first {FIRST} rows; the first counts"
        )


def _experiment(found: Conclusion, settings: Settings) -> Experiment | None:
    """What would settle a doubt, where there is one."""
    judged, study = found.judged, found.study
    doubt = judged.ambiguous or (judged.verdict != "noise" and judged.runners_up)
    if not doubt or judged.between is None:
        return None
    study.progress("next experiment")
    a, b = judged.between
    return next_experiment(study.bench, study.objective.whitener.noise, a.fit, b.fit, settings.jobs)


def _predictions(bench: Bench, found: Conclusion, opened: Opened, nominal: Sequence[np.ndarray]) -> dict[str, list[np.ndarray]]:
    """By stage, every trial by the twin that had to predict it."""
    out = {"nominal": list(nominal)}
    for name, pick in (("calibrated", lambda c: c.base), ("after", lambda c: c.final)):
        unseen = opened.predictions(pick)
        open_ = [k for k in range(len(bench.inputs)) if k not in unseen]
        seen = dict(zip(open_, predicted(pick(found), bench, open_), strict=True))
        out[name] = [(unseen | seen)[k] for k in range(len(bench.inputs))]
    return out


def calibration(recording: Recording, twin: Twin, settings: Settings | None = None) -> tuple[Fit, str, tuple[str, ...]]:
    """The robot's own uncertain parameters fitted, no effect sought; the RMS error on sealed trials in words; and notices."""
    settings = settings or Settings()
    bench = prepare(recording, twin.robot)
    every = list(range(len(bench.inputs)))
    nominal = predicted(twin, bench, every)
    fitted, sealed = split(bench, settings.seed)
    seen, alone = without_spikes(blind(bench, sealed), nominal)
    start, objective, _ = objective_of(seen, twin, fitted, settings)
    found = fit(objective, start, refresh=True)
    opened, _ = without_spikes(blind(bench, fitted), nominal)
    raw = [opened.measured[k] - y for k, y in zip(sealed, predicted(found.model.twin, bench, sealed), strict=True)]
    group = headline(o.group for o in bench.outputs)
    unit, factor = UNIT[group]
    return found, f"{factor * rms(bench, raw, group):.3f} {unit}", (*bench.notices, *alone)
