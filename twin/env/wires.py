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
    """Between whoever commands tendons, all in one way, and a body. Keeps what was, from the first instant on, where an effect
    looks back; else the last two instants, however long it goes on.

    Tensions and displacements go straight from one command to the next; a current holds from when it is commanded.
    """

    def __init__(self, laws: Laws, drive: Drive, n_tendon: int) -> None:
        self._laws, self.drives = laws, (drive,) * n_tendon
        self._acts = any(e.acts_in("command", "drive") for e in laws.effects)
        self._senses = any(e.acts_in("sense") for e in laws.effects)
        self.time: list[float] = []
        self._told: list[np.ndarray] = []
        self.base: list[np.ndarray] = []
        self._seen: list[tuple[np.ndarray, np.ndarray, np.ndarray, Mapping[str, np.ndarray]]] = []

    def driven(self, time: float, told: np.ndarray) -> np.ndarray:
        """(n_tendon,) N, m or A, what the tendons get at `time` (s) of what is commanded until then."""
        holds = self.drives[0] is Drive.CURRENT and bool(self.time)
        told = np.array(told, float)
        if holds:  # since the time before
            self._told[-1] = told
        self.time.append(time)
        self._told.append(told)
        last = 2 if holds else 1
        base = np.array(self._told[-last:])
        if self._acts:
            base = self._laws.drive(self._laws.command(self._signals(self._told, slice(0, None)))).command[-last:]
        self.base[len(self.time) - last :] = np.maximum(base, 0.0) if self.drives[0] is Drive.TENSION else base
        return self.base[-1]

    def note(
        self, tension: np.ndarray, displacement: np.ndarray, markers: np.ndarray, others: Mapping[str, np.ndarray] | None = None
    ) -> None:
        """What is true at the time last commanded: (n_tendon,) N, (n_tendon,) m, (n_marker, 3) m as their frame has them, and
        further signals (n_port,) by group."""
        self._seen.append((tension, displacement, markers, others or {}))
        if not (self._acts or self._senses):
            for kept in (self.time, self._told, self.base, self._seen):
                del kept[:-2]

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
        """Of some samples, (n_tendon,) N, m or A each as what drives."""
        now, driving = np.array(self.time[rows]), np.array(command[rows])
        n = len(driving)
        of = {kind: driving if kind is self.drives[0] else np.zeros_like(driving) for kind in Drive}
        return Signals(
            now, now, of[Drive.TENSION], of[Drive.DISPLACEMENT], np.zeros((n, 0, 3)), np.full(n, ROOM), self.drives,
            of[Drive.CURRENT],
        )  # fmt: skip
