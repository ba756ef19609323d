"""Tip paths on the surface that tendons reach, as functions of the lap u in [0, 1]; all closed but the spiral.

A tip (rho, z) of a bend of constant curvature: rho = L (1 - cos theta)/theta, z = L sin(theta)/theta. Tendons reach two numbers,
rho and direction; a payload moves the surface by tenths of a millimetre, which no controller can follow.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

TipPath = Callable[[float], np.ndarray]


def tip_on_surface(x: float, y: float, length: float) -> np.ndarray:
    """Return the tip (3,) m over (x, y) m of a robot of `length` m. Raises ValueError beyond rho = 0.7 length."""
    rho = float(np.hypot(x, y))
    if rho < 1e-9:
        return np.array([x, y, length])
    theta = float(brentq(lambda a: length * (1.0 - np.cos(a)) / a - rho, 1e-9, 2.3))  # type: ignore[arg-type]
    return np.array([x, y, length * np.sin(theta) / theta])


def tip_paths(length: float, radius: float) -> dict[str, TipPath]:
    """Return the paths by name, within `radius` m of the axis (the figure of eight: 2 % more)."""

    def path(f: Callable[[float], tuple[float, float]]) -> TipPath:
        return lambda u: tip_on_surface(*f(u), length)

    def square(u: float) -> tuple[float, float]:
        a = radius / np.sqrt(2.0)
        corners = np.array([[a, a], [-a, a], [-a, -a], [a, -a], [a, a]])
        k = 4.0 * (u % 1.0)
        x, y = corners[int(k)] + (k - int(k)) * (corners[int(k) + 1] - corners[int(k)])
        return float(x), float(y)

    def polar(rho: float, turn: float) -> tuple[float, float]:
        return float(rho * np.cos(2 * np.pi * turn)), float(rho * np.sin(2 * np.pi * turn))

    return {
        "circle": path(lambda u: polar(radius, u)),
        "square": path(square),
        "figure of eight": path(lambda u: (radius * float(np.sin(2 * np.pi * u)), 0.6 * radius * float(np.sin(4 * np.pi * u)))),
        "spiral": path(lambda u: polar(radius * u, 2.0 * u)),
        "rose (3-D)": path(lambda u: polar(radius * (0.65 + 0.35 * float(np.cos(6 * np.pi * u))), u)),
    }
