"""A hand whose sensors drift while it works, and what free motion between trials tells of it.

    R = R_aligned (1 + rate t),      rate: every cord's own, t: since the alignment

A day of trials takes the 14 h in which conductive rubber drifted by up to 8.3 %; rates are drawn so that a cord ends anywhere
between minus and plus `drift`. Before a trial the fingers bend and straighten in free air; `twin/shape/drift.py` tells
from that what is drift, finger by finger.

Source: KineSoft (Yoo et al. 2025, arXiv 2503.01078), and `twin/effects/sensor_drift.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.learn.demonstrate import ENCODER, RESISTANCE, read_bench
from twin.learn.kept import EVERY
from twin.shape.drift import steadied
from twin.shape.sensing import Sensed
from twin.soft import HandBody
from twin.soft.scene import Scene
from twin.tasks import STEP
from twin.twin import Twin

BENDS, TAKES = 5e-3, 1.2  # m by which one tendon of each pair is shortened and the other paid out, s there and back


def gains(drift: float, share: float, cords: tuple[int, int], seed: int) -> np.ndarray:
    """(f, s): by what the cords of a hand of this seed read too much after this share of the day."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(4,)))
    return 1.0 + share * drift * rng.uniform(-1.0, 1.0, cords)


def undone(
    body: HandBody, gravity: np.ndarray, twins: Sequence[Twin], gain: np.ndarray, rng: np.random.Generator
) -> np.ndarray:  # fmt: skip
    """(f, s): what free motion tells of `gain`; 1 where it tells nothing."""
    scene, rows = Scene(body, (), gravity), []
    for k in range(round(TAKES / STEP)):
        bend = BENDS * np.sin(np.pi * (k + 1) * STEP / TAKES) ** 2
        seen = scene.step(np.full((len(twins), 2), bend), STEP)
        if k % EVERY == 0:
            rows.append((read_bench(seen.resistance * gain, RESISTANCE, rng), read_bench(seen.shortening, ENCODER, rng)))
    felt, pulled = (np.stack(column) for column in zip(*rows, strict=True))
    time = STEP * EVERY * np.arange(len(rows))
    found = []
    for k, twin in enumerate(twins):
        (steady,), _ = steadied([Sensed("free motion", time, felt[:, k], pulled[:, k], None)], [0.0], twin)
        found.append(felt[0, k] / steady.resistance[0])
    return np.stack(found)
