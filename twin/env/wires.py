"""What effects make of commands on their way to the tendons and of signals on their way back, over an episode so far.

Effects see the whole episode, as they see a trial: lag, drift and hysteresis go on from step to step, and a delay answers with what
was commanded then.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from twin.bench import ROOM
from twin.effects import Drive, Signals
from twin.laws import Laws


class Wires:
    """Between whoever commands tendons, all in one way, and a body. Keeps what was, from the first instant on."""

    def __init__(self, laws: Laws, drive: Drive, n_tendon: int) -> None:
        self._laws, self.drives = laws, (drive,) * n_tendon
        self._acts = any(e.acts_in("command", "drive") for e in laws.effects)
        self._senses = any(e.acts_in("sense") for e in laws.effects)
        self.time: list[float] = []
        self._told: list[np.ndarray] = []
        self.base: list[np.ndarray] = []
        self._seen: list[tuple[np.ndarray, np.ndarray, np.ndarray, Mapping[str, np.ndarray]]] = []

    def driven(self, time: float, told: np.ndarray) -> np.ndarray:
        """(n_tendon,) N or m, what the tendons get of what is commanded from now on at `time` (s)."""
        self.time.append(time)
        self._told.append(np.array(told, float))
        base = self._told[-1]
        if self._acts:
            base = self._laws.drive(self._laws.command(self._signals(self._told, slice(0, None)))).command[-1]
        self.base.append(np.maximum(base, 0.0) if self.drives[0] is Drive.TENSION else base)
        return self.base[-1]

    def note(
        self, tension: np.ndarray, displacement: np.ndarray, markers: np.ndarray, others: Mapping[str, np.ndarray] | None = None
    ) -> None:
        """What is true at the time last commanded: (n_tendon,) N, (n_tendon,) m, (n_marker, 3) m as their frame has them, and
        further signals (n_port,) by group."""
        self._seen.append((tension, displacement, markers, others or {}))

    def sensed(self) -> Signals:
        """What the sensors say of what was last noted, at the last of its samples."""
        n = len(self._seen)
        rows = slice(0 if self._senses else n - 1, n)
        tension, displacement, markers, others = zip(*self._seen[rows], strict=True)
        true = self._signals(self.base, rows).with_(
            tension=np.array(tension), displacement=np.array(displacement), markers=np.array(markers),
            others={group: np.array([o[group] for o in others]) for group in others[0]},
        )  # fmt: skip
        return self._laws.sense(true) if self._senses else true

    def _signals(self, command: list[np.ndarray], rows: slice) -> Signals:
        """Of some samples, (n_tendon,) N or m each as what drives."""
        now, driving = np.array(self.time[rows]), np.array(command[rows])
        nothing, n = np.zeros_like(driving), len(driving)
        tension, displacement = (driving, nothing) if self.drives[0] is Drive.TENSION else (nothing, driving)
        return Signals(now, now, tension, displacement, np.zeros((n, 0, 3)), np.full(n, ROOM), self.drives, nothing)
