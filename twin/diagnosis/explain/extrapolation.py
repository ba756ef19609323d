"""Prediction within and beyond the fitted conditions: errors on left-out trials, and on left-out levels of a condition.

An effect that holds at every fitted payload need not hold at the next one. Where trials span a condition, each of its levels is
left out at once, to first order as single trials are. Where the verdict is "partly explained", each half of the session is
predicted by a fit to the other too. An effect that helps on left-out trials and harms on left-out levels is named.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from twin.diagnosis.evidence.half_session import halves
from twin.diagnosis.evidence.left_out import left_out
from twin.diagnosis.evidence.scored_model import ScoredModel
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import FEWEST_TRIALS_TO_HALVE, LOAD_LEVEL_GAP, SAME_RATE_RATIO, WORSE_ERROR_RATIO
from twin.diagnosis.verdict.gate import Gated
from twin.foundation.display_names import display_name
from twin.prediction.prepared import PreparedRecording

NAMED_CONDITIONS = {"payload": "payload", "torque": "load torque", "rate": "rate of pull", "mount": "mount"}


@dataclass(frozen=True)
class Extrapolation:
    """The errors of one condition.

    Its name, the number of levels, the errors (sigmas) on left-out trials (`inside`) and on left-out levels (`beyond`), and the
    claimed effects that reduce the former and increase the latter.
    """

    condition: str
    levels: int
    inside: float
    beyond: float
    harmful: tuple[str, ...]

    def words(self) -> str:
        words = (
            f"left out by {self.condition} ({self.levels} levels): an error of {self.beyond:.2f} sigma beyond the fitted levels, "
            f"{self.inside:.2f} within them"
        )
        if not self.harmful:
            return words
        named = " and ".join(display_name(e) for e in self.harmful)
        return f"{words}; {named} helps within and harms beyond: do not trust it there"


def extrapolation(context: FitContext, final: ScoredModel, gated: Gated, by_time: bool) -> tuple[Extrapolation, ...]:
    """Return one for each condition that the fitted trials span, and for time where `by_time`.

    `final` is the model in force.
    """
    added = [e for e in gated.without if e in final.effects]
    models = {"": final, **{e: gated.without[e] for e in added}}
    inside = {e: left_out(context, w.fit).square for e, w in models.items()}

    def compared(condition: str, count: int, far: dict[str, float]) -> Extrapolation:
        harmful = tuple(e for e in added if inside[e] > inside[""] and far[""] > WORSE_ERROR_RATIO**2 * far[e])
        return Extrapolation(condition, count, float(np.sqrt(inside[""])), float(np.sqrt(far[""])), harmful)

    out = []
    for condition, groups in levels(context.prepared, context.trials).items():
        out.append(compared(condition, len(groups), {e: left_out(context, w.fit, groups).square for e, w in models.items()}))
    if by_time and len(context.trials) >= FEWEST_TRIALS_TO_HALVE:
        out.append(compared("half of the session", 2, {e: halves(context, w).square for e, w in models.items()}))
    return tuple(out)


def levels(prepared: PreparedRecording, trials: Sequence[int]) -> dict[str, list[list[int]]]:
    """Return by condition the positions in `trials` that share a level.

    Only conditions with three levels or more, not all of one trial. Loads within a tenth of their range are one level, rates within
    half a decade. With two levels, leaving one out leaves no trend; and a level of one trial is that trial left out.
    """
    inputs = [prepared.inputs[k] for k in trials]
    speed = [np.median(np.abs(np.diff(i.command, axis=0)).max(axis=1) / np.diff(i.time)) for i in inputs]
    values = {
        "payload": np.array([i.loads.payload for i in inputs]),
        "torque": np.array([np.mean(i.loads.torque) for i in inputs]),
        "rate": np.log(np.maximum(speed, 1e-12)) / np.log(SAME_RATE_RATIO),
    }
    found = {name: _apart(v, 1.0 if name == "rate" else LOAD_LEVEL_GAP * np.ptp(v)) for name, v in values.items()}
    mounts = [tuple(np.round(i.loads.gravity, 3)) for i in inputs]
    found["mount"] = [[k for k, m in enumerate(mounts) if m == each] for each in dict.fromkeys(mounts)]
    return {NAMED_CONDITIONS[name]: groups for name, groups in found.items() if len(groups) > 2 and max(map(len, groups)) > 1}


def _apart(values: np.ndarray, gap: float) -> list[list[int]]:
    """Return the positions of values in groups: neighbouring values closer than `gap` are in one group."""
    order = np.argsort(values, kind="stable")
    cuts = np.flatnonzero(np.diff(values[order]) > max(gap, 1e-12)) + 1
    return [sorted(part.tolist()) for part in np.split(order, cuts)]
