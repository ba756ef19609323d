"""Thresholds for the user's own design, from simulated data without any effect.

With the robot's own parameters fitted, no-effect data leave white noise less what the parameters absorb:
z = (1 - J (J'J + P)^-1 J') e, e ~ N(0, 1) where something was measured. Each draw is searched as the data are; the 99 % quantile of
the largest statistic over all effects, regressors and frequencies (a Gumbel law fitted by its moments: few draws do) is what an
effect must exceed. The floors below guard against what no simulation from the model knows: that the model is slightly wrong.

Simulated once a design: trials of the same length, loads and largest commands, seen by the same channels. Kept in
$XDG_CACHE_HOME/twin/null (else ~/.cache).
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from twin.bench import Bench
from twin.calibrate import Fit, Objective, prior_weight
from twin.diagnose.evidence import Evidence, Spectrum
from twin.diagnose.screen import Dictionary, projected

DRAWS = 24
GUMBEL_99 = 3.137  # standard deviations above the mean of a Gumbel law: -sqrt(6)/pi (0.5772 + ln(-ln 0.99))
ACCEPT = 12.0  # evidence an effect must bring, after k log n: odds of e^6, safe over two dozen candidates
# sigma: an effect that moves the prediction by less is not claimed, whatever the statistics say. On 495 bench days 3 of 361 right
# claims were smaller, and 13 of 72 wrong ones, most of robots with a flaw that no parameter spans (tools/attribution.md).
MATERIAL = 0.13
LEFT = 0.12  # sigma of left-over structure; robots as built left 0.08 at most, of what no parameter spans
LINE = 30.0  # z-score of a spectral line
COARSE = 0.2  # designs that differ by less than some such share in length or size are one design


@dataclass(frozen=True)
class Thresholds:
    """What counts on this design: evidence of an effect, its contribution (sigma), structure left (sigma), a spectral line (z)."""

    accept: float = ACCEPT
    material: float = MATERIAL
    left: float = LEFT
    line: float = LINE

    @property
    def faint(self) -> float:
        """A line's bar where no effect was found whose law could leave one; the largest of 40 no-effect days was half of it."""
        return self.line / 3.0


def thresholds(objective: Objective, evidence: Evidence, base: Fit, known: Dictionary, seed: int) -> Thresholds:
    """The larger of floor and null quantile, each; from the cache where this design has been simulated before."""
    file = _cache() / f"{_design(objective.bench, objective.trials, known)}-{seed}.json"
    try:
        return Thresholds(**json.loads(file.read_text()))
    except (OSError, ValueError, TypeError):
        found = _simulated(objective, evidence, base, known, seed)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(f".{os.getpid()}.part")
        part.write_text(json.dumps(asdict(found)))
        part.replace(file)
    except OSError:
        pass  # a home that cannot be written to costs a few seconds a diagnosis, nothing else
    return found


def _simulated(objective: Objective, evidence: Evidence, base: Fit, known: Dictionary, seed: int) -> Thresholds:
    n, k = base.z.size, base.J.shape[1]
    present = evidence.present.ravel()[:, None]
    e = np.random.default_rng(seed).normal(size=(n, DRAWS)) * present
    H = base.J.T @ base.J + np.diag(prior_weight(base.model) ** 2) + 1e-9 * np.eye(k)
    z = (e - base.J @ np.linalg.solve(H, base.J.T @ e)) * present
    X = np.concatenate([base.J, known.columns], axis=1)
    A = projected(X, X, base)[k:, k:]
    u = known.columns.T @ z
    gain, fall = np.full(DRAWS, -np.inf), np.zeros(DRAWS)
    for pattern in known.patterns:
        i = np.array(pattern.where)
        inner = A[np.ix_(i, i)]
        falls = np.einsum("id,id->d", u[i], np.linalg.solve(inner + 1e-9 * max(np.trace(inner), 1e-12) * np.eye(len(i)), u[i]))
        gain = np.maximum(gain, falls - len(i) * np.log(objective.n))
        fall = np.maximum(fall, falls)
    spectrum = Spectrum.of(objective.bench, objective.trials)
    found = [evidence.discrepancy(z[:, d]) for d in range(DRAWS)]
    lines = [spectrum.peak(z[:, d].reshape(f.mean.shape) - f.mean)[0] for d, f in enumerate(found)]
    return Thresholds(
        max(ACCEPT, _quantile(gain)),
        max(MATERIAL, _quantile(np.sqrt(fall / objective.n))),
        max(LEFT, _quantile(np.array([f.size for f in found]))),
        max(LINE, _quantile(np.array(lines))),
    )


def _quantile(x: np.ndarray) -> float:
    return float(np.mean(x) + GUMBEL_99 * np.std(x, ddof=1))


def _cache() -> Path:
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "twin" / "null"


def _design(bench: Bench, trials: list[int], known: Dictionary) -> str:
    """A digest of what the thresholds depend on: every trial's size, loads and largest commands, coarsely; channels; effects;
    floors."""

    def coarse(x: float) -> int:
        return round(np.log(max(abs(x), 1e-9)) / COARSE)

    rows = [
        (coarse(len(i.time)), coarse(i.time[-1] - i.time[0] + 1e-9), [coarse(float(c)) for c in np.abs(i.command).max(axis=0)],
         round(i.loads.payload, 4), np.round(i.loads.gravity, 1).tolist())
        for i in (bench.inputs[k] for k in trials)
    ]  # fmt: skip
    floors = (DRAWS, ACCEPT, MATERIAL, LEFT, LINE)
    effects = [p.effect for p in known.patterns]
    parts = (bench.robot.name, sorted(map(str, rows)), [o.channel.name for o in bench.outputs], effects, floors)
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:20]
