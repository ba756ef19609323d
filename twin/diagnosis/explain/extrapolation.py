"""Inside and beyond what was fitted: what the model in force predicts of a trial, and of a whole level of a condition, left out.

A law that holds at every payload that was fitted need not hold at the next one. Where trials span a condition, each of its levels
is left out at once, to first order as single trials are; where a day is only partly explained each half of the session too, by fits
to the other. An effect that helps on trials left out and harms on levels is named.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.diagnosis.evidence.half_session import halves
from twin.diagnosis.evidence.left_out import left_out
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import FEWEST_TRIALS_TO_HALVE, RANGE_END_SHARE, SAME_RATE_RATIO, WORSE_ERROR_RATIO
from twin.diagnosis.verdict.gate import Gated
from twin.foundation.display_names import display_name
from twin.prediction.prepared import PreparedRecording

NAMED_CONDITIONS = {"payload": "payload", "torque": "load torque", "rate": "rate of pull", "mount": "mount"}


@dataclass(frozen=True)
class Extrapolation:
    """Of one condition: what it is, how many levels there are, the error (sigmas) on trials (`inside`) and on levels (`beyond`)
    left out in turn, and which claimed effects lessen the one and enlarge the other."""

    condition: str
    levels: int
    inside: float
    beyond: float
    harmful: tuple[str, ...]

    def words(self) -> str:
        told = (
            f"left out by {self.condition} ({self.levels} levels): {self.beyond:.2f} sigma are left beyond what was fitted, "
            f"{self.inside:.2f} inside"
        )
        if not self.harmful:
            return told
        named = " and ".join(display_name(e) for e in self.harmful)
        return f"{told}; {named} helps inside and harms beyond: do not trust it there"


def extrapolation(context: FitContext, final: ScoredModel, gated: Gated, by_time: bool) -> tuple[Extrapolation, ...]:
    """One for each condition that the fitted trials span, if asked for time too; `final` is the model in force."""
    added = [e for e in gated.without if e in final.effects]
    models = {"": final, **{e: gated.without[e] for e in added}}
    inside = {e: left_out(context, w.fit).square for e, w in models.items()}

    def told(condition: str, count: int, far: dict[str, float]) -> Extrapolation:
        harmful = tuple(e for e in added if inside[e] > inside[""] and far[""] > WORSE_ERROR_RATIO**2 * far[e])
        return Extrapolation(condition, count, float(np.sqrt(inside[""])), float(np.sqrt(far[""])), harmful)

    out = []
    for condition, groups in levels(context.prepared, context.trials).items():
        out.append(told(condition, len(groups), {e: left_out(context, w.fit, groups).square for e, w in models.items()}))
    if by_time and len(context.trials) >= FEWEST_TRIALS_TO_HALVE:
        out.append(told("half of the session", 2, {e: halves(context, w).square for e, w in models.items()}))
    return tuple(out)


def levels(prepared: PreparedRecording, trials: Sequence[int]) -> dict[str, list[list[int]]]:
    """By condition the positions in `trials` that share a level, where there are three levels or more, not all of one trial.

    Loads within a tenth of their range are one level, rates within half a decade. Two levels would leave one, which shows no trend
    to go on; and a level of one trial is that trial left out.
    """
    inputs = [prepared.inputs[k] for k in trials]
    speed = [np.median(np.abs(np.diff(i.command, axis=0)).max(axis=1) / np.diff(i.time)) for i in inputs]
    values = {
        "payload": np.array([i.loads.payload for i in inputs]),
        "torque": np.array([np.mean(i.loads.torque) for i in inputs]),
        "rate": np.log(np.maximum(speed, 1e-12)) / np.log(SAME_RATE_RATIO),
    }
    found = {name: _apart(v, 1.0 if name == "rate" else RANGE_END_SHARE * np.ptp(v)) for name, v in values.items()}
    mounts = [tuple(np.round(i.loads.gravity, 3)) for i in inputs]
    found["mount"] = [[k for k, m in enumerate(mounts) if m == each] for each in dict.fromkeys(mounts)]
    return {NAMED_CONDITIONS[name]: groups for name, groups in found.items() if len(groups) > 2 and max(map(len, groups)) > 1}


def _apart(values: np.ndarray, gap: float) -> list[list[int]]:
    """Positions of values that follow one another closer than `gap`, together."""
    order = np.argsort(values, kind="stable")
    cuts = np.flatnonzero(np.diff(values[order]) > max(gap, 1e-12)) + 1
    return [sorted(part.tolist()) for part in np.split(order, cuts)]
