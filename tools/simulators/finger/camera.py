"""Skin points of a deformed finger as a distant camera sees them; mm.

A point is seen while its outward normal has a part towards the camera. Nothing else hides it: bends up to 60 degrees do not
bring one part of a finger before another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tools.simulators.finger.mechanics.body import Body
from tools.simulators.finger.mechanics.cables import interpolation
from tools.simulators.finger.mechanics.mesh import FINGER_LENGTH, radius

LOOKS = np.array([-np.sqrt(0.5), -np.sqrt(0.5), 0.0])
GRAZING = 0.01  # cosine below which a surface is not seen: the tip's face of the hanging finger
NORMAL_STEP = 0.05  # mm, the difference by which normals are taken


@dataclass(frozen=True)
class Points:
    """Material points with two neighbours in their skin, which give the normal."""

    start: np.ndarray  # (k, 3) mm
    weights: np.ndarray  # (3k, n): the points, a step around, a step along
    step: np.ndarray  # (2, k, 3) mm

    @classmethod
    def on_mantle(cls, body: Body, azimuth: np.ndarray, height: np.ndarray) -> Points:
        out = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)])
        start = radius(height)[:, None] * out + np.column_stack([np.zeros((len(height), 2)), height])
        around = NORMAL_STEP * np.column_stack([-out[:, 1], out[:, 0], np.zeros_like(azimuth)])
        along = -NORMAL_STEP * (np.array([0, 0, 1.0]) - 0.0625 * out)  # towards the base, inside the finger at its tip
        return cls._of(body, start, np.stack([along, around]))

    @classmethod
    def on_tip(cls, body: Body, azimuth: np.ndarray, distance: np.ndarray) -> Points:
        start = np.column_stack([distance * np.cos(azimuth), distance * np.sin(azimuth), np.full(len(azimuth), FINGER_LENGTH)])
        steps = np.broadcast_to(NORMAL_STEP * np.eye(3)[:2, None], (2, len(start), 3))
        return cls._of(body, start, steps)

    @classmethod
    def _of(cls, body: Body, start: np.ndarray, step: np.ndarray) -> Points:
        return cls(start, interpolation(body, np.concatenate([start, start + step[0], start + step[1]])), step)

    def seen(self, u: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (k, 3) mm in the base frame and whether the camera sees them (k,)."""
        moved = (self.weights @ u).reshape(3, -1, 3)
        first, second = self.step + moved[1:] - moved[0]
        facing = -np.cross(first, second) / NORMAL_STEP**2 @ turn.T @ LOOKS
        return (self.start + moved[0]) @ turn.T, facing > GRAZING


def scatter(rng: np.random.Generator, body: Body, count: int = 4000) -> list[Points]:
    """Points of the whole skin, evenly by area: the mantle and the tip's face."""
    slant = np.sqrt(1 + 0.0625**2)
    mantle, face = np.pi * (15 + 8.75) * 100 * slant, np.pi * 8.75**2
    on_tip = round(count * face / (face + mantle))
    # Area between base and z grows with r(z)^2.
    z = (15.0 - np.sqrt(15.0**2 - rng.uniform(size=count - on_tip) * (15.0**2 - 8.75**2))) / 0.0625
    return [
        Points.on_mantle(body, rng.uniform(0, 2 * np.pi, len(z)), z),
        Points.on_tip(body, rng.uniform(0, 2 * np.pi, on_tip), 8.75 * np.sqrt(rng.uniform(size=on_tip))),
    ]


def cloud(rng: np.random.Generator, skin: list[Points], u: np.ndarray, turn: np.ndarray, noise: float) -> np.ndarray:
    """One frame: 400 to 800 noisy points (k, 3) mm of the side that is seen, in no order."""
    positions = np.concatenate([p[s] for p, s in (points.seen(u, turn) for points in skin)])
    chosen = rng.choice(len(positions), int(rng.integers(400, 800)), replace=False)
    return positions[chosen] + noise * rng.normal(size=(len(chosen), 3))
