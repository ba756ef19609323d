"""Single equilibria of the nominal or a built finger, to hold other solvers against; mm, N, MPa."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tools.simulators.finger.mechanics.cables import interpolation
from tools.simulators.finger.mechanics.statics import Finger, Load

HANGING_FINGER = (0.0, 0.0, 9.81)


@dataclass(frozen=True)
class Equilibrium:
    tip: np.ndarray  # (3,) mm, centre of the tip's face
    centreline: np.ndarray  # (19, 3) mm, of z = 10, 15 .. 100 mm
    strain: np.ndarray  # (4,) of the cords
    tension: np.ndarray  # (4,) N at the base
    shortening: np.ndarray  # (4,) mm, of each tendon against its rest length


def equilibrium(
    finger: Finger,
    tension: Sequence[float] | None = None,
    shortening: Sequence[float] | None = None,
    side: Sequence[float] = (0.0, 0.0, 0.0),
    gravity: tuple[float, float, float] = HANGING_FINGER,
    steps: int = 4,
) -> Equilibrium:
    """The finger under tensions (4,) N or shortenings (4,) mm and a force `side` (3,) N spread evenly over the tip's face."""
    rest = finger.hanging(gravity)
    lengths = rest.length.sum(axis=1)
    tip = finger.skin.points[:, 2] > 100 - 1e-9
    spread = np.where(tip[:, None], np.asarray(side, float) / finger.skin.area[tip].sum(), 0.0)
    state = rest
    for part in np.arange(1, steps + 1) / steps:
        state = finger.step(
            state,
            Load(
                np.full(4, np.inf) if shortening is None else lengths - part * np.asarray(shortening, float),
                np.zeros(4) if tension is None else part * np.asarray(tension, float),
                gravity,
                finger.skin.load(part * spread, len(state.u)),
            ),
        )
    axis = np.column_stack([np.zeros((19, 2)), np.linspace(10, 100, 19)])
    line = axis + interpolation(finger.body, axis) @ state.u
    return Equilibrium(line[-1], line, finger.cords.strain(state.u), state.tension, lengths - state.length.sum(axis=1))
