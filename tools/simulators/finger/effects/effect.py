"""The places at which an effect may reach into the finger's bench: all do nothing unless an effect says otherwise."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np

from tools.simulators.finger.mechanics.statics import Finger
from tools.simulators.finger.sensors import Built


@dataclass(frozen=True)
class Effect:
    """Base of all effects; its fields are what truth.json tells."""

    id: ClassVar[str]
    in_catalogue: ClassVar[bool] = True

    @classmethod
    def draw(cls, rng: np.random.Generator, built: Built) -> Effect:
        """An instance of plausible, clearly visible size for one built finger."""
        return cls()

    def build(self, finger: Finger, turn: np.ndarray) -> None:
        """Change the finger or its surroundings; `turn` (3, 3) leads from the finger's frame to the base frame."""

    def drive(self, command: np.ndarray) -> np.ndarray:
        """Displacement (n, 4) mm that reaches the tendons of the commanded one, in order from rest."""
        return command

    def swell(self, clock: float) -> float:
        """Unstressed volume over the first one at a time (s) of the day."""
        return 1.0

    def stretch(self, clock: np.ndarray, strain: np.ndarray) -> np.ndarray:
        """Strain (n, 4) that the conductors answer to, over the whole day."""
        return strain

    def read(self, clock: np.ndarray, resistance: np.ndarray, built: Built) -> np.ndarray:
        """Resistance (n, 4) ohm as read, over the whole day."""
        return resistance

    def truth(self) -> dict:
        return asdict(self)
