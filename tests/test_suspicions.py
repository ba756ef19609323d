"""Mistakes of meaning planted in a good day are refused or said before any fit; good days raise no suspicion."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.mistakes import MISTAKES, answer, planted
from twin.robots.robot import models_folder

FRIDAY = models_folder() / "continuum/samples/friday"
# What the sample has no column of, or what takes minutes to solve: python -m tools.mistakes on a set that logs them.
ELSEWHERE = [m for m in MISTAKES if m.startswith(("displacement", "room", "modulus"))]
SAID = {
    "positions in m under mm": "length unit", "positions in mm under m": "length unit", "time in ms": "time unit",
    "payload in mg for g": "payload unit", "gravity of the wrong sign": "gravity direction", "gravity in g": "gravity size",
    "mirrored marker frame": "mirrored frame", "marker frame turned by 90 degrees": "turned frame",
    "tendons 1 and 2 exchanged": "tendon order", "disks 6 and 7 exchanged": "marker order", "a trial twice": "duplicate trial",
    "a trial of another robot": "trial of another robot", "a marker that is not tracked": "dead channel",
    "origin of the markers shifted": "shifted frame", "start in minutes": "overlapping trials", "a start missing": "missing start",
    "marker noise in m under mm": "declared noise", "marker noise in um under mm": "declared noise",
}  # fmt: skip


def test_the_sample_raises_no_suspicion() -> None:
    assert answer(FRIDAY) == ("missed", [])


@pytest.mark.parametrize("mistake", [m for m in MISTAKES if m not in ELSEWHERE])
def test_a_mistake_is_refused_or_said(mistake: str, tmp_path: Path) -> None:
    found, words = answer(planted(FRIDAY, tmp_path / "set", mistake))
    assert found in ("refused", "said")
    if mistake in SAID:
        assert any(w.startswith(f"{SAID[mistake]}: ") for w in words)
