"""What laws let through of the readings' noise, against the same laws under much of it, closed forms, and a law that is false."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from twin.body import Drive, Loads
from twin.diagnosis.noise.transmission import transmitted_noise
from twin.effects import Effect, effect_class
from twin.prediction.prepared import Inputs
from twin.prediction.twin import Twin
from twin.robots import load

N, DT = 120, 0.5
NOISE = np.array([0.01, 0.02, 0.005])  # N
TIME = DT * np.arange(N)
INPUTS = Inputs(
    "made", TIME, TIME, 1.0 + 0.02 * TIME[:, None] * np.array([1.0, 0.5, 0.2]), (Drive.TENSION,) * 3, np.full(N, 296.0),
    Loads(np.array([0.0, 0.0, -9.81]), 0.0), smooth=False,
)  # fmt: skip


def share(*effects: Effect, inputs: Inputs = INPUTS) -> np.ndarray:
    return transmitted_noise(Twin(load("continuum"), {}, effects), inputs, NOISE)


def law(name: str, **values: float) -> Effect:
    return effect_class(name)(values, 3)


def test_without_a_law_all_noise_passes() -> None:
    np.testing.assert_array_equal(share(), 1.0)
    np.testing.assert_array_equal(share(law("base_tilt", about_x=0.1)), 1.0)


@pytest.mark.parametrize(
    "effect",
    [law("load_cell_gain", gain_1=1.3, gain_2=0.7), law("load_cell_bias", bias_1=0.2), law("load_cell_crosstalk", share_1_2=0.2),
     law("load_cell_drift", rate_1=1e-4)],
    ids=lambda e: e.id,
)  # fmt: skip
def test_what_a_cell_reads_otherwise_passes_its_noise(effect: Effect) -> None:
    """A gain is no matter of noise: the robot's stiffness takes it up."""
    np.testing.assert_allclose(share(effect), 1.0, rtol=1e-9)


@pytest.mark.parametrize("rows", [0.0, 0.25, 0.5, -0.3, 1.0, 1.5])
def test_a_delay_between_two_rows_is_their_mean(rows: float) -> None:
    """Straight from row to row: (1 - f) of the one and f of the other, so (1 - f)^2 + f^2 of the noise's square."""
    f = rows % 1.0
    inner = share(law("time_delay", delay=rows * DT))[3:-3]
    np.testing.assert_allclose(inner, (1.0 - f) ** 2 + f**2, atol=1e-6)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize(
    "effect", [law("actuator_lag", time=0.2), law("actuator_lag", time=0.5), law("time_delay", delay=0.2)], ids=repr
)
def test_noise_that_is_drawn_is_let_through_as_told(effect: Effect, smooth: bool) -> None:
    """400 draws of the noise through the law, and what is told from ten noisy logs; in the mean over rows, whose chance is
    sqrt(2 / (400 120)) = 0.6 %. Told is up to 8 % more: a lag of a row still feels the reading four rows before by e^-4 of the
    last, once for each of the two, and a monotone cubic is not linear in what it goes through."""
    inputs, rng = replace(INPUTS, smooth=smooth), np.random.default_rng(0)
    laws = Twin(load("continuum"), {}, (effect,)).effect_chain

    def driven(command: np.ndarray) -> np.ndarray:
        return laws.drive(laws.command(replace(inputs, command=command).signals)).command

    at = driven(inputs.command)
    felt = np.mean([(driven(inputs.command + NOISE * rng.normal(size=(N, 3))) - at) ** 2 for _ in range(400)], axis=0) / NOISE**2
    read = [replace(inputs, command=inputs.command + NOISE * rng.normal(size=(N, 3))) for _ in range(10)]
    told = np.mean([share(effect, inputs=r) for r in read], axis=0)
    assert felt.mean() < 0.9, "it averages"
    np.testing.assert_allclose(told.mean(axis=0), felt.mean(axis=0), rtol=0.08)


def test_a_drive_at_its_end_passes_none() -> None:
    at_most = law("actuator_saturation", loss=1.0, limit=1.5, corner=0.01)
    found = share(at_most)
    held = INPUTS.command > 1.8
    assert held.sum() > 20
    assert found[held].max() < 0.1
    np.testing.assert_allclose(found[INPUTS.command < 1.4], 1.0, rtol=1e-4)


def test_play_between_antagonists_lies_on_the_pulling_side_and_passes_all() -> None:
    """Alone it would stand still after each turn, and feel nothing until its gap is crossed."""
    travel = 4e-3 * np.sin(0.3 * TIME)[:, None] * np.ones(3)
    inputs, play = replace(INPUTS, command=travel, drives=(Drive.DISPLACEMENT,) * 3), law("tendon_backlash", gap=2e-3, swap=1e-3)
    twin, noise = Twin(load("continuum"), {}, (play,)), np.full(3, 1e-6)
    np.testing.assert_allclose(transmitted_noise(twin, inputs, noise, antagonists=True), 1.0, rtol=1e-9)
    assert np.abs(transmitted_noise(twin, inputs, noise) - 1.0).max() > 0.1, "or this tells nothing"


def test_a_body_that_creeps_feels_noise_less_than_what_lasts() -> None:
    """By 1 at once and by 1 + a in the end, of two elements 1 + a_1 (1 - mean exp(-t / tau_1)) + ... in a trial."""
    creep = law("backbone_creep", amplitude=0.2, time=1e-3 + 0.3, amplitude_2=0.3, time_2=1e4)
    lasting = 1.0 + 0.2 * (1.0 - np.exp(-TIME / 0.301).mean()) + 0.3 * (1.0 - np.exp(-TIME / 1e4).mean())
    np.testing.assert_allclose(share(creep), lasting**-2, rtol=1e-9)


def test_a_false_delay_does_not_win_by_the_noise_that_it_averages() -> None:
    """A slow pull, read with noise, moves a marker by its true value: a delay of half a row predicts it better, the mean of two
    readings, by half the noise's square; what is passed accounts for that to three standard errors."""
    rng: Any = np.random.default_rng(1)
    true = np.sin(0.002 * TIME)[:, None] * np.ones(3)
    won, n = 0.0, 200
    late = law("time_delay", delay=0.5 * DT)
    laws = Twin(load("continuum"), {}, (late,)).effect_chain
    for _ in range(n):
        read = replace(INPUTS, command=true + NOISE * rng.normal(size=(N, 3)))
        then = laws.drive(laws.command(read.signals)).command
        won += float((((read.command - true) / NOISE) ** 2 - ((then - true) / NOISE) ** 2)[3:-3].sum())
    told = float((1.0 - share(late, inputs=replace(INPUTS, command=true)))[3:-3].sum())
    assert won / n > 0.3 * (N - 6) * 3, "it does win"
    assert won / n == pytest.approx(told, abs=3.0 * np.sqrt(2.0 * 3 * (N - 6) / n) + 0.01 * told)
