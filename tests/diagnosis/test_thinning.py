"""Rows of long logs: how many are kept, which are left alone, and that they are picked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tools.benchmarks.diagnosis.raw_log import raw_log
from twin.diagnosis import thinning
from twin.diagnosis.thinning import thinned
from twin.measurements import Recording
from twin.prediction.prepared import prepare
from twin.robots import load

ROBOT = load("continuum")
LOG = raw_log(0.0, 2600)  # 26 s at 100 Hz, twice: more than suffice


def kept(log: Recording, budget: float | None = None) -> tuple[Recording, int]:
    return thinned(log, prepare(log, ROBOT), budget)


def test_commands_go_by_a_small_part_of_their_range_between_rows() -> None:
    """A sine of 0.26 rad/s covers 2 % of its range (from zero: all of it in a quarter of a turn) in 0.02 / 0.26 s, 7.7 rows."""
    part, every = kept(LOG)
    assert 5 <= every <= 9
    for before, after in zip(LOG.trials, part.trials, strict=True):
        np.testing.assert_array_equal(after.time, before.time[::every])
        for name, column in after.values.items():  # picked, not averaged
            np.testing.assert_array_equal(column, before.values[name][::every])


def test_a_log_that_is_short_is_left_alone() -> None:
    first = slice(0, 2000)
    trials = (replace(t, time=t.time[first], values={n: v[first] for n, v in t.values.items()}) for t in LOG.trials)
    short = replace(LOG, trials=tuple(trials))
    part, every = kept(short)
    assert (part, every) == (short, 1)
    assert kept(short, budget=40.0)[1] == 4  # what the budget pays for: 25 rows a second


def test_a_trial_keeps_enough_rows_under_any_budget() -> None:
    part, every = kept(LOG, budget=1.0)
    assert every == 2600 // 200
    assert min(len(t.time) for t in part.trials) >= 200


def test_fast_commands_keep_their_rows() -> None:
    rows = np.arange(2600)
    fast = [{**t.values, "tendon_1_tension": 0.7 + 0.7 * np.sin(0.5 * rows)} for t in LOG.trials]  # a turn in 13 rows
    assert kept(LOG.with_values(fast, "test"))[1] == 1


def test_devices_that_take_turns_are_left_alone() -> None:
    turns = [{n: np.where(np.arange(2600) % 2 == (n.startswith("disk_3")), v, np.nan) if n.startswith("disk") else v
              for n, v in t.values.items()} for t in LOG.trials]  # fmt: skip
    assert kept(LOG.with_values(turns, "test"))[1] == 1


def test_the_words_say_what_was_left_out() -> None:
    said = thinning.words(LOG, 7, 0.5123, 0.4987, "mm")
    assert said == (
        "5200 rows in 2 trials, 10 ms apart: every 7th was used; the error on held-out trials is 0.512 mm in these and 0.499 mm in "
        "all rows"
    )


@pytest.mark.parametrize(("n", "word"), [(2, "nd"), (3, "rd"), (4, "th"), (11, "th"), (12, "th"), (21, "st"), (113, "th")])
def test_ordinals(n: int, word: str) -> None:
    assert f"every {n}{word} was" in thinning.words(LOG, n, 1.0, 1.0, "mm")
