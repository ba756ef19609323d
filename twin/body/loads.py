"""The loads on a body during one trial: gravity, payload, forces, obstacles."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Push:
    """A dead force (3,) N on a backbone's disk or on silicone skin.

    The disk is the one nearest to `height`, 0 at the base to 1 at the tip. The skin point is at `height` and `azimuth` (rad) about
    the body's axis, on `finger` (from 0) of a hand. All refer to the body at rest.
    """

    force: np.ndarray
    height: float = 1.0
    azimuth: float = 0.0
    finger: int = 0


@dataclass(frozen=True)
class Loads:
    """The loads of one trial."""

    gravity: np.ndarray  # (3,) m/s^2
    payload: float = 0.0  # kg, at the tip
    force: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) N, at the tip
    wall: np.ndarray = field(default_factory=lambda: np.zeros(10))  # (10,), from `twin.effects.contact.obstacle`: a wall or post
    torque: np.ndarray = field(default_factory=lambda: np.zeros(1))  # (n,) or (1,) N m on a jaw's hinge, along its positive angle
    push: Push | None = None
    payloads: tuple[tuple[str, float], ...] = ()  # kg at sites or bodies of these names
    payload_at_zero: float = 0.0  # kg that hung on silicone when its tendons' lengths were set to zero

    @property
    def hung(self) -> float:
        """The mass (kg) of all payloads, wherever they hang."""
        return self.payload + sum(mass for _, mass in self.payloads)
