"""Devices that take turns in the rows of one table: solved in the rows of the outputs, along the same path of the inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.measurements import Recording, Trial, read
from twin.prediction.evaluate import evaluate
from twin.prediction.own_clocks import on_rows_of_outputs
from twin.prediction.prepared import prepare
from twin.prediction.simulate import is_dynamic
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.robot import models_folder

FRIDAY = read(models_folder() / "continuum/samples/friday").select(range(3))
INPUTS = [c.name for c in FRIDAY.inputs()]


def taking_turns(trial: Trial, early: float = 0.003) -> Trial:
    """The inputs 3 ms before the outputs, in rows of their own."""
    time = np.sort(np.concatenate([trial.time - early, trial.time]))
    own, empty = np.arange(len(time)) % 2 == 0, np.full(len(time), np.nan)

    def spread(name: str, values: np.ndarray) -> np.ndarray:
        out, mine = empty.copy(), own if name in INPUTS else ~own
        out[mine] = values
        return out

    return replace(trial, time=time, values={n: spread(n, v) for n, v in trial.values.items()})


MERGED = replace(FRIDAY, trials=tuple(map(taking_turns, FRIDAY.trials)))


def test_a_set_without_turns_is_the_very_same() -> None:
    lost = {n: np.where(np.arange(len(v)) % 5 == 2, np.nan, v) for n, v in FRIDAY.trials[0].values.items() if n not in INPUTS}
    holed = FRIDAY.trials[0].values["tendon_1_tension"].copy()
    holed[3] = np.nan
    for changed in ({}, lost, {"tendon_1_tension": holed}):
        first = replace(FRIDAY.trials[0], values={**FRIDAY.trials[0].values, **changed})
        made = replace(FRIDAY, trials=(first, *FRIDAY.trials[1:]))
        assert on_rows_of_outputs(made) is made


def test_rows_of_the_inputs_are_not_solved_and_the_error_is_that_of_one_clock() -> None:
    led = on_rows_of_outputs(MERGED)
    assert led.n_samples < 1.1 * FRIDAY.n_samples
    assert len([n for n in led.notices if "clocks of several devices" in n]) == len(led.notices) - len(MERGED.notices) == 1
    assert not is_dynamic(prepare(led, load("continuum")))
    twin = Twin.of_recording(FRIDAY)
    np.testing.assert_allclose(evaluate(twin, MERGED)["rmse"], evaluate(twin, FRIDAY)["rmse"], rtol=0.01)  # 3 ms of a motion


def test_a_turn_of_the_inputs_between_two_outputs_is_kept() -> None:
    """Outputs every 4 s see 0 N each time; between them the tendon is pulled to 1 N and released."""
    time = np.arange(9.0)
    pull = np.array([0.0, 0.5, 1.0, 0.5, 0.0, 0.5, 1.0, 0.5, 0.0])
    pull[[4]] = np.nan
    seen = np.where(np.isin(time, [0.0, 4.0, 8.0]), 0.1, np.nan)
    trial = FRIDAY.trials[0]
    values = {n: pull if n == INPUTS[0] else np.zeros(9) if n in INPUTS else seen for n in trial.values}
    made = replace(FRIDAY, trials=(replace(trial, time=time, values=values),))
    led = on_rows_of_outputs(made).trials[0]
    np.testing.assert_array_equal(led.time, [0.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0])  # 0.5 N stand in for the missing 0 N at 4 s
    np.testing.assert_array_equal(led.values[INPUTS[0]], [0.0, 1.0, 0.5, 0.5, 0.5, 1.0, 0.0])


def test_outputs_that_take_turns_are_no_fast_motion() -> None:
    """Markers and a load cell in turns 1 ms apart: the commands cross their range in the same time as before."""
    trial = FRIDAY.trials[0]
    outputs = [n for n in trial.values if n not in INPUTS]
    time = np.sort(np.concatenate([trial.time, trial.time + 1e-3]))
    odd = np.arange(len(time)) % 2 == 1
    values = {n: np.repeat(v, 2) for n, v in trial.values.items()}
    for k, n in enumerate(outputs):
        values[n] = np.where(odd == (k % 2 == 0), np.nan, values[n])
    made = replace(FRIDAY, trials=(replace(trial, time=time, values=values),))
    assert not is_dynamic(prepare(made, load("continuum")))


def test_the_recording_that_was_read_keeps_its_rows() -> None:
    made: Recording = on_rows_of_outputs(MERGED)
    assert made is not MERGED
    assert MERGED.n_samples == 2 * FRIDAY.n_samples
