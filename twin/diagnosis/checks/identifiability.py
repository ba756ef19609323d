"""What these data cannot determine, from the design and before any search for effects.

The robot's own parameters imitate a part of an effect's first-order pattern c. The rest, A = c'c less that part, is what the effect
shows. The closest rival r imitates a part of A again; the share that no rival can imitate is unique to the effect:

    u = min_r tr(A_cc - A_cr A_rr^-1 A_rc) / tr A_cc

An effect that leaves a sigmas (RMS over n samples) is seen at five standard errors if n a^2 >= 25, and separated from its rivals if
n a^2 u >= 25. Neither limit is below the least size worth claiming.
"""

from dataclasses import dataclass

import numpy as np

from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.calibration.objective import Objective
from twin.diagnosis.checks.design import shortcomings
from twin.diagnosis.evidence.first_order import Dictionary, Pattern
from twin.diagnosis.evidence.ranking import projected
from twin.diagnosis.thresholds import CLEAR_CHI_SQUARE, INVISIBLE_PATTERN_SHARE
from twin.effects import effect_class


@dataclass(frozen=True)
class Visibility:
    """What the data can show of one effect, in one `form` where it has several.

    `seen` and `apart` in sigmas: the least effect that is seen, and that is separated from its rivals (RMS, after the robot's own
    parameters are refitted; inf: never). `share` of its pattern that its closest `rival` cannot imitate. `smallest`: the least
    value (SI, from OFF) that is separated, of the parameter to which the data are most sensitive. `lacking`: what the design lacks
    to show it.
    """

    effect: str
    seen: float
    apart: float
    share: float
    rival: str
    smallest: tuple[str, float, str]  # parameter, value, unit
    lacking: tuple[str, ...]
    form: str = ""


def identifiability(objective: Objective, base: Fit, known: Dictionary, material: float) -> list[Visibility]:
    """Return one row an effect and form, those that are separated most easily first.

    `material` (sigma) is the least size worth claiming.
    """
    k = base.J.shape[1]
    X = np.concatenate([base.J, known.columns], axis=1)
    A = projected(X, X, base)[k:, k:]
    raw = np.einsum("ni,ni->i", known.columns, known.columns)
    groups: dict[tuple[str, str], list[Pattern]] = {}
    for p in known.patterns:
        groups.setdefault((p.effect, effect_class(p.effect).form(p.start.free)), []).append(p)
    lacks = shortcomings(objective.prepared)
    rows = []
    for (effect, form), patterns in groups.items():
        p = max(patterns, key=lambda p: len(p.where))
        i = np.array(p.where)
        own = float(np.trace(A[np.ix_(i, i)]))
        lacking = tuple(str(need) for need in lacks if need in effect_class(effect).hidden_without)
        if own < INVISIBLE_PATTERN_SHARE * float(raw[i].sum()) or own <= 0.0:
            nowhere = (p.amplitudes[0], np.inf, _unit(effect, p.amplitudes[0], objective))
            rows.append(Visibility(effect, np.inf, np.inf, 0.0, "", nowhere, lacking, form))
            continue
        shares: dict[str, float] = {}
        for q in (q for q in known.patterns if q.effect != effect):
            shares[q.effect] = min(shares.get(q.effect, np.inf), _left(A, i, np.array(q.where)) / own)
        rival = min(shares, key=lambda r: shares[r], default="")
        share = max(0.0, shares.get(rival, 1.0))
        seen = max(material, float(np.sqrt(CLEAR_CHI_SQUARE / objective.n)))
        apart = max(material, float(np.sqrt(CLEAR_CHI_SQUARE / (objective.n * share)))) if share > 0 else np.inf
        plainest = int(np.argmax(np.diag(A)[i]))  # the parameter to which the data are most sensitive
        value = apart * float(np.sqrt(objective.n / A[i[plainest], i[plainest]]))
        smallest = (p.amplitudes[plainest], value, _unit(effect, p.amplitudes[plainest], objective))
        rows.append(Visibility(effect, seen, apart, share, rival, smallest, lacking, form))
    return sorted(rows, key=lambda v: (v.apart, v.effect, v.form))


def _unit(effect: str, name: str, objective: Objective) -> str:
    return next(p.unit for p in effect_class(effect).all_parameters(objective.prepared.n_tendon) if p.name == name)


def _left(A: np.ndarray, i: np.ndarray, j: np.ndarray) -> float:
    """Return tr(A_ii - A_ij A_jj^-1 A_ji): the part of patterns i that patterns j cannot imitate."""
    inner = A[np.ix_(j, j)]
    cross = A[np.ix_(j, i)]
    solved = np.linalg.lstsq(inner + 1e-9 * max(np.trace(inner), 1e-12) * np.eye(len(j)), cross, rcond=None)[0]
    return float(np.trace(A[np.ix_(i, i)]) - np.einsum("ji,ji->", cross, solved))
