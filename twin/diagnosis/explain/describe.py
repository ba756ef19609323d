"""Stage `describe`: what is left after the verdict, in words, and where to look for it."""

from dataclasses import dataclass

import numpy as np

from twin.diagnosis.checks.fit_warnings import unlikely
from twin.diagnosis.checks.undersampled_commands import undersampled_commands
from twin.diagnosis.evidence.fast_error import words as chatter
from twin.diagnosis.evidence.left_out import left_out
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.explain.error_location import describe_location
from twin.diagnosis.explain.extrapolation import extrapolation
from twin.diagnosis.explain.pose_dependent_force import pose_dependent_force
from twin.diagnosis.explain.words import components, doubtful, mixed, nearest, since, structure, undecided, unlike, worst_channel
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.noise.repeatability import repeatability
from twin.diagnosis.search.search import Search
from twin.diagnosis.thresholds import LARGE_STRUCTURE, STRUCTURE_WORTH_A_WORD
from twin.diagnosis.verdict.gate import Gated
from twin.diagnosis.verdict.judge import Judgement

PREDICTED = (
    "what is claimed was chosen for what it predicts of trials and halves of the session left out; by evidence, to which a large "
    "smooth error costs no more than a small one, other sets come before it, which the probabilities show"
)


@dataclass(frozen=True)
class Description:
    """What is left: in words; RMS (sigmas) by component; its strongest regressors; the channel it shows in most; notices."""

    words: str
    components: dict[str, float]
    strongest: tuple[tuple[str, float], ...]
    worst_channel: str
    notices: tuple[str, ...]


def describe(context: FitContext, found: Search, gated: Gated, judged: Judgement, limits: AcceptanceLimits) -> Description:
    """Of the model that the verdict leaves in force."""
    final = judged.final
    strongest = tuple(context.evidence.strongest(final.discrepancy))
    if judged.verdict in ("noise", "explained"):
        words = f"What is left looks like noise (smooth part {_parts(final.discrepancy.size, judged.signs.after)})."
    else:
        words = _left(context, found, judged, limits, strongest[0][0])
        words += "" if gated.doubts else _hint(context, found, judged)  # what is in doubt explains more, and is said below
    words += "".join(undecided(d.effect, d.rival) for d in gated.doubts)
    z = final.fit.z.reshape(final.discrepancy.mean.shape)
    rebuilt = (mixed(context.prepared, judged.rigs).strip(),) if judged.rigs else ()
    far = tuple(b.words() for b in extrapolation(context, final, gated, by_time=judged.verdict == "partly_explained"))
    late = undersampled_commands(context.prepared, context.trials, final.fit)
    outweighed = any(w.score > final.score for w in found.all)
    chosen = (PREDICTED,) if found.predicted and outweighed and judged.verdict == "partly_explained" else ()
    doubts = (doubtful(judged.doubtful),) if judged.doubtful else ()
    notices = (
        *unlikely(final.fit),
        *judged.signs.strained,
        *doubts,
        *repeatability(context, final.fit),
        *late,
        *rebuilt,
        *chosen,
        *far,
    )
    return Description(words, components(final.discrepancy), strongest, worst_channel(context.prepared, z), notices)


def _parts(size: float, beyond: float) -> str:
    within = f", {beyond:.2f} beyond what the robot's description is good for" if size - beyond > STRUCTURE_WORTH_A_WORD else ""
    return f"{size:.2f} sigma{within}"


def _left(context: FitContext, found: Search, judged: Judgement, limits: AcceptanceLimits, strongest: str) -> str:
    prepared, trials, final, signs = context.prepared, context.trials, judged.final, judged.signs
    shape = final.discrepancy.mean.shape
    words = structure(prepared, trials, final.fit.z.reshape(shape), final.discrepancy, strongest, signs.line, limits)
    if final.discrepancy.size > limits.left:
        off = final.discrepancy.mean * context.objective.whitener.noise.sigma  # SI
        predicted = [prepared.measured[k] - r for k, r in zip(trials, final.fit.evaluation.raw, strict=True)]
        words += describe_location(prepared, trials, off, predicted)
        pulled = pose_dependent_force(context, final)
        words += pulled.words() if pulled else ""
    words += chatter(signs.quick) if signs.quick > max(LARGE_STRUCTURE, limits.left) else ""
    words += since(prepared, trials, found.base.fit.z.reshape(shape))
    words += mixed(prepared, judged.rigs) if judged.rigs else ""
    words += "".join(f" The {limit}." for limit in signs.strained)
    found_something = judged.verdict == "partly_explained"
    return words + (
        unlike(signs.unseen, final.discrepancy.size) if found_something and signs.unseen > max(LARGE_STRUCTURE, limits.left) else ""
    )


def _hint(context: FitContext, found: Search, judged: Judgement) -> str:
    """The runner-up, with the share it takes off the error left out."""
    if not judged.runners_up:
        return ""
    first = judged.runners_up[0]
    effects = tuple(sorted((first.effect, *first.beside)))
    runner = next(w for w in found.all if w.effects == effects)
    share = 1.0 - float(np.sqrt(left_out(context, runner.fit).headline / left_out(context, judged.final.fit).headline))
    return nearest((first.effect, *first.beside), share)
