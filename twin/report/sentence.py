"""Write the verdict as one plain sentence."""

import math

from twin.diagnosis import Claim, Diagnosis
from twin.diagnosis.evidence.discrepancy import IN_WORDS
from twin.effects import effect_class
from twin.foundation.display_names import display_name
from twin.prediction import evaluate
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.report.numbers import DISPLAY_UNITS, decimals_for_digits, format_number, format_percent, format_with_error

MOST_NAMES = 3  # parameters of an effect, or untried sets, named in a sentence
CERTAIN_PROBABILITY = 0.9  # below it, the rivals of a single claim are named beside it


def headline_group(diagnosis: Diagnosis) -> str:
    """Return the group of outputs whose error stands for the twin."""
    return evaluate.headline_group(diagnosis.errors.after)


def output_groups(diagnosis: Diagnosis) -> list[str]:
    """Return the groups of outputs, the headline group first."""
    return sorted(diagnosis.errors.after, key=lambda g: g != headline_group(diagnosis))


def remaining_structure(diagnosis: Diagnosis) -> str | None:
    """Return in words what the remaining error varies with; None where only noise is left."""
    if diagnosis.verdict in ("noise", "explained"):
        return None
    sizes = diagnosis.structure
    if diagnosis.line[0] > diagnosis.limits.faint and max(sizes.values(), default=0.0) < diagnosis.limits.left:
        return f"a line at {diagnosis.line[1]:.2f} Hz"
    return IN_WORDS[max(sizes, key=lambda c: sizes[c])]


def explained_share(diagnosis: Diagnosis) -> float | None:
    """Return the share (0 to 1) of the structured error that the effects remove; None where there is none to explain."""
    before, after = diagnosis.structure_before, diagnosis.structure_after
    return None if not before > 0.05 else min(1.0, max(0.0, 1.0 - after / before))


def describe_claim(claim: Claim) -> str:
    """Name an effect with its main parameters, as in "tendon friction, mu = 0.1030 ± 0.0013".

    Parameters of its shape are left out. Of many parameters of one kind, such as one a sensor, the most significant are named.
    """
    effect = effect_class(claim.effect)
    main = [n for n in claim.parameters if n not in effect.inactive_when_off] or list(claim.parameters)
    off = {p.name: p.value for p in effect.per_tendon}
    kinds = {n.rpartition("_")[0] for n in main}
    shown = main[:MOST_NAMES]
    if len(kinds) == 1 and kinds <= set(off):
        level = off[kinds.pop()]
        surest = sorted(main, key=lambda n: -abs(claim.parameters[n].value - level) / (claim.parameters[n].std or math.inf))
        shown = [n for n in main if n in surest[:MOST_NAMES]]
    words = [f"{display_name(n)} = {format_with_error(claim.parameters[n])}" for n in shown]
    rest = f" and {len(main) - MOST_NAMES} more" if len(main) > MOST_NAMES else ""
    return ", ".join([display_name(claim.effect), *words]) + rest


def rival_explanations(diagnosis: Diagnosis) -> list[str]:
    """Return in words the explanations as good as the claimed one, without those that contain it."""
    claimed = {c.effect for c in diagnosis.claims}
    others = [effects for effects in diagnosis.ambiguous if not claimed or not claimed <= set(effects)]
    return [" with ".join(display_name(e) for e in effects) for effects in others]


def describe_missing_data(lacking: tuple[str, ...]) -> str:
    """Say which data would show an effect."""
    return f"needs {' and '.join(lacking)}" if lacking else "no measured channel responds to it"


def describe_undetectable(diagnosis: Diagnosis) -> str | None:
    """List the effects that these data cannot show at any size, and why; None where they can show all."""
    lacking: dict[tuple[str, ...], list[str]] = {}
    shown = {v.effect for v in diagnosis.identifiability if math.isfinite(v.seen)}
    for effect, why in dict.fromkeys((v.effect, v.lacking) for v in diagnosis.identifiability if v.effect not in shown):
        lacking.setdefault(why, []).append(display_name(effect))
    words = [f"{', '.join(names)} ({describe_missing_data(why)})" for why, names in lacking.items()]
    return f"These data cannot show: {'; '.join(words)}." if words else None


def sentence(diagnosis: Diagnosis) -> str:
    """Return the verdict, its reasons and the error on held-out trials."""
    d = diagnosis
    return f"{describe_rival(d)}{describe_verdict(d)}{describe_caveats(d)}{describe_untried(d)} {describe_errors(d)}"


def describe_rival(diagnosis: Diagnosis) -> str:
    """Say first that a polynomial of the commands predicts the held-out trials as well; empty where the twin is better."""
    d, group = diagnosis, headline_group(diagnosis)
    rival, own = d.errors.without_physics.get(group, math.nan), d.errors.after[group]
    if not rival <= own:
        return ""
    unit, factor = DISPLAY_UNITS[group]
    decimals = max(2, decimals_for_digits([factor * rival], 2))
    shown, twins = (f"{format_number(factor * x, decimals)} {unit}" for x in (rival, own))
    return (
        f"A polynomial of the commands, without physics, predicts the held-out trials no worse ({shown}) than this twin ({twins}). "
    )


def describe_caveats(diagnosis: Diagnosis) -> str:
    """List what stands against the verdict."""
    return "".join(f" {'And' if k else 'But'} {words}." for k, words in enumerate(diagnosis.caveats))


def describe_untried(diagnosis: Diagnosis) -> str:
    """List the sets of effects that the time budget left untried; empty where all were tried."""
    names = [" ".join(display_name(word) for word in name.split()) for name in diagnosis.untried]
    if not names:
        return ""
    rest = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return f" The time budget ran out before these were tried: {', '.join(names[:MOST_NAMES])}{rest}."


def describe_verdict(diagnosis: Diagnosis) -> str:
    """Return the verdict and its reasons, all from the fitted trials."""
    d = diagnosis
    left, others = remaining_structure(d), rival_explanations(d)
    if not d.claims:
        start = (
            "No missing effect: after calibration only noise is left."
            if d.verdict == "noise"
            else "Unexplained: after calibration only noise is left of the fitted trials."
            if d.errors.missed and d.structure_before <= d.limits.left
            else f"Unexplained: after calibration a structured error of {d.structure_before:.2f} sigma is left that no "
            f"{'effect tried' if d.untried else 'known effect'} explains; it varies mostly with {left}."
        )
        alike = f" It could be {' or '.join(others[:2])}; these data cannot tell which, so neither is claimed." if others else ""
        return start + alike
    many = len(d.claims) > 1
    start = "Partly explained" if d.verdict == "partly_explained" else f"Missing effect{'s' if many else ''}"
    names = " and ".join(describe_claim(c) for c in d.claims)
    share = explained_share(d)
    they = "Together they explain" if many else "It explains"
    explains = "" if share is None else f" {they} {format_percent(share)} of the structured error."
    doubt = f" These data cannot distinguish {'them' if many else 'it'} from {' or '.join(others[:2])}." if others else ""
    if others and not many and d.claims[0].probability < CERTAIN_PROBABILITY:
        names = (
            f"{' or '.join((display_name(d.claims[0].effect), *others[:2]))}, these data cannot tell which. The twin uses {names}"
        )
        doubt = ""
    little = left and d.structure_after <= d.limits.left and d.line[0] <= d.limits.faint
    rest = " Little error is left, but the result is in doubt: see the remaining error and the notices." if little else ""
    rest = f" The remaining error varies mostly with {left}." if left and not little else rest
    return f"{start}: {names}.{explains}{doubt}{rest}"


def describe_errors(diagnosis: Diagnosis) -> str:
    """State the error on the held-out trials."""
    d, group, e = diagnosis, headline_group(diagnosis), diagnosis.errors
    unit, factor = DISPLAY_UNITS[group]
    errors = [factor * x[group] for x in (e.nominal, e.calibrated, e.after, e.floor)]
    nominal, before, after, floor = (format_number(x, max(2, decimals_for_digits(errors[1:], 2))) for x in errors)
    count = len(d.held_out_trials) - len(e.lost)
    where = f"On {count} held-out trial{'s' if count != 1 else ''}" + (", each in turn," if d.folds else "")
    if d.claims:
        verb = "falls" if e.after[group] < e.calibrated[group] else "changes"
        words = (
            f"{where} the error {verb} from {before} to {after} {unit} (noise floor {floor} {unit}){_describe_other_outputs(d)}."
        )
    else:
        words = f"{where} the error is {after} {unit}, from {nominal} {unit} as described (noise floor {floor} {unit})."
    if worse := [g for g in output_groups(d) if e.after[g] > e.calibrated[g]]:
        by = max(e.after[g] / e.calibrated[g] - 1.0 for g in worse)
        of = " and ".join(display_name(OUTPUT_GROUPS[g].kind) for g in worse)
        words += f" There the twin is worse than the calibrated one in {of}, by {format_percent(by)}."
    if e.lost:
        labels = ", ".join(trial_labels(d, e.lost))
        words += (
            f" The twin has no equilibrium for held-out {labels}, so the errors leave {'it' if len(e.lost) == 1 else 'them'} out."
        )
    return words + _describe_stability(d)


def _describe_other_outputs(d: Diagnosis) -> str:
    """List the other kinds of output whose error halves, as an effect of sensors leaves positions unchanged."""
    e, words = d.errors, ""
    for group in (g for g in output_groups(d)[1:] if e.after[g] < 0.5 * e.calibrated[g]):
        unit, factor = DISPLAY_UNITS[group]
        errors = (factor * e.calibrated[group], factor * e.after[group])
        before, after = (format_number(x, decimals_for_digits([x], 2)) for x in errors)
        words += f", of {display_name(OUTPUT_GROUPS[group].kind)} from {before} to {after} {unit}"
    return words


def _describe_stability(d: Diagnosis) -> str:
    """Say how often the claims came out again, where every trial was held out in turn."""
    if not d.folds:
        return ""
    n = len(d.folds)
    same = sum(f.effects == tuple(c.effect for c in d.claims) for f in d.folds)
    runs = f" With so few trials the diagnosis was run {n + 1} times"
    return f"{runs}; {same} of the {n} runs with one trial held out find the same effects."


def trial_labels(diagnosis: Diagnosis, trials: tuple[int, ...]) -> list[str]:
    """Return the names of these trials of the prepared recording, without the ending of the file."""
    label = {t.name: t.label for t in diagnosis.prepared.recording.trials}
    return [label[diagnosis.prepared.inputs[k].name] for k in trials]
