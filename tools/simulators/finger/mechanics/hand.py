"""A hand that pushes the finger, by some wide, smooth patches of traction on the skin that come and go, or holds it between two
sharp edges; mm, N, s."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tools.simulators.finger.mechanics.mesh import radius
from tools.simulators.finger.mechanics.skin import Skin
from tools.simulators.finger.motions import REST_BEFORE_HAND, bump, ease

EDGE_WIDTHS = (2.0, 6.0)  # mm along and around: an edge across the finger, as sharp as the mesh tells


@dataclass(frozen=True)
class Hand:
    """Pushes f_i(t) g_i on patches exp(-|X - c_i|^2 / 2 s_i^2) of the undeformed skin, direction and patch kept."""

    begin: np.ndarray  # (k,) s
    end: np.ndarray  # (k,) s
    peak: np.ndarray  # (k, 3) N
    traction: np.ndarray  # (k, s) 1/mm^2, integrates to 1

    @classmethod
    def draw(cls, rng: np.random.Generator, skin: Skin, duration: float) -> Hand:
        """Pushes of 2.5 to 6 s one after another and overlapping, over in the last half second."""
        begin = np.arange(REST_BEFORE_HAND + 1.0, duration - 3.0, 2.2)
        count = len(begin)
        begin = begin + rng.uniform(-0.4, 0.4, count)
        end = np.minimum(begin + rng.uniform(2.5, 6.0, count), duration - 0.5)
        height, azimuth = rng.uniform(45.0, 98.0, count), rng.uniform(0, 2 * np.pi, count)
        centre = np.column_stack([radius(height) * np.cos(azimuth), radius(height) * np.sin(azimuth), height])
        width = rng.uniform(8.0, 15.0, (count, 1))
        patch = np.exp(-(((skin.points - centre[:, None]) ** 2).sum(-1)) / 2 / width**2)
        patch /= (patch * skin.area).sum(1, keepdims=True)
        # Inwards and askew; lower patches need more force for the same bend.
        aim = np.column_stack([-np.cos(azimuth), -np.sin(azimuth), np.zeros(count)]) + rng.normal(0.0, 0.3, (count, 3))
        force = rng.uniform(0.15, 0.5, count) * np.minimum((90.0 / (height - 10.0)) ** 1.5, 2.0)
        return cls(begin, end, force[:, None] * aim / np.linalg.norm(aim, axis=1, keepdims=True), patch)

    @classmethod
    def hold(cls, rng: np.random.Generator, skin: Skin, duration: float) -> Hand:
        """Three times, one after another: two edges that face each other, up to 25 mm apart along the finger, pressed together by
        0.5 to 2 N, one by up to 15 % harder than the other."""
        span = (duration - REST_BEFORE_HAND - 1.0) / 3.0
        begin = np.repeat(REST_BEFORE_HAND + 0.8 + span * np.arange(3), 2)
        middle, apart, side = rng.uniform(50.0, 85.0, 3), rng.uniform(-25.0, 25.0, 3), rng.uniform(0, 2 * np.pi, 3)
        height = (middle[:, None] + apart[:, None] * np.array([-0.5, 0.5])).ravel()
        azimuth = (side[:, None] + np.array([0.0, np.pi])).ravel()
        force = (rng.uniform(0.5, 2.0, 3)[:, None] * (1.0 + rng.uniform(-0.15, 0.15, (3, 1)) * np.array([-0.5, 0.5]))).ravel()
        out = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(6)])
        around = skin.points @ np.column_stack([-out[:, 1], out[:, 0], out[:, 2]]).T
        sharp = ((skin.points[:, 2, None] - height) / EDGE_WIDTHS[0]) ** 2 + (around / EDGE_WIDTHS[1]) ** 2
        patch = (np.exp(-0.5 * sharp) * (skin.points @ out.T > 0.0)).T
        patch /= (patch * skin.area).sum(1, keepdims=True)
        return cls(begin, begin + span, -force[:, None] * out, patch)

    def at(self, time: float, skin: Skin, count: int) -> np.ndarray | None:
        """Nodal forces (count, 3) N; None where the hand is off."""
        share = bump(time, self.begin, self.end) * ease(time, self.begin, self.begin + 0.5)
        if not share.any():
            return None
        return skin.load(np.einsum("k,ks,ki->si", share, self.traction, self.peak), count)
