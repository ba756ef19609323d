"""Transmission error: a drive takes up more or less tendon than commanded, as its drum or servo turns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.effects.effect import Effect, Signals, Start
from twin.quantities import Parameter

TURNS = (0.5, 1.0, 1.6)  # periods a fit starts from, of the largest travel: two drive turns at most take up a robot's tendons
MOVED = 1e-4  # m of travel below which nothing of a drive's error shows
STEPS = 30  # of the inverse; each takes off the error's slope, below one where the drive runs forward at all


class TransmissionError(Effect):
    """Tendon taken up by drive i at command u = u + sine_i sin(2 pi u/turn) + cosine_i (1 - cos(2 pi u/turn)).

    A static error of each drive, the same whichever way it travels and wherever the other tendons are; `turn` is the tendon taken
    up in one period and common to all drives, which are alike. It is counted from u = 0, where the tendons were zeroed.

    Source: first harmonic of a transmission's position error. A drum of radius R whose axis is off its centre by e has
    turn = 2 pi R and amplitude e; a gear's runout, an encoder off-centre, a hobby servo's crooked potentiometer do the same.

    >>> from twin.effects import Drive
    >>> u, z = np.array([[0.0], [2.5e-3]]), np.zeros
    >>> s = Signals(z(2), z(2), 0 * u, u, z((2, 0, 3)), z(2), (Drive.DISPLACEMENT,))
    >>> law = TransmissionError({"turn": 1e-2, "sine_1": 2e-4}, 1)
    >>> (1e3 * law.drive(s).displacement[:, 0]).round(3).tolist()
    [0.0, 2.7]
    """

    id = "transmission_error"
    parameters = (Parameter("turn", 2e-2, "m", 3e-3, 0.5, "drums and horns of 1-80 mm; ours", scale=1e-3),)
    per_tendon = (
        Parameter("sine", 0.0, "m", -5e-3, 5e-3, "worn or crude drives: 0.05-0.5 mm at the tendon", std=5e-4, scale=5e-5),
        Parameter("cosine", 0.0, "m", -5e-3, 5e-3, "as sine", std=5e-4, scale=5e-5),
    )
    shape = ("turn",)
    needs = frozenset({"elasticity"})
    moves_with = "the pull of one tendon, by how far it is drawn in"

    @classmethod
    def starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[Start]:
        """The drives that move, all at once: they are of one make. Only where displacements command all tendons: where tensions do,
        a drive's error is its encoder's alone and bends nothing."""
        held = [s.displacement[:, s.by_length] for s in predicted if s.by_length.all()]
        if not held:
            return
        all_of_them = np.concatenate(held)
        travel = np.ptp(all_of_them, axis=0)
        names = tuple(f"{p.name}_{i}" for i in range(1, n_tendon + 1) if travel[i - 1] > MOVED for p in cls.per_tendon)
        farthest = float(np.abs(all_of_them).max())
        if not names:
            return
        for turn in TURNS:
            values = {n: next(p.step for p in cls.per_tendon if n.startswith(p.name)) for n in names}
            yield Start({"turn": float(np.clip(turn * farthest, 4e-3, 0.4)), **values}, ("turn", *names))

    def drive(self, command: Signals) -> Signals:
        moved = command.displacement + self._error(command.displacement)
        return command.with_(displacement=np.where(command.by_length, moved, command.displacement))

    def sense(self, true: Signals) -> Signals:
        """Of a tendon that no displacement commands its drive still reports what it believes: the inverse of `drive`."""
        believed = true.displacement
        if not true.by_length.all() and any(self[n] for n in self.values if n != "turn"):
            for _ in range(STEPS):
                believed = true.displacement - self._error(believed)
        return true.with_(displacement=np.where(true.by_length, true.displacement, believed))

    def _error(self, u: np.ndarray) -> np.ndarray:
        phase = 2.0 * np.pi * u / self["turn"]
        return self.each("sine") * np.sin(phase) + self.each("cosine") * (1.0 - np.cos(phase))
