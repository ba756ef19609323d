"""Where every opinion starts and what it returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.diagnosis import Settings
from twin.diagnosis.calibration.fit import Fit, Objective, fit
from twin.diagnosis.calibration.objective import objective_of
from twin.diagnosis.evidence.discrepancy import COMPONENTS, Discrepancy, Evidence
from twin.diagnosis.evidence.first_order import dictionary
from twin.diagnosis.evidence.ranking import Candidate, rank
from twin.diagnosis.split import split
from twin.effects import catalogue
from twin.measurements import Recording
from twin.prediction.evaluate import rms
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin


@dataclass(frozen=True)
class Opinion:
    """Whether an effect is missing, the effects named (most important first), and the twin that came of it."""

    missing: bool
    named: tuple[str, ...]
    twin: Twin


@dataclass(frozen=True)
class Calibrated:
    """A measurement set split, its noise estimated and the robot's own parameters fitted, as the diagnosis does."""

    prepared: PreparedRecording
    held: list[int]
    objective: Objective
    evidence: Evidence
    fit: Fit

    @staticmethod
    def of(recording: Recording, twin: Twin, settings: Settings) -> Calibrated:
        prepared = prepare(recording, twin.robot)
        fitted, held = split(prepared, settings.seed)
        start, objective, _ = objective_of(prepared, twin, fitted, settings)
        evidence = Evidence(prepared, fitted, objective.whitener.noise.drive)
        return Calibrated(prepared, held, objective, evidence, fit(objective, start, refresh=True))

    def screened(self, at: Fit) -> list[Candidate]:
        """Effects not in force whose pattern lowers |z|^2 by more than p log n to first order, at their best start, best first."""
        n_group = len(self.evidence.groups)
        none = Discrepancy(0.0, np.zeros(0), np.zeros(0), np.full((n_group, len(COMPONENTS)), 1e-8), np.zeros((0, 0)))
        best: dict[str, Candidate] = {}
        for candidate in rank(self.objective, self.evidence, at, none, dictionary(self.objective, at), top=len(catalogue())):
            best.setdefault(candidate.effect, candidate)
        return list(best.values())

    def held_out(self, twin: Twin) -> float:
        """RMS marker error (m, Euclidean per marker) on the trials no fit has seen."""
        traces = simulate(twin, self.prepared, trials=self.held)
        pairs = zip(self.held, traces, strict=True)
        raw = [self.prepared.measured[k] - t.outputs(twin, self.prepared) for k, t in pairs]
        return rms(self.prepared, raw, "marker")


def amplitudes(candidate: Candidate) -> list[str]:
    """The parameters of a candidate that switch it on; the others mean nothing while it is OFF."""
    return [name for name in candidate.start.free if name not in catalogue()[candidate.effect].inactive_when_off]
