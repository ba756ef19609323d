"""What lasts through a trial, beside what rows scatter by: residuals drawn with both known."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.noise import repeatability as stage
from twin.diagnosis.noise.model import DECLARED, Noise
from twin.diagnosis.noise.repeatability import repeatability
from twin.diagnosis.thresholds import LASTING_DIFFERENCE, LONG_PAUSE, OVERSTATED_NOISE_RATIO
from twin.foundation.errors import SolveError

ROWS, OUTPUTS, SCATTER = 400, 6, 2e-4  # m


def study(trials: int, sigma: float, source: str, gaps: dict[int, float] | None = None, rows: int = ROWS) -> Any:
    """`trials` of a second a row; before some of them a gap (s) longer than a minute."""
    start, inputs = 0.0, []
    for k in range(trials):
        start += (gaps or {}).get(k, 60.0)
        inputs.append(SimpleNamespace(clock=start + np.arange(float(rows))))
        start += rows
    noise = Noise(np.full(OUTPUTS, sigma), np.zeros(3), np.zeros(OUTPUTS), source)
    still = [np.zeros((rows, OUTPUTS))] * trials
    bench = SimpleNamespace(outputs=[SimpleNamespace(group="marker")] * OUTPUTS, inputs=inputs, reading=np.ones(3), measured=still)
    return SimpleNamespace(
        prepared=bench, trials=list(range(trials)), objective=SimpleNamespace(whitener=SimpleNamespace(noise=noise))
    )


def fitted(offsets: np.ndarray, rows: int = ROWS, slope: float = 0.0) -> Any:
    """Residuals of each trial: an offset (m) of its own in every output, a line, and white noise."""
    rng = np.random.default_rng(0)
    line = slope * np.linspace(-1.0, 1.0, rows)[:, None]
    raw = [o + line + SCATTER * rng.normal(size=(rows, OUTPUTS)) for o in offsets]
    return SimpleNamespace(evaluation=SimpleNamespace(raw=raw))


@pytest.fixture(autouse=True)
def undriven(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inputs that move nothing; what is judged within trials has tests of its own."""
    monkeypatch.setattr(stage, "sensitivity_at", lambda objective, e: [np.zeros((*r.shape, 3)) for r in e.raw])
    monkeypatch.setattr(stage, "within_trial", lambda study, found, rows, G, asked: SimpleNamespace(words=lambda: "judged"))


def millimetres(words: str) -> list[float]:
    return [float(x) for x in re.findall(r"([\d.]+) mm", words)]


@pytest.mark.parametrize(("factor", "said"), [(0.8, False), (1.25, True)])
def test_noise_declared_far_above_what_rows_scatter_by_is_how_trials_repeat(factor: float, said: bool) -> None:
    sigma = factor * OVERSTATED_NOISE_RATIO * SCATTER
    notices = repeatability(study(5, sigma, DECLARED), fitted(np.zeros((5, OUTPUTS)), slope=3e-4))
    assert bool(notices) is said
    if said:
        assert notices[0].endswith("mm, judged")
        declared, scatter, moves = millimetres(notices[0])
        assert declared == pytest.approx(1e3 * sigma, rel=0.05)  # two digits are written
        assert scatter == pytest.approx(0.2, rel=0.05)
        assert moves == pytest.approx(1e3 * np.hypot(SCATTER, 3e-4 / np.sqrt(3.0)), rel=0.05)  # a line's RMS beside the noise


def test_where_a_neighbour_has_no_equilibrium_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """The diagnosis is done by then, and stands."""

    def unsolved(*given: Any) -> None:
        raise SolveError("no static equilibrium")

    whole, found = study(5, 1e-3, DECLARED), fitted(np.zeros((5, OUTPUTS)))
    assert len(repeatability(whole, found)) == 1
    monkeypatch.setattr(stage, "within_trial", unsolved)
    assert repeatability(whole, found) == ()


def test_outputs_that_were_never_measured_say_nothing() -> None:
    found = fitted(np.zeros((5, OUTPUTS)))
    for r in found.evaluation.raw:
        r[:] = np.nan
    assert repeatability(study(5, 1e-3, DECLARED), found) == ()


def test_a_row_that_is_missing_says_nothing() -> None:
    found = fitted(np.zeros((5, OUTPUTS)))
    for r in found.evaluation.raw:
        r[::7] = np.nan
        r[:, 0] = np.nan
    (words,) = repeatability(study(5, 1e-3, DECLARED), found)
    assert millimetres(words)[1] == pytest.approx(0.2, rel=0.1)


def test_repeats_that_differ_throughout_are_named_with_what_is_between_sessions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four repeats, two before and two after a night: sessions are 1 mm apart a coordinate, trials within one 0.2 mm."""
    offset = 1e-3 * np.array([-0.1, 0.1, 0.9, 1.1])[:, None] * np.ones(OUTPUTS)
    pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    monkeypatch.setattr(stage, "repeats", lambda bench: pairs)
    apart = np.array([abs(offset[a, 0] - offset[b, 0]) for a, b in pairs]) / np.sqrt(2.0)
    night = np.array([False, True, True, True, True, False])
    said = [1e3 * np.sqrt(np.mean(x**2)) for x in (apart, apart[~night], apart[night])]
    (words,) = repeatability(study(4, SCATTER, "6 pairs", {2: 2.0 * LONG_PAUSE}), fitted(offset))
    assert millimetres(words) == pytest.approx([*said, 0.2], rel=0.1)
    assert "within a session" in words
    (words,) = repeatability(study(4, SCATTER, "6 pairs", {2: 0.9 * LONG_PAUSE}), fitted(offset))
    assert "session" not in words
    assert millimetres(words) == pytest.approx([said[0], 0.2], rel=0.1)


@pytest.mark.parametrize(
    ("rows", "rho", "share", "said"),
    [(ROWS, 0.0, 0.8, False), (ROWS, 0.0, 1.25, True), (4, 0.0, 1.1, False), (10, 0.0, 1.1, True), (16, 0.0, 1.25, True),
     (16, 0.6, 1.25, False)],
)  # fmt: skip
def test_repeats_that_differ_by_less_than_counts_or_by_chance_are_not(
    rows: int, rho: float, share: float, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Means of four rows scatter by half of the noise, of which three times are asked; so do those of 16 rows that each take 0.6 of
    the one before: (1 + rho) / (1 - rho) = 4."""
    monkeypatch.setattr(stage, "repeats", lambda bench: [(0, 1)])
    offset = np.sqrt(2.0) * share * LASTING_DIFFERENCE * SCATTER * np.array([0.0, 1.0])[:, None] * np.ones(OUTPUTS)
    whole = study(2, SCATTER, "1 pair", rows=rows)
    whole.objective.whitener.noise.rho[:] = rho
    assert bool(repeatability(whole, fitted(offset, rows=rows))) is said


def test_a_repeat_that_is_sealed_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage, "repeats", lambda bench: [(0, 1)])
    open_ = study(2, SCATTER, "1 pair")
    open_.trials = [0]
    assert repeatability(open_, fitted(np.ones((1, OUTPUTS)))) == ()
