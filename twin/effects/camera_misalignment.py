"""Camera misalignment: the marker frame is turned and shifted against the base."""

from __future__ import annotations

from scipy.spatial.transform import Rotation

from twin.effects.effect import Effect, Signals
from twin.quantities import Parameter

TURN, SHIFT = ("turn_x", "turn_y", "turn_z"), ("shift_x", "shift_y", "shift_z")


class CameraMisalignment(Effect):
    """Reported marker = R(turn) x + shift, with turn a rotation vector about the base frame's origin.

    Source: rigid-body kinematics. A hand-made registration is good to a degree or two and a millimetre or two.

    >>> import numpy as np
    >>> camera = CameraMisalignment(shift_x=1e-3)
    >>> z = np.zeros
    >>> float(camera.sense(Signals(z(1), z(1), z((1, 3)), z((1, 3)), z((1, 1, 3)), z(1))).markers[0, 0, 0])
    0.001
    """

    id = "camera_misalignment"
    parameters = (
        *(Parameter(a, 0.0, "rad", -0.5, 0.5, "registration by hand", std=0.1, scale=0.01) for a in TURN),
        *(Parameter(a, 0.0, "m", -0.03, 0.03, "registration by hand", std=5e-3, scale=1e-3) for a in SHIFT),
    )
    guesses = ({**dict.fromkeys(TURN, 0.01), **dict.fromkeys(SHIFT, 1e-3)},)
    needs = frozenset({"markers"})
    moves_with = "the marker's position itself"

    def sense(self, true: Signals) -> Signals:
        turn = Rotation.from_rotvec([self[a] for a in TURN]).as_matrix()
        return true.with_(markers=true.markers @ turn.T + [self[a] for a in SHIFT])
