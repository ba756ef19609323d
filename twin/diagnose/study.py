"""What every stage works on: the fitted trials, what they are compared by, and whom to tell how far things are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from twin.bench import Bench
from twin.calibrate import Objective
from twin.diagnose.evidence import Evidence

Progress = Callable[[str], None]


def silent(words: str) -> None:
    """Nobody is told."""


@dataclass(frozen=True)
class Study:
    """White residuals of the fitted trials, and named effects against "some smooth error" on them.

    The bench holds every trial's inputs, for a body that remembers, and the fitted trials' measurements alone.
    """

    objective: Objective
    evidence: Evidence
    progress: Progress = silent

    @property
    def bench(self) -> Bench:
        return self.objective.bench

    @property
    def trials(self) -> list[int]:
        return self.objective.trials
