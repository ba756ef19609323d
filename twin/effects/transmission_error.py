"""Transmission error: a drive takes up more or less tendon than commanded, as its drum or servo turns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from twin.body import Signals
from twin.effects.base.effect import Effect, FitStart
from twin.foundation.parameters import Parameter

PERIOD_SHARES = (0.5, 1.0, 1.6)  # of the largest travel: periods from which fits start; tendons take up two drive turns at most
MIN_DRIVE_TRAVEL = 1e-4  # m: less travel does not show a drive's error
INVERSE_STEPS = 30  # iterations of the inverse; each contracts by the error's slope, below one if the drive runs forward at all


class TransmissionError(Effect):
    """Tendon taken up by drive i at command u = u + sine_i sin(2 pi u/turn) + cosine_i (1 - cos(2 pi u/turn)).

    It is a static error of each drive that depends neither on the direction of travel nor on the other tendons. `turn` is the
    length of tendon taken up in one period, common to all drives, which are alike. u = 0 is where the tendons were set to zero.

    Source: first harmonic of a transmission's position error. A drum of radius R whose axis is off its centre by e has
    turn = 2 pi R and amplitude e; a gear's runout, an encoder off-centre, a hobby servo's nonlinear potentiometer do the same.

    >>> from twin.body import Drive
    >>> u, z = np.array([[0.0], [2.5e-3]]), np.zeros
    >>> s = Signals(z(2), z(2), 0 * u, u, z((2, 0, 3)), z(2), (Drive.DISPLACEMENT,))
    >>> effect = TransmissionError({"turn": 1e-2, "sine_1": 2e-4}, 1)
    >>> (1e3 * effect.drive(s).displacement[:, 0]).round(3).tolist()
    [0.0, 2.7]
    """

    id = "transmission_error"
    parameters = (Parameter("turn", 2e-2, "m", 3e-3, 0.5, "drums and horns of 1-80 mm; ours", scale=1e-3),)
    per_tendon = (
        Parameter("sine", 0.0, "m", -5e-3, 5e-3, "worn or crude drives: 0.05-0.5 mm at the tendon", std=5e-4, scale=5e-5),
        Parameter("cosine", 0.0, "m", -5e-3, 5e-3, "as sine", std=5e-4, scale=5e-5),
    )
    inactive_when_off = ("turn",)
    needs = frozenset({"elasticity"})
    moves_with = "the pull of one tendon, by how far it is drawn in"
    plot_against = "tension"

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with all drives that move at once, since they are alike, where displacements drive all tendons.

        Where tensions drive, the error is only in the encoder's reading and does not bend the robot.
        """
        lengths = [s.displacement[:, s.driven_by_length] for s in predicted if s.driven_by_length.all()]
        if not lengths:
            return
        displacement = np.concatenate(lengths)
        travel = np.ptp(displacement, axis=0)
        names = tuple(f"{p.name}_{i}" for i in range(1, n_tendon + 1) if travel[i - 1] > MIN_DRIVE_TRAVEL for p in cls.per_tendon)
        farthest = float(np.abs(displacement).max())
        if not names:
            return
        for share in PERIOD_SHARES:
            values = {n: next(p.step for p in cls.per_tendon if n.startswith(p.name)) for n in names}
            yield FitStart({"turn": float(np.clip(share * farthest, 4e-3, 0.4)), **values}, ("turn", *names))

    def drive(self, command: Signals) -> Signals:
        moved = command.displacement + self._error(command.displacement)
        return command.with_changes(displacement=np.where(command.driven_by_length, moved, command.displacement))

    def sense(self, true: Signals) -> Signals:
        """Return the displacement that a drive reports for a tendon it does not drive by length: the inverse of `drive`."""
        reported = true.displacement
        if not true.driven_by_length.all() and any(self[n] for n in self.values if n != "turn"):
            for _ in range(INVERSE_STEPS):
                reported = true.displacement - self._error(reported)
        return true.with_changes(displacement=np.where(true.driven_by_length, true.displacement, reported))

    def _error(self, u: np.ndarray) -> np.ndarray:
        phase = 2.0 * np.pi * u / self["turn"]
        return self.per_tendon_values("sine") * np.sin(phase) + self.per_tendon_values("cosine") * (1.0 - np.cos(phase))
