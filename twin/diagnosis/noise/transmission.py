"""What of the readings' noise a law lets through to the robot: a lag, a delay between rows and a creep average it away.

The robot has felt none of it, so that |z|^2 falls by what a law keeps from it though the law need not be true. A law's drives are
probed: with w_ij the change of row i's drive by a unit of reading j, sum_j w_ij^2 of the noise's square is passed on. What all rows
feel alike, sum_j w_ij, is no matter of noise: a gain is taken up by the robot's stiffness.
"""

from dataclasses import replace

import numpy as np

from twin.diagnosis.thresholds import DRIVE_END_RATIO, PROBED_ROWS
from twin.prediction.prepared import Inputs
from twin.prediction.twin import Twin


def transmitted_noise(twin: Twin, inputs: Inputs, noise: np.ndarray, antagonists: bool = False) -> np.ndarray:
    """Share (n, n_tendon) of the square of the readings' noise (n_tendon,) that moves the robot, of what a lasting change moves it.

    A body that creeps feels noise at once, by 1, and what lasts by 1 + sum_j a_j (1 - exp(-t / tau_j)), here in the trial's mean.
    """
    laws, command = twin.effect_chain, inputs.command
    share = np.ones_like(command)
    if any(effect.acts_in("command", "drive") for effect in twin.effects):

        def driven(by: np.ndarray | float) -> np.ndarray:
            read = replace(inputs, command=command + by * noise).signals.with_changes(antagonists=antagonists)
            return laws.drive(laws.command(read)).command

        at, rows = driven(0.0), np.arange(len(command))[:, None] % PROBED_ROWS
        lasting = (driven(1.0) - at) ** 2
        whole = np.maximum(lasting, DRIVE_END_RATIO**2 * lasting.max(axis=0))
        square = sum((driven(1.0 * (rows == first)) - at) ** 2 for first in range(PROBED_ROWS))
        np.divide(square, whole, out=share, where=whole > 0.0)
    time = inputs.time - inputs.time[0]
    late = sum(a * -np.expm1(-time / tau).mean() for a, tau in zip(laws.creep.amplitude, laws.creep.time, strict=True))
    return np.minimum(share, 1.0) / (1.0 + late) ** 2
