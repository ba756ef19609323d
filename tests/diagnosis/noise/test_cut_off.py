"""Noise that laws of load cells cut off of tendons at rest: what is told of it, and that fits do not lean to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from twin.body import Drive, Loads
from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.calibration.objective import PARAMETER_DIFFERENCE, Evaluation, Objective
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import SLACK_BLUR, SLACK_READING, Whitener
from twin.effects import catalogue
from twin.prediction.prepared import Inputs
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")
N, CELL, REST = 1500, 0.03, 0.06  # rows; N, a reading's noise and the tension of two tendons at rest
SIGMA = 1e-4  # m, a marker's noise
S = 0.03 * np.array([[1.0, -0.5, -0.5], [0.0, 0.87, -0.87], [3e-4, 3e-4, 3e-4]])  # m/N, a body that bends, and hardly shortens
MEASURED = [np.zeros((N, 3))]


def whitener(drive: Sequence[float] = (CELL,) * 3) -> Whitener:
    return Whitener(
        Noise(np.full(3, SIGMA), np.array(drive), np.zeros(3), "made"), MEASURED, [np.tile(S, (N, 1, 1))], [np.zeros((N, 3))]
    )


def test_half_of_the_noise_is_cut_off_four_tenths_above_slack() -> None:
    """And all of it where a law has the tendon far below, none far above, none of a reading without noise."""
    made = whitener((CELL, CELL, 0.0))
    tension = np.tile([SLACK_READING * CELL, (SLACK_READING + SLACK_BLUR) * CELL, 0.0], (N, 1))
    cut = made.clipped_input_noise(0, tension) / np.maximum(made.input_noise_energy[0], 1e-300)
    np.testing.assert_allclose(cut[:, :2], np.tile([0.5, norm.cdf(-1.0)], (N, 1)), rtol=1e-9)
    np.testing.assert_array_equal(made.clipped_input_noise(0, tension)[:, 2], 0.0)
    np.testing.assert_allclose(made.clipped_input_noise(0, tension - 1.0)[:, :2], made.input_noise_energy[0][:, :2])
    np.testing.assert_allclose(made.clipped_input_noise(0, tension + 1.0), 0.0, atol=1e-12)


def test_in_the_mean_it_is_what_the_noise_loses() -> None:
    """1 - Var max(0, x + e) of it, to 0.04: so little do the blur and the sharp boundary differ."""
    x = np.linspace(-4.0, 4.0, 81)
    P, p = norm.cdf(x), norm.pdf(x)
    lost = 1.0 - ((x**2 + 1.0) * P + x * p - (x * P + p) ** 2)
    e, weight = np.polynomial.hermite_e.hermegauss(60)
    told = norm.cdf((SLACK_READING - x[:, None] - e) / SLACK_BLUR) @ (weight / weight.sum())
    np.testing.assert_allclose(told, lost, atol=0.04)


class Bending(Objective):
    """A linear body, markers S T with T never below zero, under the laws of its load cells; one trial, its readings noisy."""

    def __init__(self, rng: np.random.Generator, bias: float) -> None:
        true = np.full((N, 3), REST)
        true[:, 0] += 0.5 * (1.0 + np.sin(np.arange(N) / 40.0))
        read = true + np.array([bias, 0.0, 0.0]) + CELL * rng.normal(size=(N, 3))
        time = np.arange(float(N))
        inputs = Inputs("made", time, time, read, (Drive.TENSION,) * 3, np.full(N, 296.0), Loads(np.zeros(3), 0.0))
        measured = true @ S.T + SIGMA * rng.normal(size=(N, 3))
        bench: Any = SimpleNamespace(measured=[measured], inputs=[inputs], silenced_below_zero=np.ones(3, bool))
        super().__init__(bench, [0], whitener(), 1)
        self.feels = True

    def raw(self, model: Model) -> np.ndarray:
        true = model.twin.effect_chain.command(self.prepared.inputs[0].signals).tension
        return self.prepared.measured[0] - np.maximum(true, 0.0) @ S.T

    def within(self, most: float, model: Model, near: Mapping[int, Any] | None = None) -> Evaluation | None:
        z = self.whitener.trial(0, self.raw(model)).ravel()
        return Evaluation(model, {}, [self.raw(model)], z) if z @ z <= most else None

    def jacobian(self, at: Evaluation, which: Sequence[int]) -> np.ndarray:
        x, out = at.model.vector(), np.zeros((at.z.size, len(which)))
        for j, i in enumerate(which):
            moved = at.model.at(x + PARAMETER_DIFFERENCE * (np.arange(x.size) == i))
            out[:, j] = (self.whitener.trial(0, self.raw(moved)).ravel() - at.z) / PARAMETER_DIFFERENCE
        return out

    def cut_off(self, twin: Twin) -> np.ndarray:
        return super().cut_off(twin) if self.feels else np.zeros(1)


def found(objective: Objective) -> np.ndarray:
    law = catalogue()["load_cell_bias"]
    own = tuple(f"bias_{i}" for i in (1, 2, 3))
    bare = Model(replace(Twin.of(ROBOT), effects=()), ())
    fitted = fit(objective, bare.with_effect(law.id, dict.fromkeys(own, 0.01), own, 3))
    assert fitted.cost == pytest.approx(
        float(fitted.z @ fitted.z) + sum((b / 0.2) ** 2 for b in fitted.model.twin.effects[0].values.values())
    ), "what is cut off is fitted, not counted: evidence does"
    return fitted.model.twin.effects[0].per_tendon_values("bias")


@pytest.mark.parametrize("bias", [0.0, 0.02])
def test_a_fit_does_not_lean_to_where_tendons_at_rest_fall_silent(bias: float) -> None:
    """Two tendons rest two noises above slack. Fitted to |z|^2 alone the biases rise until they are silent, since what all three
    have in common hardly moves this body: 60 mN of it costs some 400 of |z|^2, where silence brings 2,000. What is told of the
    noise errs by 1.5 % of it at two noises, 30 of these, so by half a reading's noise in that; the differences by far less."""
    days = [Bending(np.random.default_rng(k), bias) for k in range(6)]
    felt = np.mean([found(day) for day in days], axis=0)
    for day in days:
        day.feels = False
    leaning = np.mean([found(day) for day in days], axis=0)
    assert leaning[1:].min() > 0.7 * REST, "they do lean, or this tells nothing"
    np.testing.assert_allclose(felt, [bias, 0.0, 0.0], atol=0.5 * CELL)
    np.testing.assert_allclose(felt - felt.mean(), np.array([bias, 0.0, 0.0]) - bias / 3.0, atol=0.1 * CELL)
