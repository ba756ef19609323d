"""Stage `held_out`: predict the held-out trials, once everything else is decided, and report the errors whatever they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from twin.diagnosis.calibration.first_calibration import sensitivity
from twin.diagnosis.checks.spikes import without_spikes
from twin.diagnosis.checks.zero_jumps import rezeroed
from twin.diagnosis.conclusion import Conclusion
from twin.diagnosis.diagnosis import Errors, Missed
from twin.diagnosis.evidence.polynomial import predict_by_polynomial
from twin.diagnosis.fit_context import stated_accuracy
from twin.diagnosis.split import blind
from twin.diagnosis.thresholds import MISSED_TRIAL_RATIO
from twin.foundation.errors import SolveError
from twin.prediction.evaluate import OUTPUT_GROUPS, headline_group, rms, squared_errors
from twin.prediction.prepared import PreparedRecording
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin

Pick = Callable[[Conclusion], Twin | None]


@dataclass(frozen=True)
class HeldOut:
    """The held-out trials with their measurements, and the twins that predict them without having been fitted to them."""

    prepared: PreparedRecording
    nominal: Sequence[np.ndarray]  # (n_k, n_output) a trial, as described
    parts: Sequence[tuple[Conclusion, Sequence[int]]]
    spikes: tuple[str, ...]

    @staticmethod
    def of(
        prepared: PreparedRecording, nominal: Sequence[np.ndarray], parts: Sequence[tuple[Conclusion, Sequence[int]]]
    ) -> HeldOut:
        """Collect the held-out trials of all parts, without single marker spikes.

        Spikes are found as in the fitted trials, by the scatter of the held-out trials themselves.
        """
        shown = {k for _, trials in parts for k in trials}
        whole, words = without_spikes(blind(prepared, [k for k in range(len(prepared.inputs)) if k not in shown]), nominal)
        return HeldOut(whole, nominal, parts, tuple(words))

    @property
    def trials(self) -> list[int]:
        return sorted(k for _, trials in self.parts for k in trials)

    def predictions(self, pick: Pick, rows: PreparedRecording | None = None) -> dict[int, np.ndarray]:
        """Return outputs (n_k, n_output) SI of each held-out trial, by the twin that `pick` selects of its conclusion.

        In other `rows` of the log, if given; NaN where that twin has no equilibrium.
        """
        out: dict[int, np.ndarray] = {}
        for conclusion, trials in self.parts:
            out |= dict(zip(trials, predicted(pick(conclusion), rows or conclusion.context.prepared, trials), strict=True))
        return out

    def error(self, pick: Pick, rows: PreparedRecording | None = None) -> float:
        """Return the RMS error of the headline outputs, SI; NaN where some trial cannot be predicted."""
        at, of = self.predictions(pick, rows), rows or self.prepared
        if any(np.isnan(y).all() for y in at.values()):
            return float("nan")
        return rms(of, [of.measured[k] - at[k] for k in self.trials], headline_group(o.group for o in of.outputs))

    def in_all_rows(self, whole: PreparedRecording) -> tuple[float, float, str]:
        """Return the RMS error of the headline outputs in the rows used and in those of the `whole` log, and the unit of both."""
        shown = OUTPUT_GROUPS[headline_group(o.group for o in self.prepared.outputs)]
        return shown.factor * self.error(lambda c: c.final), shown.factor * self.error(lambda c: c.final, whole), shown.unit

    def rezeroed(self, group: str) -> tuple[float, float]:
        """Return the RMS error (SI) of one group of outputs by the final twins, twice.

        First as predicted, then with each trial's zero taken from its own first rows.
        """
        at = self.predictions(lambda c: c.final)
        raw = [self.prepared.measured[k] - at[k] for k in self.trials]
        return rms(self.prepared, raw, group), rms(self.prepared, [rezeroed(self.prepared, group, r) for r in raw], group)

    def errors(self, seed: int) -> Errors:
        """Return the errors of the described, the calibrated and the final twin.

        Held-out trials for which one of the three has no equilibrium are left out.
        """
        calibrated, after = (self.predictions(p) for p in (lambda c: c.base, lambda c: c.final))
        stages = {"nominal": dict(enumerate(self.nominal)), "calibrated": calibrated, "after": after}
        lost = [k for k in self.trials if any(np.isnan(at[k]).all() for at in stages.values())]
        kept = [k for k in self.trials if k not in lost]
        groups = list(dict.fromkeys(o.group for o in self.prepared.outputs))
        raw = {s: [self.prepared.measured[k] - at[k] for k in kept] for s, at in stages.items()}
        error = {s: {g: rms(self.prepared, r, g) if kept else float("nan") for g in groups} for s, r in raw.items()}
        ci = {s: {g: interval(squared_errors(self.prepared, raw[s], g), seed) for g in groups} for s in ("calibrated", "after")}
        floor = self._floor(kept, groups)
        return Errors(
            error["nominal"], error["calibrated"], error["after"], floor, ci["calibrated"], ci["after"],
            self._without_physics(kept, groups), tuple(lost), self.spikes, tuple(self._missed(kept, raw["after"], floor)),
        )  # fmt: skip

    def _missed(self, kept: Sequence[int], raw: Sequence[np.ndarray], floor: Mapping[str, float]) -> Iterator[Missed]:
        """Yield the trials that are missed, each with the outputs that show it most.

        That is by more than `MISSED_TRIAL_RATIO` times the noise floor and the declared accuracy of the description together.
        """
        stated = stated_accuracy(self.prepared)
        excused = {g: rms(self.prepared, [stated[None, :]], g) for g in floor}
        for k, r in zip(kept, raw, strict=True):
            off = {g: rms(self.prepared, [r], g) for g in floor}
            far = [g for g in floor if off[g] > MISSED_TRIAL_RATIO * np.hypot(floor[g], excused[g]) > 0.0]
            if far:
                most = max(far, key=lambda g: off[g] / floor[g])
                yield Missed(k, most, off[most], floor[most])

    def _without_physics(self, kept: Sequence[int], groups: Sequence[str]) -> dict[str, float]:
        """Return the RMS error by group of a polynomial of the inputs, fitted to the trials of each conclusion."""
        raw: dict[int, np.ndarray] = {}
        for conclusion, trials in self.parts:
            wanted = [k for k in trials if k in kept]
            found = predict_by_polynomial(conclusion.context.prepared, conclusion.context.trials, wanted)
            raw |= {k: self.prepared.measured[k] - y for k, y in zip(wanted, found, strict=True)}
        return {g: rms(self.prepared, [raw[k] for k in kept], g) if kept else float("nan") for g in groups}

    def _floor(self, kept: Sequence[int], groups: Sequence[str]) -> dict[str, float]:
        """Return the RMS error that a perfect twin would still show, by group; NaN where no trial can be predicted.

        The noise is estimated under the final twin: what its effects change between repeated trials is no noise.
        """
        squared: dict[str, list[float]] = {g: [] for g in groups}
        for conclusion, trials in self.parts:
            noise = conclusion.noise()
            for k in (k for k in trials if k in kept):
                at = predicted(conclusion.final, self.prepared, [k])
                try:
                    G = sensitivity(self.prepared, [k], conclusion.final, at)
                except SolveError:
                    continue  # a neighbouring command has no equilibrium: this trial gives no floor
                for g, value in noise.floor(self.prepared, G).items():
                    squared[g].append(value**2)
        return {g: float(np.sqrt(np.mean(s))) if s else float("nan") for g, s in squared.items()}


def predicted(twin: Twin | None, prepared: PreparedRecording, trials: Sequence[int]) -> list[np.ndarray]:
    """Return outputs (n_k, n_output) SI of each trial; NaN for trials without an equilibrium, and where there is no twin."""
    if twin is None or not trials:
        return [np.full_like(prepared.measured[k], np.nan) for k in trials]
    try:
        return [t.outputs(twin, prepared) for t in simulate(twin, prepared, trials=trials)]
    except SolveError:
        if len(trials) > 1:
            return [predicted(twin, prepared, [k])[0] for k in trials]
        return predicted(None, prepared, trials)


def interval(squares: Sequence[np.ndarray], seed: int) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of an RMS.

    Whole trials are split into blocks of ten samples, since neighbouring samples are correlated, and the blocks are resampled.
    """
    blocks = [b for s in squares for b in np.array_split(s, max(1, len(s) // 10)) if len(b)]
    if not blocks:
        return float("nan"), float("nan")
    sums, counts = np.array([b.sum() for b in blocks]), np.array([len(b) for b in blocks])
    pick = np.random.default_rng(seed).integers(len(blocks), size=(1000, len(blocks)))
    values = np.sqrt(sums[pick].sum(axis=1) / counts[pick].sum(axis=1))
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
