"""Which effects are worth a refit: how much of the residual the first-order pattern of each explains that the model cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.bench import Bench
from twin.calibrate import Fit, Model, Objective, prior_weight
from twin.diagnose.evidence import Discrepancy, Evidence
from twin.effects import Start, catalogue
from twin.errors import SolveError, TwinError
from twin.twin import Twin, report


@dataclass(frozen=True)
class Candidate:
    """An effect, where to start it, and the fall of |z|^2 its pattern promises less p log n: white, and beside the discrepancy."""

    effect: str
    start: Start
    gain_white: float
    gain_beside: float

    @property
    def gain(self) -> float:
        return max(self.gain_white, self.gain_beside)


def screen(objective: Objective, evidence: Evidence, fit: Fit, discrepancy: Discrepancy, top: int = 4) -> list[Candidate]:
    """The `top` candidates by either measure, best first, at most two starts an effect.

    With c the effect's white pattern (per free parameter), J the model's derivatives with their priors P and V the residual's
    covariance (I, or I + Phi D Phi'): A = c' V^-1 c - c' V^-1 J (J' V^-1 J + P)^-1 J' V^-1 c, u = c' V^-1 z less the same
    projection, gain = u' A^-1 u - p log n. A one-sided effect whose best amplitude is negative gains nothing.
    """
    bench = objective.bench
    present = {e.id for e in fit.model.twin.effects}
    traces = fit.evaluation.traces
    predicted = [report(fit.model.twin.effects, t.true) for t in traces]
    patterns: list[tuple[str, Start, list[str], list[int]]] = []
    neighbours: dict[Twin, tuple[Model, float]] = {}
    index: dict[Twin, int] = {}  # several starts may share a pattern
    for identifier, law in catalogue().items():
        if identifier in present or present & set(law.akin):
            continue
        for start in law.starts(predicted, bench.n_tendon):
            try:
                models, names = _patterns(fit.model, bench, identifier, start)
            except TwinError:
                continue
            patterns.append((identifier, start, names, [index.setdefault(m.twin, len(index)) for m, _ in models]))
            neighbours |= {m.twin: (m, size) for m, size in models}
    columns = _solvable_columns(objective, fit, list(neighbours.values()))
    both = np.concatenate([fit.J, columns, fit.z[:, None]], axis=1)
    gains = []
    for X in (both, evidence.whiten(discrepancy, both)):
        gains.append(_gains(both, X, fit, patterns, bench.n_tendon, objective.n))
    found = [Candidate(e, s, a, b) for (e, s, _, _), a, b in zip(patterns, *gains, strict=True)]
    chosen: list[Candidate] = []
    for key in ("gain_white", "gain_beside"):
        taken = 0
        for c in sorted(found, key=lambda c: -getattr(c, key)):
            if taken == top or getattr(c, key) <= 0.0:
                break
            if c in chosen:
                taken += 1
            elif sum(o.effect == c.effect for o in chosen) < 2:
                chosen.append(c)
                taken += 1
    return sorted(chosen, key=lambda c: -c.gain)


def _patterns(model: Model, bench: Bench, identifier: str, start: Start) -> tuple[list[tuple[Model, float]], list[str]]:
    """For each amplitude of the effect, the model with that amplitude alone switched on, and by how much."""
    law = catalogue()[identifier]
    off = {p.name: p.value for p in law.declared(bench.n_tendon)}
    shape = {k: v for k, v in start.values.items() if k in law.shape}
    names = [n for n in start.free if n not in law.shape]
    models = []
    for name in names:
        value = start.values.get(name, off[name])
        models.append((model.with_effect(identifier, {**shape, name: value}, (), bench.n_tendon), value - off[name]))
    return models, names


def _solvable_columns(objective: Objective, fit: Fit, neighbours: list[tuple[Model, float]]) -> np.ndarray:
    """Columns of all neighbours; one that has no equilibrium gets a zero column and so no gain."""
    try:
        return objective.columns(fit.evaluation, neighbours)
    except SolveError:
        out = np.zeros((fit.z.size, len(neighbours)))
        for i, neighbour in enumerate(neighbours):
            try:
                out[:, i] = objective.columns(fit.evaluation, [neighbour])[:, 0]
            except SolveError:
                continue
        return out


def _gains(
    X: np.ndarray, VX: np.ndarray, fit: Fit, patterns: list[tuple[str, Start, list[str], list[int]]], n_tendon: int, n: int
) -> list[float]:
    """Gain of every pattern; X = [J, columns, z] and VX = V^-1 X."""
    k = fit.J.shape[1]
    S = X.T @ VX
    prior = np.zeros(S.shape[0])
    prior[:k] = prior_weight(fit.model) ** 2
    JJ = S[:k, :k] + np.diag(prior[:k]) + 1e-9 * np.eye(k)
    projected = S - S[:, :k] @ np.linalg.solve(JJ, S[:k, :])
    out = []
    for identifier, _, names, where in patterns:
        index = k + np.array(where)
        A, u = projected[np.ix_(index, index)], projected[index, -1]
        keep = np.diag(A) > 1e-6 * np.maximum(np.diag(S)[index], 1e-12)
        if not keep.any():
            out.append(-np.inf)
            continue
        A, u = A[np.ix_(keep, keep)], u[keep]
        # z falls by column * amplitude, columns being changes of the residual: amplitude = -A^-1 u
        amplitude = -np.linalg.solve(A + 1e-9 * np.trace(A) * np.eye(len(A)), u)
        table = {p.name: p for p in catalogue()[identifier].declared(n_tendon)}
        used = [n for n, kept in zip(names, keep, strict=True) if kept]
        one_sided = [table[n].low >= table[n].value for n in used]
        if any(o and a < 0 for o, a in zip(one_sided, amplitude, strict=True)):
            out.append(-np.inf)
            continue
        out.append(float(-u @ amplitude - len(used) * np.log(n)))
    return out
