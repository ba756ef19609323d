"""A day of a planar robot with two push rods, from a closed form: refused of tendons, diagnosed of rods, without a claim."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.other_continua import EI, LENGTH, robot
from twin.diagnosis import Settings, diagnose
from twin.diagnosis.calibration.first_calibration import _taut_share, _unslackened
from twin.diagnosis.noise.estimate import estimate_noise
from twin.foundation.errors import DataError
from twin.measurements import Channel, Recording, Trial
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import Robot

RADIUS, N_DISK, CELL, CAMERA = 8e-3, 8, 4e-3, 2e-4  # m, -, N, m
LARGEST = 1.5  # N: the robot then bends by 106 degrees


def planar(folder: Path, rods: bool) -> Robot:
    folder.mkdir()
    return robot(folder, {"tendons": 2, "rods": rods}, tendons__angle=([0.0, 180.0], "deg"))


def couples(seed: int) -> Recording:
    """Four trials of opposite forces T and -T, a sine, and noise: arcs of the turn 2 r T L / EI."""
    rng, t = np.random.default_rng(seed), np.arange(40.0)
    T = LARGEST * np.sin(2.0 * np.pi * t / 40.0)
    along = np.arange(1, N_DISK + 1) / N_DISK
    turn = 2.0 * RADIUS * T * LENGTH / EI
    angle, bend = turn[:, None] * along, np.where(turn == 0.0, 1.0, turn)[:, None] / LENGTH
    x, z = (1.0 - np.cos(angle)) / bend, np.where(turn[:, None] == 0.0, LENGTH * along, np.sin(angle) / bend)
    places = np.stack([x, 0.0 * x, z], axis=2)
    inputs = [Channel(f"tendon_{i}_tension", "input", "N", CELL) for i in (1, 2)]
    outputs = [Channel(f"disk_{k}_{a}", "output", "mm", CAMERA) for k in range(1, N_DISK + 1) for a in "xyz"]
    trials = []
    for k in range(4):
        seen = (places + CAMERA * rng.standard_normal(places.shape)).reshape(len(t), -1)
        read = np.column_stack([T, -T]) + CELL * rng.standard_normal((len(t), 2))
        columns = np.hstack([read, seen]).T
        values = {c.name: v for c, v in zip((*inputs, *outputs), columns, strict=True)}
        trials.append(Trial(f"t{k}.csv", t, values, start=100.0 * k))
    return Recording("planar", "couples", "simulation: closed form", np.zeros(3), (*inputs, *outputs), tuple(trials))


def test_a_closed_form_of_push_rods_leaves_noise_and_the_refusal_names_the_key(tmp_path: Path) -> None:
    """The verdict is noise: rods follow the backbone, as in the closed form."""
    day = couples(1)
    with pytest.raises(DataError, match=r"tendon_\d_tension: .* a tendon cannot push .* write rods = true in \[structure\]"):
        diagnose(day, Twin.of(planar(tmp_path / "tendons", rods=False)), Settings(jobs=2))
    found = diagnose(day, Twin.of(planar(tmp_path / "rods", rods=True)), Settings(jobs=2))
    assert (found.verdict, found.claims) == ("noise", ())
    # A zero offset of a cell is what tendons below zero would be suspected of.
    assert not any("zero offset" in said for said in found.notices)


def test_no_reading_of_a_rod_is_silenced_near_zero(tmp_path: Path) -> None:
    bench = prepare(couples(2), planar(tmp_path / "rods", rods=True))
    assert (bench.inputs[0].command < -1.0).any()
    np.testing.assert_array_equal(_taut_share(bench, 0), 1.0)
    np.testing.assert_array_equal(_unslackened(bench).inputs[0].command, bench.inputs[0].command)


def test_a_copied_trial_says_nothing_of_noise(tmp_path: Path) -> None:
    """The same readings again are no repeat: noise is as declared, not zero."""
    day = couples(3)
    copies = replace(day, trials=tuple(replace(day.trials[0], name=t.name, start=t.start) for t in day.trials))
    bench = prepare(copies, planar(tmp_path / "rods", rods=True))
    rows = CAMERA * np.random.default_rng(0).standard_normal(bench.measured[0].shape)
    felt = [np.zeros((*rows.shape, 2))] * 4
    noise, notes = estimate_noise(bench, [0, 1, 2, 3], [rows] * 4, felt)
    assert noise.declared
    assert any("no repeated trials" in words for words in notes)
    apart = [rows, *(rows + CAMERA * np.random.default_rng(k).standard_normal(rows.shape) for k in (1, 2, 3))]
    assert not estimate_noise(bench, [0, 1, 2, 3], apart, felt)[0].declared
