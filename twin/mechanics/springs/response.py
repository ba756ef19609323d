"""Temperature and tension of SMA springs along given elongations, without a robot, by the functions of the robot's solve."""

import numpy as np

from twin.body.drives.spring import Spring
from twin.foundation.compiled import jit
from twin.mechanics.springs.force import tension_piece
from twin.mechanics.springs.heat import heated_temperature


@jit
def integrate_springs(spring, time, current, elongation, ambient, temperature, tension):
    """Fill `temperature` (n_spring, n) K and `tension` (n_spring, n) N, step by step from the springs' initial state."""
    for t in range(current.shape[0]):
        warm, e, s = ambient[t, 0], spring[t].initial_elongation, spring[t].initial_tension
        for i in range(time.size):
            if i > 0:
                warm = heated_temperature(spring, t, warm, e, current[t, i - 1], ambient[t, i - 1], time[i] - time[i - 1])
            s = max(0.0, tension_piece(spring, t, warm, elongation[t, i], e, s)[0])
            e = elongation[t, i]
            temperature[t, i], tension[t, i] = warm, s


def spring_response(
    spring: Spring, time: np.ndarray, current: np.ndarray, elongation: np.ndarray, ambient: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Return temperature (K) and tension (N), both (n_spring, n), of springs that follow given elongations (n_spring, n) m.

    Times (n,) s; currents (n_spring, n) A hold from one time to the next. The springs start in their initial state at `ambient`
    (K).

    >>> from twin.robots import load
    >>> cold = load("continuum").springs(1)
    >>> T, s = spring_response(cold, np.array([0.0, 1.0]), np.array([[1.0, 0.0]]), np.full((1, 2), 9e-3), 296.15)
    >>> T.round(2).tolist(), s.round(2).tolist()
    ([[296.15, 300.01]], [[0.7, 0.7]])
    """
    shape = np.shape(current)
    temperature, tension = np.empty(shape), np.empty(shape)
    around = np.ascontiguousarray(np.broadcast_to(ambient, shape), float)
    current, elongation = np.ascontiguousarray(current, float), np.ascontiguousarray(elongation, float)
    integrate_springs(spring.records, np.asarray(time, float), current, elongation, around, temperature, tension)
    return temperature, tension
