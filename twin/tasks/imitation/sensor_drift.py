"""Sensors of a hand that drift over a day of trials, and the estimate of this drift from free motion between trials.

    R = R_aligned (1 + rate t),      rate: every cord's own, t: since the alignment

A day of trials takes the 14 h in which conductive rubber drifted by up to 8.3 %; rates are drawn so that a cord ends anywhere
between minus and plus `drift`. Before a trial the fingers bend and straighten in free air, from which
`twin/shape/alignment/drift_correction.py` estimates the drift, finger by finger.

Source: KineSoft (Yoo et al. 2025, arXiv 2503.01078), and `twin/effects/sensor_drift.py`.
"""

from collections.abc import Sequence

import numpy as np

from twin.mechanics.silicone import HandBody
from twin.mechanics.silicone.motion.scene import Scene
from twin.prediction.twin import Twin
from twin.shape.alignment.drift_correction import correct_drift
from twin.shape.sensing import SensedTrial
from twin.tasks import CONTROL_STEP
from twin.tasks.imitation.demonstrate import ENCODER_NOISE, RESISTANCE_NOISE, add_noise
from twin.tasks.imitation.episode_store import STEPS_PER_FRAME

# m by which one tendon of each pair is shortened and the other paid out; s there and back
FREE_MOTION_TRAVEL, FREE_MOTION_DURATION = 5e-3, 1.2


def drift_gains(drift: float, share: float, cords: tuple[int, int], seed: int) -> np.ndarray:
    """Return the gains (f, s) of the cords of a hand of this seed after this share of the day."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(4,)))
    return 1.0 + share * drift * rng.uniform(-1.0, 1.0, cords)


def estimate_drift_gains(
    body: HandBody, gravity: np.ndarray, twins: Sequence[Twin], gain: np.ndarray, rng: np.random.Generator
) -> np.ndarray:  # fmt: skip
    """Return the estimate (f, s) of `gain` from free motion; 1 where it shows no drift."""
    scene, rows = Scene(body, (), gravity), []
    for k in range(round(FREE_MOTION_DURATION / CONTROL_STEP)):
        bend = FREE_MOTION_TRAVEL * np.sin(np.pi * (k + 1) * CONTROL_STEP / FREE_MOTION_DURATION) ** 2
        observed = scene.step(np.full((len(twins), 2), bend), CONTROL_STEP)
        if k % STEPS_PER_FRAME == 0:
            rows.append(
                (add_noise(observed.resistance * gain, RESISTANCE_NOISE, rng), add_noise(observed.shortening, ENCODER_NOISE, rng))
            )
    resistance, shortening = (np.stack(column) for column in zip(*rows, strict=True))
    time = CONTROL_STEP * STEPS_PER_FRAME * np.arange(len(rows))
    found = []
    for k, twin in enumerate(twins):
        (corrected,), _ = correct_drift([SensedTrial("free motion", time, resistance[:, k], shortening[:, k], None)], [0.0], twin)
        found.append(resistance[0, k] / corrected.resistance[0])
    return np.stack(found)
