"""A robot under sliders: its shape under what pulls it and its loads, from where it stood."""

from __future__ import annotations

import numpy as np

from twin.bench import ROOM, Inputs
from twin.effects import Drive, Loads
from twin.figure import Frames
from twin.twin import Twin, alone

TURNS = 24  # back to which friction is followed


class Live:
    """A robot whose friction remembers where its tendons turned, as long as its loads stay as they are.

    Pulls on in one direction wipe out those between, so that the turns are all that friction knows of its history; creep is as of a
    second a turn.
    """

    def __init__(self, twin: Twin, drive: Drive = Drive.TENSION) -> None:
        self._twin, self._drive, self._figure = twin, drive, twin.figure()
        self._loads: Loads | None = None
        self._turns: list[np.ndarray] = []

    def shape(self, pull: np.ndarray, loads: Loads) -> Frames:
        """One instant under pulls (n_tendon,), N as load cells read them or m as drives report. Raises SolveError where there is
        none."""
        if self._loads is None or not _same(loads, self._loads):
            self._turns, self._loads = [np.zeros_like(pull)], loads
        turns = [*(self._turns if _turned(self._turns, pull) else self._turns[:-1]), pull][-TURNS:]
        command, time = np.stack(turns), np.arange(float(len(turns)))
        inputs = Inputs("here", time, time, command, (self._drive,) * len(pull), np.full(len(turns), ROOM), loads)
        trace = alone(self._twin, inputs)
        assert trace.path is not None  # statics without one raise
        self._turns = turns
        return self._figure.frames(trace.path, self._twin.laws.surround(loads), self._twin.laws.route).at(-1)


def _same(a: Loads, b: Loads) -> bool:
    return a.payload == b.payload and np.array_equal(a.gravity, b.gravity) and np.array_equal(a.force, b.force)


def _turned(turns: list[np.ndarray], pull: np.ndarray) -> bool:
    """Whether some tendon goes another way than on its last; the first pull always counts as a turn."""
    if len(turns) < 2:
        return True
    last, now = turns[-1] - turns[-2], pull - turns[-1]
    return bool(np.any(last * now < 0.0) or np.any((last == 0.0) & (now != 0.0)))
