"""Noise that friction stills: against the same noise drawn once, a body without friction, and by hand what a set is paid for it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.calibration.first_calibration import sensitivity
from twin.diagnosis.noise import friction as stilled
from twin.diagnosis.noise.friction import noise_credit, resimulated_noise
from twin.diagnosis.noise.model import Noise
from twin.diagnosis.noise.whitening import Whitener
from twin.effects import Effect, effect_class
from twin.effects.base.chain import EffectChain
from twin.foundation.errors import SolveError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import output_columns, simulate
from twin.prediction.twin import Twin
from twin.robots import load

N, CELL, SIGMA = 160, 0.03, 2e-4  # rows; N, m
PULLS = tuple(Channel(f"tendon_{i}_tension", "input", "N", CELL) for i in (1, 2, 3))
TIP = tuple(Channel(f"disk_8_{a}", "output", "mm", 1e3 * SIGMA) for a in "xyz")


def bench() -> PreparedRecording:
    """One tendon after the other pulled and let go in steps, each held for ten rows."""
    t = np.arange(float(N))
    steps = 0.2 + 0.8 * (1.0 - np.cos(2.0 * np.pi * (t // 10) * 10 / N))
    values = {f"tendon_{i}_tension": np.roll(steps, 50 * i) for i in (1, 2, 3)} | {c.name: np.zeros(N) for c in TIP}
    recording = Recording(
        "continuum", "made", "simulation: none", np.zeros(3), (*PULLS, *TIP), (Trial("0.csv", t, values, {}, start=0.0),)
    )
    return prepare(recording, ROBOT)


ROBOT = load("continuum")
BENCH = bench()
FRICTION = effect_class("tendon_friction")({"mu": 0.2, "presliding": 4e-4}, 3)


def studied(*effects: Effect, at: PreparedRecording = BENCH) -> tuple[Any, Any]:
    """A study of one trial and a fit that is these laws."""
    twin = Twin(ROBOT, {}, effects)
    plain = simulate(Twin(ROBOT, {}, ()), at)
    G = sensitivity(at, [0], Twin(ROBOT, {}, ()), [output_columns(at, EffectChain(()).sense(plain[0].true))])
    noise = Noise(np.full(3, SIGMA), np.full(3, CELL), np.zeros(3), "made")
    whitener = Whitener(noise, [np.zeros((N, 3))], G, [np.zeros((N, 3))])
    fit = SimpleNamespace(model=SimpleNamespace(twin=twin), evaluation=SimpleNamespace(traces={0: simulate(twin, at)[0]}))
    return SimpleNamespace(prepared=at, trials=[0], objective=SimpleNamespace(whitener=whitener)), fit


def test_a_body_without_friction_feels_all_of_it() -> None:
    """What its readings' noise is told to add: pulls change so slowly that SYNC adds nothing. 1,920 squares: 3 %."""
    study, fit = studied()
    assert resimulated_noise(study, fit) == pytest.approx(float(study.objective.whitener.input_noise_energy[0].sum()), rel=0.1)


def test_shaken_once_more_friction_stills_as_much_as_it_did() -> None:
    """|z|^2 of what noise moves the tip by, drawn eight times onto pulls without noise, against what each noisy day tells of
    itself: 3 % of what is heard the one, less the other, and that slip states are where the first noise left them."""
    drawn, told, rng = [], [], np.random.default_rng(4)
    study, fit = studied(FRICTION)
    still = output_columns(BENCH, EffectChain((FRICTION,)).sense(fit.evaluation.traces[0].true))
    for _ in range(8):
        inputs = replace(BENCH.inputs[0], command=BENCH.inputs[0].command + CELL * rng.normal(size=(N, 3)))
        noisy, shaky = studied(FRICTION, at=replace(BENCH, inputs=(inputs,)))
        moved = output_columns(BENCH, EffectChain((FRICTION,)).sense(shaky.evaluation.traces[0].true)) - still
        drawn.append(float((study.objective.whitener.trial(0, moved) ** 2).sum()))
        told.append(resimulated_noise(noisy, shaky))
    heard = float(study.objective.whitener.input_noise_energy[0].sum())
    assert np.mean(told) == pytest.approx(np.mean(drawn), abs=0.08 * heard)
    assert np.mean(drawn) < 0.8 * heard, "friction stills it, or this tells nothing"


def weighed(score: float, unheard: float, felt: float, *effects: Effect) -> Any:
    return SimpleNamespace(
        score=score, unheard=unheard, fit=SimpleNamespace(model=SimpleNamespace(twin=Twin(ROBOT, {}, effects)), felt=felt)
    )


@pytest.mark.parametrize(
    ("lead", "with_it", "without", "due"),
    [
        (70.0, weighed(70.0, 227.0, 1050.0, FRICTION), weighed(0.0, 130.0, 1222.0, FRICTION), 75.0),
        (70.0, weighed(70.0, 227.0, 1125.0, FRICTION), weighed(0.0, 130.0, 1222.0, FRICTION), 0.0),
        (70.0, weighed(70.0, 0.0, 1300.0, FRICTION), weighed(0.0, 0.0, 1222.0, FRICTION), 0.0),
        (70.0, weighed(70.0, 227.0, 1050.0, FRICTION), weighed(0.0, 130.0, 1222.0), 0.0),
        (70.0, weighed(70.0, 227.0, 1050.0), weighed(0.0, 130.0, 1222.0, FRICTION), 0.0),
        (1600.0, weighed(1600.0, 227.0, 1050.0, FRICTION), weighed(0.0, 130.0, 1222.0, FRICTION), 0.0),
    ],
    ids=["paid", "as told", "feels more", "friction itself", "friction in its place", "more than all noise there is"],
)
def test_a_set_is_paid_what_it_feels_less_than_told(
    monkeypatch: pytest.MonkeyPatch, lead: float, with_it: Any, without: Any, due: float
) -> None:
    study: Any = SimpleNamespace(objective=SimpleNamespace(whitener=SimpleNamespace(input_noise_energy=[np.full((50, 3), 10.0)])))
    monkeypatch.setattr(stilled, "resimulated_noise", lambda study, fit: fit.felt)
    assert with_it.score - without.score == lead
    assert noise_credit(study, with_it, without) == pytest.approx(due)


def test_a_robot_that_shaken_has_no_equilibrium_is_compared_as_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(study: Any, fit: Any) -> float:
        raise SolveError("lost")

    monkeypatch.setattr(stilled, "resimulated_noise", lost)
    study: Any = SimpleNamespace(objective=SimpleNamespace(whitener=SimpleNamespace(input_noise_energy=[np.full((50, 3), 10.0)])))
    assert noise_credit(study, weighed(70.0, 0.0, 0.0, FRICTION), weighed(0.0, 0.0, 0.0, FRICTION)) == 0.0
