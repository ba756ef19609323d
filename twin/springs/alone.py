"""Springs without a robot: temperature and tension along given elongations, a batch at once, by the code the robot's solve runs."""

from __future__ import annotations

import numpy as np

from twin.compiled import jit
from twin.springs.force import piece
from twin.springs.heat import heated
from twin.springs.spring import Spring


@jit
def step_along(spring, time, current, elongation, ambient, temperature, tension):
    for t in range(current.shape[0]):
        warm, e, s = ambient[t, 0], spring[t].initial_elongation, spring[t].initial_tension
        for i in range(time.size):
            if i > 0:
                warm = heated(spring, t, warm, e, current[t, i - 1], ambient[t, i - 1], time[i] - time[i - 1])
            s = max(0.0, piece(spring, t, warm, elongation[t, i], e, s)[0])
            e = elongation[t, i]
            temperature[t, i], tension[t, i] = warm, s


def pull(
    spring: Spring, time: np.ndarray, current: np.ndarray, elongation: np.ndarray, ambient: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Temperature (K) and tension (N), both (n_spring, n), of springs at elongations (n_spring, n) m and times (n,) s, under
    currents (n_spring, n) A that hold from one time to the next, from their initial state at `ambient` (K).

    >>> from twin.robots import load
    >>> cold = load("continuum").springs(1)
    >>> T, s = pull(cold, np.array([0.0, 1.0]), np.array([[1.0, 0.0]]), np.full((1, 2), 9e-3), 296.15)
    >>> T.round(2).tolist(), s.round(2).tolist()
    ([[296.15, 300.01]], [[0.7, 0.7]])
    """
    shape = np.shape(current)
    temperature, tension = np.empty(shape), np.empty(shape)
    around = np.ascontiguousarray(np.broadcast_to(ambient, shape), float)
    current, elongation = np.ascontiguousarray(current, float), np.ascontiguousarray(elongation, float)
    step_along(spring.records, np.asarray(time, float), current, elongation, around, temperature, tension)
    return temperature, tension
