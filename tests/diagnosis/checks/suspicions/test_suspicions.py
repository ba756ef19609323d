"""Mistakes of meaning planted in a good day are refused or said before any fit; good days raise no suspicion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tools.benchmarks.diagnosis.mistakes import MISTAKES, answer, planted
from twin.measurements import Clouds, Trial, read
from twin.measurements.write import write
from twin.robots.robot import models_folder

FRIDAY = models_folder() / "continuum/samples/friday"
# What the sample has no column of: python -m tools.benchmarks.diagnosis.mistakes on a set that logs it.
FINGERS = [m for m in MISTAKES if "sensor" in m or "cloud" in m or "resistance" in m]
ELSEWHERE = [m for m in MISTAKES if m.startswith(("displacement", "room", "markers turned by 16")) or m in FINGERS]
SAID = {
    "positions in m under mm": "length unit", "positions in mm under m": "length unit", "time in ms": "time unit",
    "payload in mg for g": "payload unit", "gravity of the wrong sign": "gravity direction", "gravity in g": "gravity size",
    "mirrored marker frame": "mirrored frame", "marker frame turned by 90 degrees": "turned frame",
    "tendons 1 and 2 exchanged": "tendon order", "disks 6 and 7 exchanged": "marker order", "a trial twice": "duplicate trial",
    "a trial of another robot": "trial of another robot", "a marker that is not tracked": "dead channel",
    "origin of the markers shifted": "shifted frame", "start in minutes": "overlapping trials", "a start missing": "missing start",
    "marker noise in m under mm": "declared noise", "marker noise in um under mm": "declared noise",
}  # fmt: skip
AXES = {  # by geometry: QUARTER takes x to y, the roll x to y, y to z and z to x
    "mirrored marker frame": "x of the file is -x, y of the file is y, z of the file is z",
    "marker frame turned by 90 degrees": "x of the file is -y, y of the file is x, z of the file is z",
    "marker axes permuted": "x of the file is z, y of the file is x, z of the file is y",
}


def test_the_sample_raises_no_suspicion() -> None:
    assert answer(FRIDAY) == ("missed", [])


@pytest.mark.parametrize("mistake", [m for m in MISTAKES if m not in ELSEWHERE])
def test_a_mistake_is_refused_or_said(mistake: str, tmp_path: Path) -> None:
    found, words = answer(planted(FRIDAY, tmp_path / "set", mistake))
    assert found in ("refused", "said")
    if mistake in SAID:
        assert any(w.startswith(f"{SAID[mistake]}: ") for w in words)
    if mistake in AXES:
        assert any(AXES[mistake] in w for w in words)


@pytest.fixture(scope="module")
def finger(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five short trials of the finger bench, with clouds of points about the markers that were seen."""
    whole, folder, noise = (
        read(models_folder() / "finger/samples/drift"),
        tmp_path_factory.mktemp("finger") / "set",
        np.random.default_rng(3),
    )

    def short(trial: Trial) -> Trial:
        every = slice(None, None, 8)
        time, values = trial.time[every], {n: v[every] for n, v in trial.values.items()}
        points = np.stack([np.stack([values[f"marker_{m}_{a}"] for a in "xyz"], axis=1) for m in range(1, 11)], axis=1)
        seen = [p[np.isfinite(p).all(axis=1)] for p in points]
        clouds = [(p[:, None] + 1e-3 * noise.standard_normal((len(p), 40, 3))).reshape(-1, 3) for p in seen]
        offsets = np.cumsum([0, *(len(c) for c in clouds)])
        return replace(trial, time=time, values=values, clouds=Clouds(np.concatenate(clouds), offsets, time))

    write(replace(whole, trials=tuple(short(t) for t in whole.trials if t.label.startswith(("sweep", "circle")))), folder)
    return folder


def test_a_good_finger_raises_no_suspicion(finger: Path) -> None:
    assert answer(finger) == ("missed", [])


@pytest.mark.parametrize("mistake", FINGERS)
def test_a_mistake_on_a_finger_is_refused_or_said(mistake: str, finger: Path, tmp_path: Path) -> None:
    found, words = answer(planted(finger, tmp_path / "set", mistake))
    assert found in ("refused", "said")
    kind = "point clouds" if "cloud" in mistake else "channel order" if "exchanged" in mistake else ""
    assert any(w.startswith(kind) for w in words)
