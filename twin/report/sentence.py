"""The verdict in one plain sentence, and the names it uses."""

from __future__ import annotations

import math

from twin import evaluate
from twin.diagnose import Claim, Diagnosis
from twin.diagnose.evidence import IN_WORDS
from twin.effects import named
from twin.evaluate import KIND
from twin.report.numbers import SHOWN, number, percent, places, plus_minus
from twin.wording import in_words

MOST = 3  # parameters of an effect named in a sentence
SURE = 0.9  # probability below which what a lone claim cannot be told from is named as well as it
MISSED = 2.0  # times the noise floor: what noise alone leaves of a trial of ten rows stays below it


def headline(diagnosis: Diagnosis) -> str:
    """The group of outputs whose error stands for the twin."""
    return evaluate.headline(diagnosis.errors.after)


def groups(diagnosis: Diagnosis) -> list[str]:
    """The groups of outputs, the headline first."""
    return sorted(diagnosis.errors.after, key=lambda g: g != headline(diagnosis))


def structure_left(diagnosis: Diagnosis) -> str | None:
    """What the remaining error moves with, in words; None where only noise is left."""
    if diagnosis.verdict in ("noise", "explained"):
        return None
    sizes = diagnosis.structure
    if diagnosis.line[0] > diagnosis.bars.faint and max(sizes.values(), default=0.0) < diagnosis.bars.left:
        return f"a line at {diagnosis.line[1]:.2f} Hz"
    return IN_WORDS[max(sizes, key=lambda c: sizes[c])]


def explained_share(diagnosis: Diagnosis) -> float | None:
    """Share (0 to 1) of the structured error (sigmas) that the effects in force remove; None where there is none to explain."""
    before, after = diagnosis.structure_before, diagnosis.structure_after
    return None if not before > 0.05 else min(1.0, max(0.0, 1.0 - after / before))


def claim_words(claim: Claim) -> str:
    """As in "tendon friction, mu = 0.1030 ± 0.0013": the parameters that make the effect, those of its shape left out. Of many of
    one kind, one a sensor, say, those that are surest not to be off."""
    law = named(claim.effect)
    main = [n for n in claim.parameters if n not in law.shape] or list(claim.parameters)
    off = {p.name: p.value for p in law.per_tendon}
    kinds = {n.rpartition("_")[0] for n in main}
    shown = main[:MOST]
    if len(kinds) == 1 and kinds <= set(off):
        level = off[kinds.pop()]
        surest = sorted(main, key=lambda n: -abs(claim.parameters[n].value - level) / (claim.parameters[n].std or math.inf))
        shown = [n for n in main if n in surest[:MOST]]
    words = [f"{n.replace('_', ' ')} = {plus_minus(claim.parameters[n])}" for n in shown]
    rest = f" and {len(main) - MOST} more" if len(main) > MOST else ""
    return ", ".join([in_words(claim.effect), *words]) + rest


def rivals(diagnosis: Diagnosis) -> list[str]:
    """Other explanations within the accuracy of the evidence, in words: sets that do not contain what is claimed."""
    claimed = {c.effect for c in diagnosis.claims}
    others = [effects for effects in diagnosis.ambiguous if not claimed or not claimed <= set(effects)]
    return [" with ".join(in_words(e) for e in effects) for effects in others]


def needs(lacking: tuple[str, ...]) -> str:
    """What would show an effect that a design cannot."""
    return f"needs {' and '.join(lacking)}" if lacking else "nothing measured here answers to it"


def blind(diagnosis: Diagnosis) -> str | None:
    """The effects that these data cannot show at any size, with what they lack; None where they can show all."""
    lacking: dict[tuple[str, ...], list[str]] = {}
    shown = {v.effect for v in diagnosis.identifiability if math.isfinite(v.seen)}
    for effect, why in dict.fromkeys((v.effect, v.lacking) for v in diagnosis.identifiability if v.effect not in shown):
        lacking.setdefault(why, []).append(in_words(effect))
    words = [f"{', '.join(names)} ({needs(why)})" for why, names in lacking.items()]
    return f"These data cannot show: {'; '.join(words)}." if words else None


def sentence(diagnosis: Diagnosis) -> str:
    """The verdict, what it rests on, and the error on sealed trials."""
    return f"{verdict_words(diagnosis)}{untried_words(diagnosis)} {error_words(diagnosis)}"


def untried_words(diagnosis: Diagnosis) -> str:
    """What the budget left no time for; nothing where all was tried."""
    names = [" ".join(in_words(word) for word in name.split()) for name in diagnosis.untried]
    if not names:
        return ""
    rest = f" and {len(names) - MOST} more" if len(names) > MOST else ""
    return f" The budget ended the search before {', '.join(names[:MOST])}{rest}."


def verdict_words(diagnosis: Diagnosis) -> str:
    """The verdict and what it rests on: all of it from trials that were not sealed."""
    d = diagnosis
    left, others = structure_left(d), rivals(d)
    if not d.claims:
        start = (
            "No missing effect: after calibration only noise is left."
            if d.verdict == "noise"
            else f"Unexplained: after calibration a structured error of {d.structure_before:.2f} sigma is left that no "
            f"{'effect tried' if d.untried else 'known effect'} may claim; it moves mostly with {left}."
        )
        alike = f" It could be {' or '.join(others[:2])}: these data cannot tell which, so neither is claimed." if others else ""
        return start + alike
    many = len(d.claims) > 1
    start = "Partly explained" if d.verdict == "partly_explained" else f"Missing effect{'s' if many else ''}"
    names = " and ".join(claim_words(c) for c in d.claims)
    share = explained_share(d)
    they = "Together they explain" if many else "It explains"
    explains = "" if share is None else f" {they} {percent(share)} of the structured error."
    doubt = f" These data cannot tell {'them' if many else 'it'} from {' or '.join(others[:2])}." if others else ""
    if others and not many and d.claims[0].probability < SURE:
        names = f"{' or '.join((in_words(d.claims[0].effect), *others[:2]))}, these data cannot tell which. The twin has {names}"
        doubt = ""
    little = left and d.structure_after <= d.bars.left and d.line[0] <= d.bars.faint
    rest = " Little is left, but something speaks against it: see what is left, and the notices." if little else ""
    rest = f" What is left moves mostly with {left}." if left and not little else rest
    return f"{start}: {names}.{explains}{doubt}{rest}"


def error_words(diagnosis: Diagnosis) -> str:
    """The error on sealed trials, whatever it says."""
    d, group, e = diagnosis, headline(diagnosis), diagnosis.errors
    unit, factor = SHOWN[group]
    told = [factor * x[group] for x in (e.nominal, e.calibrated, e.after, e.floor)]
    nominal, before, after, floor = (number(x, max(2, places(told[1:], 2))) for x in told)
    count = len(d.sealed_trials) - len(e.lost)
    where = f"On {count} sealed trial{'s' if count != 1 else ''}" + (", each in turn," if d.folds else "")
    if d.claims:
        verb = "falls" if e.after[group] < e.calibrated[group] else "goes"
        words = f"{where} the error {verb} from {before} to {after} {unit} (noise floor {floor} {unit}){_besides(d)}."
    else:
        words = f"{where} the error is {after} {unit}, from {nominal} {unit} as described (noise floor {floor} {unit})."
    if worse := [g for g in groups(d) if e.after[g] > e.calibrated[g]]:
        by = max(e.after[g] / e.calibrated[g] - 1.0 for g in worse)
        of = " and ".join(in_words(KIND[g]) for g in worse)
        words += f" There this twin is worse than the calibrated one in {of}, by {percent(by)}."
    if e.lost:
        words += f" It has no equilibrium for sealed {', '.join(labels(d, e.lost))}, which counts for nothing here."
    return words + _missed(d) + _stable(d)


def _missed(d: Diagnosis) -> str:
    """The sealed trials that are off by more than `MISSED` though fitted ones say that all is explained, each by the kind of output
    that shows it most."""
    told = []
    for k in d.sealed_trials if d.verdict in ("explained", "noise") else ():
        left = {g: evaluate.rms(d.bench, [d.bench.measured[k] - d.predictions["after"][k]], g) for g in groups(d)}
        missed = {g: left[g] / floor for g, floor in d.errors.floor.items() if left[g] > MISSED * floor > 0.0}
        if missed:
            most = max(missed, key=lambda g: missed[g])
            unit, factor = SHOWN[most]
            off, floor = factor * left[most], factor * d.errors.floor[most]
            told.append(f"{labels(d, (k,))[0]} by {off:.2g} {unit} in {in_words(KIND[most])} (noise floor {floor:.2g} {unit})")
    return f" But it misses sealed {', '.join(told)}: the fitted trials do not show all that happens there." if told else ""


def _besides(d: Diagnosis) -> str:
    """Other kinds of output whose error halves: an effect of sensors does nothing to positions."""
    e, words = d.errors, ""
    for group in (g for g in groups(d)[1:] if e.after[g] < 0.5 * e.calibrated[g]):
        unit, factor = SHOWN[group]
        before, after = (number(x, places([x], 2)) for x in (factor * e.calibrated[group], factor * e.after[group]))
        words += f", of {in_words(KIND[group])} from {before} to {after} {unit}"
    return words


def _stable(d: Diagnosis) -> str:
    """Where every trial was sealed in turn: how often the claims came out, and what that took."""
    if not d.folds:
        return ""
    n = len(d.folds)
    same = sum(f.effects == tuple(c.effect for c in d.claims) for f in d.folds)
    made = f" With so few trials the diagnosis was made {n + 1} times"
    return f"{made}; {same} of the {n} with one trial sealed come to the same effects."


def labels(diagnosis: Diagnosis, trials: tuple[int, ...]) -> list[str]:
    """Names of the bench's trials `trials` as reports print them: without the file's ending."""
    label = {t.name: t.label for t in diagnosis.bench.recording.trials}
    return [label[diagnosis.bench.inputs[k].name] for k in trials]
