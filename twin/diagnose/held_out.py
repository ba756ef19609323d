"""How a twin does on the trials that no fit has seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.bench import Bench
from twin.diagnose.diagnosis import Errors
from twin.diagnose.evidence import Evidence
from twin.diagnose.objective import sensitivity
from twin.errors import SolveError
from twin.evaluate import headline, rms, squares
from twin.residual import Noise, Whitener
from twin.twin import Twin, readings, report, simulate

ODD = 1.0  # sigma
WORSE = 1.005  # of the headline's error; refitting alone moves it by some thousandth, as it does where an effect shows elsewhere


class HeldOut:
    """The held-out trials, and what twins predict of them."""

    def __init__(self, bench: Bench, trials: Sequence[int], noise: Noise) -> None:
        self.bench, self.trials, self.noise = bench, list(trials), noise
        self.evidence = Evidence(bench, trials)

    @property
    def headline(self) -> str:
        """The group of outputs whose error stands for the twin."""
        return headline(o.group for o in self.bench.outputs)

    def predict(self, twin: Twin) -> list[np.ndarray]:
        """(n_k, n_output) SI a trial. Raises SolveError where one has no equilibrium."""
        return [readings(self.bench, report(twin.effects, t.true)) for t in simulate(twin, self.bench, trials=self.trials)]

    def residual(self, predicted: Sequence[np.ndarray]) -> list[np.ndarray]:
        return [self.bench.measured[k] - y for k, y in zip(self.trials, predicted, strict=True)]

    def error(self, twin: Twin) -> float:
        """RMS in SI: Euclidean per marker where there are markers, else of the first group. NaN without an equilibrium."""
        try:
            raw = self.residual(self.predict(twin))
        except SolveError:
            return float("nan")
        return rms(self.bench, raw, self.headline)

    def worse(self, twin: Twin, than: Twin) -> bool:
        """Whether a twin does worse here than another: in all channels together, each in its own noise, or in the headline's error.

        An effect that only tendon displacements show leaves the markers' error where it was, but for its last digits.
        """
        new, old = (np.concatenate(self._white(t, self.predict(t))[0]) for t in (twin, than))
        return float((new**2).sum()) > float((old**2).sum()) or self.error(twin) > WORSE * self.error(than)

    def structure(self, twin: Twin) -> tuple[float, dict[str, float]]:
        """The smooth error (sigma) the twin makes here, and the RMS by group of outputs that a perfect one would still make."""
        white, G = self._white(twin, self.predict(twin))
        return self.evidence.discrepancy(np.concatenate(white)).size, self.noise.floor(self.bench, G)

    def _white(self, twin: Twin, predicted: list[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """White residuals (n_k, n_output) and sensitivities to the driving readings, one array a trial."""
        G = sensitivity(self.bench, self.trials, twin, predicted)
        measured = [self.bench.measured[k] for k in self.trials]
        white = Whitener(self.noise, measured, G, [self.bench.inputs[k].command for k in self.trials])
        return [white.trial(k, r) for k, r in enumerate(self.residual(predicted))], G

    def odd(self, twin: Twin) -> list[int]:
        """Trials that err by more than `ODD` sigma beyond the noise (RMS)."""
        try:
            white = self._white(twin, self.predict(twin))[0]
        except SolveError:
            return []
        return [k for k, z in zip(self.trials, white, strict=True) if float((z[z != 0] ** 2).mean()) > 1.0 + ODD**2]

    def errors(self, predictions: dict[str, list[np.ndarray]], floor: dict[str, float], seed: int) -> Errors:
        """Of the predictions (all trials) called nominal, calibrated and after."""
        groups = list(dict.fromkeys(o.group for o in self.bench.outputs))
        raw = {name: self.residual([y[k] for k in self.trials]) for name, y in predictions.items()}
        error = {name: {g: rms(self.bench, raw[name], g) for g in groups} for name in raw}
        interval = {
            name: {g: _interval(squares(self.bench, raw[name], g), seed) for g in groups} for name in ("calibrated", "after")
        }
        return Errors(error["nominal"], error["calibrated"], error["after"], floor, interval["calibrated"], interval["after"])


def _interval(squares: list[np.ndarray], seed: int) -> tuple[float, float]:
    """95 % bootstrap interval of an RMS, over whole trials and blocks of ten samples within them, since neighbours are alike."""
    blocks = [b for s in squares for b in np.array_split(s, max(1, len(s) // 10)) if len(b)]
    sums, counts = np.array([b.sum() for b in blocks]), np.array([len(b) for b in blocks])
    pick = np.random.default_rng(seed).integers(len(blocks), size=(1000, len(blocks)))
    values = np.sqrt(sums[pick].sum(axis=1) / counts[pick].sum(axis=1))
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
