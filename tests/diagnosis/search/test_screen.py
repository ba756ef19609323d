"""The stage before the search, by hand: what it hands on, and the robot's own accuracy in sigmas."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.search import screen as stage
from twin.diagnosis.search.screen import screen


def screened(monkeypatch: pytest.MonkeyPatch, accuracy: float, *outputs: tuple[str, float]) -> tuple[Any, dict[str, Any]]:
    """Of a robot of this accuracy whose outputs (group, sigma) are compared."""
    asked: dict[str, Any] = {}
    bench = SimpleNamespace(
        outputs=[SimpleNamespace(group=g) for g, _ in outputs], robot=SimpleNamespace(accuracy=accuracy, parameters=())
    )
    noise = SimpleNamespace(sigma=np.array([s for _, s in outputs]))
    objective: Any = SimpleNamespace(whitener=SimpleNamespace(noise=noise), prepared=bench)
    evidence: Any = None
    study = FitContext(objective, evidence, progress=lambda words: asked.setdefault("said", words))
    stated = [accuracy / s if g == "marker" else 0.0 for g, s in outputs]
    np.testing.assert_allclose(study.accuracy, stated)
    base: Any = SimpleNamespace(fit="fit")

    def null(study: Any, fit: str, patterns: str, seed: int) -> AcceptanceLimits:
        asked["seed"] = seed
        return AcceptanceLimits(accept=20.0, material=0.2, left=0.3, line=40.0)

    def table(objective: Any, fit: str, patterns: str, material: float) -> list[str]:
        asked["material"] = material
        return ["row"]

    monkeypatch.setattr(stage, "dictionary", lambda objective, fit: "patterns")
    monkeypatch.setattr(stage, "acceptance_limits", null)
    monkeypatch.setattr(stage, "identifiability", table)
    return screen(study, base, 7), asked


def test_the_accuracy_is_in_sigmas_of_the_outputs_it_speaks_of(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = screened(monkeypatch, 3e-4, ("marker", 2e-4), ("marker", 4e-4), ("displacement", 1.0))
    assert found.limits.accuracy == pytest.approx(1.0)
    assert replace(found.limits, accuracy=0.0) == AcceptanceLimits(accept=20.0, material=0.2, left=0.3, line=40.0)
    assert asked == {"said": "no-effect sets of this design", "seed": 7, "material": pytest.approx(1.0)}
    assert (found.patterns, found.table) == ("patterns", ("row",))


def test_an_accuracy_of_what_is_not_compared_is_no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = screened(monkeypatch, 3e-4, ("displacement", 1e-5))
    assert found.limits.accuracy == 0.0
    assert asked["material"] == 0.2
