"""Judged within trials: days of the independent bench whose trials each sit elsewhere, by six times what rows scatter by."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.recorded_days import half, recorded_day
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import Fit, fit
from twin.diagnosis.diagnosis import Settings
from twin.diagnosis.evidence.discrepancy import Evidence
from twin.diagnosis.explain.within_trial import Moving, WithinTrial, _judged, _unseen
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.noise.model import DECLARED, Noise
from twin.diagnosis.noise.repeatability import repeatability
from twin.measurements import Recording
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load

LASTING = 1.5e-3  # m, six times what the bench's camera scatters by
STRENGTH = {"base_tilt": 4.0, "contact": 1.6, "magnet": 1.0}


def elsewhere(recording: Recording, seed: int) -> Recording:
    """Every output of every trial off by a number of its own, and declared to be as noisy."""
    rng = np.random.default_rng(seed)
    outputs = {c.name for c in recording.channels if c.role == "output"}
    channels = tuple(replace(c, noise=LASTING) if c.name in outputs else c for c in recording.channels)
    trials = tuple(
        replace(t, values={k: v + LASTING * rng.normal() if k in outputs else v for k, v in t.values.items()})
        for t in recording.trials
    )
    return replace(recording, channels=channels, trials=trials)


def calibrated(recording: Recording) -> tuple[FitContext, Fit]:
    robot = load("continuum")
    bench = prepare(recording, robot)
    trials = list(range(len(bench.inputs)))
    start, objective, _ = objective_of(bench, Twin.of(robot), trials, Settings())
    return FitContext(objective, Evidence(bench, trials, objective.whitener.noise.drive)), fit(objective, start, refresh=True)


@pytest.mark.parametrize("effect", [None, "backbone_creep", "base_tilt", "contact", "magnet"])
def test_what_happens_within_trials_is_named_under_what_lasts_through_them(effect: str | None) -> None:
    """A day of each kind, seen through offsets of six times the noise: named, said to be unknown, or to be nothing."""
    recording, _ = recorded_day(effect, STRENGTH.get(effect or "", 3.0), seed=6, design="no_repeats")
    study, found = calibrated(elsewhere(half(recording), seed=1))
    assert study.objective.whitener.noise.source == DECLARED
    (said,) = repeatability(study, found)
    if effect is None:
        assert "no more than rows scatter by" in said
    elif effect == "magnet":
        assert "of which no known effect explains half" in said
    else:
        assert f"of whose square {effect.replace('_', ' ')} explains" in said


def test_what_lasts_through_a_trial_changes_nothing() -> None:
    """Other offsets, the same z: it is of what outputs move by."""
    rng = np.random.default_rng(0)
    y = rng.normal(size=(20, 5))
    y[3, 1] = y[7:, 2] = y[:, 4] = np.nan
    G = rng.normal(size=(20, 5, 2))
    rows = Noise(np.array([0.5, 1.0, 2.0, 1.0, 1.0]), np.array([0.3, 0.2]), np.zeros(5), "rows of a trial")
    moving = Moving(rows, [y], [G], [np.zeros((20, 2))])
    once, again = (moving.trial(0, y + offset) for offset in (np.zeros(5), np.array([5.0, -3.0, 2.0, 40.0, 1.0])))
    assert again == pytest.approx(once, abs=1e-12)
    assert np.all(once[~np.isfinite(y)] == 0.0)
    assert moving.free == 19 + 18 + 6 + 19  # and nothing of what was never seen


def test_squares_on_trials_left_out_are_those_of_fits_to_the_others() -> None:
    """Against least squares by themselves, with what is believed as rows of their own; of [J, C, z] two columns are fitted."""
    rng = np.random.default_rng(2)
    parts = [rng.normal(size=(9, 4)) for _ in range(5)]
    S = np.stack([x.T @ x for x in parts])
    believed = np.array([[2.5]])
    left, numbers = _unseen(S, np.array([0, 2]), believed)

    def fitted(which: list[np.ndarray]) -> np.ndarray:
        A = np.vstack([*(x[:, [0, 2]] for x in which), [[np.sqrt(2.5), 0.0]]])
        return np.linalg.lstsq(A, -np.append(np.concatenate([x[:, -1] for x in which]), 0.0))[0]

    unseen = [parts[k][:, -1] + parts[k][:, [0, 2]] @ fitted(parts[:k] + parts[k + 1 :]) for k in range(5)]
    assert left == pytest.approx(sum(float(z @ z) for z in unseen))
    assert numbers == pytest.approx(fitted(parts))


def drawn(sign: float, n_trial: int = 6) -> Any:
    """Trials in which one law's column explains z but for white noise, with this sign; a second law's is chance, and a third's a
    mixture of the two, which takes a fifth."""
    rng = np.random.default_rng(4)
    parts = []
    for _ in range(n_trial):
        x = rng.normal(size=(400, 4))
        x[:, 3] += -sign * 0.5 * x[:, 1]
        parts.append(np.insert(x, 3, x[:, 1] + 2.0 * x[:, 2], axis=1))
    return np.stack([x.T @ x for x in parts])


@pytest.mark.parametrize(("sign", "named"), [(1.0, True), (-1.0, False)])
def test_a_law_that_may_go_one_way_only_does_not_go_the_other(sign: float, named: bool) -> None:
    patterns = (
        SimpleNamespace(effect="tendon_friction", amplitudes=("mu",), where=(0,), least=lambda n: np.zeros(1)),
        SimpleNamespace(effect="base_tilt", amplitudes=("about_x",), where=(1,), least=lambda n: np.array([-np.inf])),
        SimpleNamespace(effect="contact", amplitudes=("stiffness",), where=(2,), least=lambda n: np.array([-np.inf])),
    )
    found = _judged(drawn(sign), np.array([[1.0]]), SimpleNamespace(patterns=patterns), 3, 2400.0)  # type: ignore[arg-type]
    assert found.size == pytest.approx(np.hypot(1.0, 0.5), rel=0.05)  # 2400 numbers scatter by 1.4 %
    shares = dict(found.shares)
    assert ("tendon_friction" in shares) is named
    assert shares.get("base_tilt", 0.0) < 0.02
    assert shares["contact"] == pytest.approx(0.2, abs=0.1)
    assert [s for _, s in found.shares] == sorted(shares.values(), reverse=True)
    if named:
        assert shares["tendon_friction"] == pytest.approx(1.0, abs=0.15)  # (0.25 +- chance 2/sqrt(2400) * sqrt(2)) of 0.25


def test_of_a_law_for_every_tendon_those_that_would_go_the_other_way_stay_off() -> None:
    """Of three amplitudes the second alone explains, the third would have to be negative, and the first nothing."""
    rng, parts = np.random.default_rng(8), []
    for _ in range(6):
        x = rng.normal(size=(400, 5))
        x[:, 4] += -0.5 * x[:, 2] + 0.4 * x[:, 3]
        parts.append(x.T @ x)

    def share(least: list[float], where: tuple[int, ...] = (0, 1, 2)) -> float:
        law = SimpleNamespace(
            effect="actuator_saturation", amplitudes=("a", "b", "c"), where=where, least=lambda n: np.array(least)
        )
        return dict(_judged(np.stack(parts), np.eye(1), SimpleNamespace(patterns=(law,)), 3, 2400.0).shares)["actuator_saturation"]  # type: ignore[arg-type]

    one_way, alone = share([0.0, 0.0, 0.0]), share([-np.inf], where=(1,))
    assert one_way == pytest.approx(alone, abs=0.02)  # the first, free, takes what chance gives it
    assert one_way == pytest.approx(0.25 / 0.41, abs=0.1)
    assert share([-np.inf, -np.inf, -np.inf]) > 0.9


@pytest.mark.parametrize(
    ("size", "shares", "said"),
    [
        (1.04, (("tendon_friction", 0.9),), "no more than rows scatter by"),
        (1.05, (("tendon_friction", 0.49),), "of which no known effect explains half"),
        (1.05, (), "of which no known effect explains half"),
        (
            1.05, (("tendon_friction", 0.51), ("contact", 0.40)),
            "of whose square tendon friction explains 51 % on left-out trials",
        ),
        (
            2.0, (("tendon_friction", 0.6), ("contact", 0.49)),
            "of whose square tendon friction explains 60 % on left-out trials; these data cannot separate it from contact 49 %",
        ),
    ],
)  # fmt: skip
def test_in_words(size: float, shares: tuple[tuple[str, float], ...], said: str) -> None:
    assert WithinTrial(size, shares).words() == said
