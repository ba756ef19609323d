"""Stage `describe`: what is left after the verdict, in words, and where to look for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.diagnose.beyond import beyond
from twin.diagnose.doubts import unlikely
from twin.diagnose.field import field
from twin.diagnose.gate import Gated
from twin.diagnose.judge import Judgement
from twin.diagnose.leaps import leaps
from twin.diagnose.left_out import left_out
from twin.diagnose.null import Thresholds
from twin.diagnose.places import where
from twin.diagnose.quick import words as chatter
from twin.diagnose.repeatability import repeatability
from twin.diagnose.search import Search
from twin.diagnose.study import Study
from twin.diagnose.thresholds import MUCH, TOLD
from twin.diagnose.words import components, doubtful, mixed, nearest, since, structure, undecided, unlike, worst_channel

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


def describe(study: Study, found: Search, gated: Gated, judged: Judgement, bars: Thresholds) -> Description:
    """Of the model that the verdict leaves in force."""
    final = judged.final
    strongest = tuple(study.evidence.strongest(final.discrepancy))
    if judged.verdict in ("noise", "explained"):
        words = f"What is left looks like noise (smooth part {_parts(final.discrepancy.size, judged.signs.after)})."
    else:
        words = _left(study, found, judged, bars, strongest[0][0])
        words += "" if gated.doubts else _hint(study, found, judged)  # what is in doubt explains more, and is said below
    words += "".join(undecided(d.effect, d.rival) for d in gated.doubts)
    z = final.fit.z.reshape(final.discrepancy.mean.shape)
    rebuilt = (mixed(study.bench, judged.rigs).strip(),) if judged.rigs else ()
    far = tuple(b.words() for b in beyond(study, final, gated, by_time=judged.verdict == "partly_explained"))
    late = leaps(study.bench, study.trials, final.fit)
    outweighed = any(w.score > final.score for w in found.all)
    chosen = (PREDICTED,) if found.predicted and outweighed and judged.verdict == "partly_explained" else ()
    doubts = (doubtful(judged.doubtful),) if judged.doubtful else ()
    notices = (
        *unlikely(final.fit),
        *judged.signs.strained,
        *doubts,
        *repeatability(study, final.fit),
        *late,
        *rebuilt,
        *chosen,
        *far,
    )
    return Description(words, components(final.discrepancy), strongest, worst_channel(study.bench, z), notices)


def _parts(size: float, beyond: float) -> str:
    within = f", {beyond:.2f} beyond what the robot's description is good for" if size - beyond > TOLD else ""
    return f"{size:.2f} sigma{within}"


def _left(study: Study, found: Search, judged: Judgement, bars: Thresholds, strongest: str) -> str:
    bench, trials, final, signs = study.bench, study.trials, judged.final, judged.signs
    shape = final.discrepancy.mean.shape
    words = structure(bench, trials, final.fit.z.reshape(shape), final.discrepancy, strongest, signs.line, bars)
    if final.discrepancy.size > bars.left:
        off = final.discrepancy.mean * study.objective.whitener.noise.sigma  # SI
        predicted = [bench.measured[k] - r for k, r in zip(trials, final.fit.evaluation.raw, strict=True)]
        words += where(bench, trials, off, predicted)
        pulled = field(study, final)
        words += pulled.words() if pulled else ""
    words += chatter(signs.quick) if signs.quick > max(MUCH, bars.left) else ""
    words += since(bench, trials, found.base.fit.z.reshape(shape))
    words += mixed(bench, judged.rigs) if judged.rigs else ""
    words += "".join(f" The {limit}." for limit in signs.strained)
    found_something = judged.verdict == "partly_explained"
    return words + (unlike(signs.unseen, final.discrepancy.size) if found_something and signs.unseen > max(MUCH, bars.left) else "")


def _hint(study: Study, found: Search, judged: Judgement) -> str:
    """The runner-up, with the share it takes off the error left out."""
    if not judged.runners_up:
        return ""
    first = judged.runners_up[0]
    effects = tuple(sorted((first.effect, *first.beside)))
    runner = next(w for w in found.all if w.effects == effects)
    share = 1.0 - float(np.sqrt(left_out(study, runner.fit).headline / left_out(study, judged.final.fit).headline))
    return nearest((first.effect, *first.beside), share)
