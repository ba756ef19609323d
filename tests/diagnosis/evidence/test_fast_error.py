"""What is neither smooth nor noise, on residuals of known size."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.evidence import fast_error as stage
from twin.diagnosis.evidence.fast_error import fast_error

N, M = 300, 4  # rows, channels; the last row was not measured
RNG = np.random.default_rng(3)
NOISE, SMOOTH, RINGS = RNG.normal(size=(N, M)), RNG.normal(size=(N, M)), RNG.normal(size=(N, M))
PRESENT = np.arange(N)[:, None] < np.full(M, N - 1)


def left(z: np.ndarray, pairs: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch, rows: int = 100) -> float:
    """Of a study of the trials 0, 1 and 3 out of four, `rows` long each, whose smooth part is known."""
    monkeypatch.setattr(stage, "repeats", lambda bench: pairs)
    measured = [np.zeros((rows, M)) for _ in range(4)]
    study: Any = SimpleNamespace(
        prepared=SimpleNamespace(measured=measured), trials=[0, 1, 3], evidence=SimpleNamespace(present=PRESENT)
    )
    fit = SimpleNamespace(z=np.where(PRESENT, z, 0.0).ravel())
    found: Any = SimpleNamespace(fit=fit, discrepancy=SimpleNamespace(mean=2.0 * SMOOTH))
    return fast_error(study, found)


def unit(x: np.ndarray) -> np.ndarray:
    return x / np.sqrt(np.mean(x[PRESENT] ** 2))


def test_it_is_what_is_left_beyond_noise_and_what_noise_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """Squares of unit noise and of one and a half times that beside a smooth error of two, which counts nothing."""
    sure = 5.0 * np.sqrt(2.0 / (100 * M))  # by 400 differences of a pair
    assert left(unit(NOISE) + 2.0 * SMOOTH, [(0, 3)], monkeypatch) == 0.0
    z = unit(NOISE) * np.sqrt(1.0 + sure + 2.25) + 2.0 * SMOOTH
    assert left(z, [(0, 3)], monkeypatch) == pytest.approx(1.5)
    assert left(z, [(0, 3), (0, 1), (1, 3)], monkeypatch) > 1.5  # three pairs tell noise better
    assert left(z, [(0, 3)], monkeypatch, rows=10) < 1.5
    assert left(unit(NOISE) * np.sqrt(1.0 + sure) + 2.0 * SMOOTH, [(0, 3)], monkeypatch) == pytest.approx(0.0, abs=1e-6)


def test_where_nothing_repeats_nobody_can_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    """No repeats, or those of a trial that was not fitted."""
    z = 3.0 * RINGS
    assert left(z, [(0, 1)], monkeypatch) > 2.0
    assert left(z, [], monkeypatch) == 0.0
    assert left(z, [(0, 2), (2, 3)], monkeypatch) == 0.0
