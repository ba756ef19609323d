"""Commands that leap between rows, and what a late drive leaves after them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.checks.undersampled_commands import undersampled_commands
from twin.diagnosis.thresholds import COMMAND_STEP_SHARE, ERROR_AFTER_STEP_RATIO
from twin.effects import effect_class

STEPS = np.repeat([0.0, 2.0, 0.5, 4.0], 10)[:, None]  # N: leaps of 50, 37.5 and 87.5 % of the range, 0.5 s wide
AFTER = [10, 11, 20, 21, 30, 31]


def said(command: np.ndarray, left: np.ndarray, effect: str = "actuator_lag") -> list[str]:
    """Two trials alike, two outputs; trial 1 is sealed, and goes further."""
    time = 0.5 * np.arange(len(command))
    trials = [SimpleNamespace(command=c, time=time) for c in (command, 100.0 * command, command)]
    bench: Any = SimpleNamespace(inputs=trials)
    model = SimpleNamespace(twin=SimpleNamespace(effects=(effect_class(effect)({}, 1),)))
    z = np.concatenate([np.repeat(left, 2), np.repeat(left, 2)])
    return undersampled_commands(bench, [0, 2], SimpleNamespace(model=model, z=z))  # type: ignore[arg-type]


def left_after(ratio: float) -> np.ndarray:
    left = np.ones(40)
    left[AFTER] = ratio
    return left


def test_what_is_left_after_leaps_is_said_with_how_often_and_how_long() -> None:
    (words,) = said(STEPS, left_after(2.0))
    assert words.startswith("actuator lag: 6 times a command goes more than 30 % of its range within one row of 0.5 s")
    assert "2.0 times that elsewhere" in words
    assert "log commands as often" in words
    (words,) = said(STEPS, left_after(2.0), "time_delay")
    assert words.startswith("time delay")


@pytest.mark.parametrize("missing", [AFTER[0], AFTER[1]])
def test_a_row_that_is_missing_is_left_out(missing: int) -> None:
    left = left_after(2.0)
    left[missing] = np.nan
    assert "2.0 times" in said(STEPS, left)[0]


def test_nothing_is_said_without_leaps_without_lateness_or_of_noise() -> None:
    assert said(STEPS, left_after(ERROR_AFTER_STEP_RATIO - 0.01)) == []
    assert said(STEPS, left_after(ERROR_AFTER_STEP_RATIO + 0.01)) != []
    assert said(STEPS, left_after(2.0), "tendon_friction") == []
    slow = np.linspace(0.0, 1.0, 40)[:, None]
    assert said(slow, left_after(2.0)) == []
    below = np.minimum(slow, 0.0)
    below[AFTER[0] :] = COMMAND_STEP_SHARE - 0.01
    below[-1] = 1.0  # the range; the one leap, with what is left after it elsewhere
    assert said(below, left_after(2.0)) == []
