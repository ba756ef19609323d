"""The menu of next experiments: within what the robot was commanded, and never of nothing."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.test_design import bench
from tools.bench.design import bench_day
from twin.bench import Bench
from twin.diagnose.experiment import menu


def scaled(day: Bench, share: float) -> Bench:
    return replace(day, inputs=tuple(replace(i, command=share * i.command) for i in day.inputs))


@pytest.mark.parametrize("design", ["default", "by_length"])
@pytest.mark.parametrize("share", [1.0, 0.01])
def test_what_is_proposed_was_commanded_before_and_is_not_nothing(design: str, share: float) -> None:
    day = scaled(bench(bench_day(design, np.random.default_rng(0))), share)
    top = max(float(np.abs(i.command).max()) for i in day.inputs)
    proposed = menu(day)
    assert len(proposed) > 6
    for words, trial in proposed:
        assert np.abs(trial.command).max() <= top * (1.0 + 1e-12), words
        assert not re.search(r"(?<![\d.])0(\.0+)? (N|mm|A)\b", words), words
        assert words.startswith("rest") or np.abs(trial.command).max() > 0.5 * top, words


def test_a_robot_that_was_never_commanded_is_asked_for_rest_alone() -> None:
    still = scaled(bench(bench_day("default", np.random.default_rng(0))), 0.0)
    assert {words.split(",")[0] for words, _ in menu(still)} == {"rest unloaded for 60 s"}


def test_the_menu_has_a_pull_that_parts_direction_from_time() -> None:
    """Some commands are reached by release before they are pulled to again."""
    day = bench(bench_day("default", np.random.default_rng(0)))
    trial = next(t for words, t in menu(day) if "release it to half, pull it again" in words)
    pull = trial.command[:, 0]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(pull))))
    assert len(turns) == 3  # top, half, top
    assert pull[turns[1] + 1] == pytest.approx(0.5 * pull.max(), rel=0.05)
