"""Turn a bayonet cap out from under its hooks, and keep it when what it closed sinks away."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from twin.soft.scene import Part, Thing
from twin.tasks.task import Outcome, Task, Track, about_z, block, eased, lifted, table

WANTED, BEGINS, TAKES = np.radians(32.0), 1.2, 0.9  # rad, s: out of the hooks from some 20 degrees on
SUNK = 15e-3  # m
TOP, HALF = 0.104, 0.016  # m: the neck that the cap stands on; half the cap's height
LUG = (3e-3, 3e-3, 2e-3)  # m, half lengths: outwards, around, along the axis
HOOK, PLAY = (6e-3, 5e-3, 2e-3), 0.5e-3  # m: what lies over a lug, and how far above it
BOSS = (0.010, 1e-3)  # m, radius and half height: what the cap stands on
OILED = 0.2  # friction of lugs on hooks, and of the boss on the neck
AZIMUTHS = np.radians([60.0, 180.0, 300.0])  # between the fingers


class Unscrew(Task):
    about = "turn a cap of 40 to 46 mm out from under three hooks (some 20 degrees) and keep it when the neck sinks away"
    success = (
        "1.4 s after the neck began to sink (50 mm/s), hooks and all, the cap is within 15 mm of its height and has moved by less "
        "than 3 mm in the last 0.4 s"
    )
    seconds: ClassVar[float] = 3.7
    leaves: ClassVar[float | None] = 2.3

    def things(self, rng: np.random.Generator) -> tuple[Thing, ...]:
        r, low = rng.uniform(0.020, 0.023), HALF - LUG[2]
        out = r + LUG[0] - 1e-3  # a millimetre within the cap
        lugs = tuple(Part("box", LUG, (out * np.cos(a), out * np.sin(a), low), about_z(a), friction=OILED) for a in AZIMUTHS)
        boss = Part("cylinder", BOSS, (0.0, 0.0, HALF + BOSS[1]), friction=OILED)
        cap = Thing(
            "object", "cylinder", (r, HALF), rng.uniform(0.012, 0.02), (0.0, 0.0, TOP - 2.0 * BOSS[1] - HALF),
            friction=rng.uniform(0.8, 1.2), parts=(*lugs, boss),
        )  # fmt: skip
        return cap, table(TOP, *(part for a in AZIMUTHS for part in hook(r, a)), friction=OILED)

    def turns(self, t: float) -> float:
        return WANTED * eased((t - BEGINS) / TAKES)

    def judge(self, track: Track) -> Outcome:
        return lifted(track, SUNK)


def hook(r: float, azimuth: float) -> tuple[Part, Part]:
    """At the lug of a cap of radius r (m): a post outside of it, and what lies over it."""
    under = 2.0 * (BOSS[1] + LUG[2]) + PLAY
    post, over = r + 2.0 * LUG[0] + 2.5e-3, r + 1e-3 + HOOK[0]
    return (
        block((1.5e-3, HOOK[1], 0.5 * under), post * np.cos(azimuth), post * np.sin(azimuth), yaw=azimuth, friction=OILED),
        block(HOOK, over * np.cos(azimuth), over * np.sin(azimuth), under, azimuth, OILED),
    )
