"""The verdict in one plain sentence, and the names it uses."""

from __future__ import annotations

from twin.diagnose import Claim, Diagnosis
from twin.diagnose.evidence import IN_WORDS
from twin.diagnose.verdict import LINE
from twin.effects import named
from twin.report.numbers import MM, number, percent, plus_minus

MOST = 3  # parameters of an effect named in a sentence


def effect_words(identifier: str) -> str:
    """"tendon_friction" -> "tendon friction"."""
    return identifier.replace("_", " ")


def headline(diagnosis: Diagnosis) -> str:
    """The group of outputs whose error stands for the twin: markers where there are any, else the first."""
    groups = list(diagnosis.errors.after)
    return "marker" if "marker" in groups else groups[0]


def structure_left(diagnosis: Diagnosis) -> str | None:
    """What the remaining error moves with, in words; None where only noise is left."""
    if diagnosis.verdict in ("noise", "explained"):
        return None
    sizes = diagnosis.structure
    if diagnosis.line[0] > LINE and max(sizes.values(), default=0.0) < 0.15:
        return f"a line at {diagnosis.line[1]:.2f} Hz"
    return IN_WORDS[max(sizes, key=lambda c: sizes[c])]


def explained_share(diagnosis: Diagnosis) -> float | None:
    """Share (0 to 1) of the structured error (sigmas) that the effects in force remove; None where there is none to explain."""
    before, after = diagnosis.structure_before, diagnosis.structure_after
    return None if not before > 0.05 else min(1.0, max(0.0, 1.0 - after / before))


def claim_words(claim: Claim) -> str:
    """"tendon friction, mu = 0.1030 ± 0.0013": the parameters that make the effect, those of its shape left out."""
    main = [n for n in claim.parameters if n not in named(claim.effect).shape] or list(claim.parameters)
    shown = [f"{n.replace('_', ' ')} = {plus_minus(claim.parameters[n])}" for n in main[:MOST]]
    return ", ".join([effect_words(claim.effect), *shown, *(["…"] if len(main) > MOST else [])])


def sentence(diagnosis: Diagnosis) -> str:
    """The verdict, what it rests on, and the error on trials no fit has seen."""
    group, e = headline(diagnosis), diagnosis.errors
    nominal, before, after, floor = (number(x[group] * MM) for x in (e.nominal, e.calibrated, e.after, e.floor))
    count = len(diagnosis.held_trials)
    unseen = f"on {count} trial{'s' if count != 1 else ''} no fit has seen"
    noise = f"noise floor {floor} mm"
    if diagnosis.verdict == "noise":
        return f"No missing effect: after calibration only noise is left; {unseen} the error is {after} mm, from {nominal} mm ({noise})."
    left = structure_left(diagnosis)
    if diagnosis.verdict == "unexplained":
        return (
            f"Unexplained: after calibration a structured error of {diagnosis.structure_before:.2f} sigma is left that no known "
            f"effect may claim; it moves mostly with {left}, and {unseen} the error is {after} mm ({noise})."
        )
    many = len(diagnosis.claims) > 1
    share = explained_share(diagnosis)
    names = " and ".join(claim_words(c) for c in diagnosis.claims)
    does = f"{'Together they explain' if many else 'It explains'} {percent(share)} of the structured error; " if share is not None else ""
    change = f"falls from {before} to {after} mm" if e.after[group] < e.calibrated[group] else f"goes from {before} to {after} mm"
    start = "Partly explained" if diagnosis.verdict == "partly_explained" else f"Missing effect{'s' if many else ''}"
    rest = f" What is left moves mostly with {left}." if left else ""
    what = f"{does}{unseen}"
    return f"{start}: {names}. {what[0].upper()}{what[1:]} the error {change} ({noise}).{rest}"
