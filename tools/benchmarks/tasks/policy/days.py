"""Bench days with an effect that nobody declared, diagnosed and calibrated: the twins that policies are trained on.

All on a built robot that hangs, as its description says. Effects leave 8 sigma after refitting the robot (the largest size of
`tools.benchmarks.diagnosis.attribution`); the tilt 4, since 12 degrees, the most there is, leave 4.6.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from tools.simulators.rod.day import Recipe, make_set
from twin.cli import Calibrate, Diagnose


class Day(NamedTuple):
    seed: int
    sigmas: float


EFFECT_DAYS = {
    "tendon_friction": Day(31012, 8.0),
    "backbone_creep": Day(31013, 8.0),
    "tip_payload": Day(31011, 8.0),
    "base_tilt": Day(31004, 4.0),
}
TWIN_KINDS = ("described", "calibrated", "diagnosed", "randomised")


def prepare(effect: str, folder: Path) -> None:
    """The day of `effect`, its report and its calibrated twin, what is missing of them."""
    day, wanted = folder / effect, EFFECT_DAYS[effect]
    if not day.is_dir():
        part = folder / f"{effect}.part"
        make_set(part, Recipe((effect,), wanted.sigmas, wanted.seed, "hanging", displacement=True))
        os.replace(part, day)
    report, calibrated = folder / f"{effect}-report", folder / f"{effect}-calibrated.toml"
    if not (report / "twin.toml").is_file():
        Diagnose(set=day, out=report, jobs=1).run()
    if not calibrated.is_file():
        Calibrate(set=day, out=calibrated, jobs=1).run()


def twin_of(kind: str, effect: str, folder: Path) -> str:
    """What `gymnasium.make` takes as the twin of one of TWIN_KINDS."""
    if kind == "described":
        return "continuum"
    return str(folder / (f"{effect}-calibrated.toml" if kind == "calibrated" else f"{effect}-report"))
