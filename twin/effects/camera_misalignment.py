"""Camera misalignment: the markers' frame is turned and shifted against the base frame."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from twin.body import Signals
from twin.body.orientation import turned_by
from twin.effects.base.effect import DataNeed, Effect
from twin.foundation.parameters import Parameter

TURN_NAMES, SHIFT_NAMES = ("turn_x", "turn_y", "turn_z"), ("shift_x", "shift_y", "shift_z")


class CameraMisalignment(Effect):
    """Reported marker = R(turn) x + shift, turn a rotation vector about the base frame's origin; reported orientation R(turn) Q.

    Source: rigid-body kinematics. A hand-made registration is good to a degree or two and a millimetre or two.

    >>> camera = CameraMisalignment(shift_x=1e-3)
    >>> z = np.zeros
    >>> float(camera.sense(Signals(z(1), z(1), z((1, 3)), z((1, 3)), z((1, 1, 3)), z(1))).markers[0, 0, 0])
    0.001
    """

    id = "camera_misalignment"
    parameters = (
        *(Parameter(a, 0.0, "rad", -0.5, 0.5, "registration by hand", std=0.1, scale=0.01) for a in TURN_NAMES),
        *(Parameter(a, 0.0, "m", -0.03, 0.03, "registration by hand", std=5e-3, scale=1e-3) for a in SHIFT_NAMES),
    )
    guesses = ({**dict.fromkeys(TURN_NAMES, 0.01), **dict.fromkeys(SHIFT_NAMES, 1e-3)},)
    needs = frozenset({"markers"})
    moves_with = "the marker's position itself"
    plot_against = "position"
    hidden_without = frozenset({DataNeed.TWO_LOADS, DataNeed.THREE_MARKERS})

    def sense(self, true: Signals) -> Signals:
        turn = Rotation.from_rotvec([self[a] for a in TURN_NAMES]).as_matrix()
        seen = true.with_changes(markers=true.markers @ turn.T + [self[a] for a in SHIFT_NAMES])
        if "turn" not in true.others:
            return seen
        vector = np.array([self[a] for a in TURN_NAMES])
        return seen.with_changes(others={**true.others, "turn": turned_by(true.others["turn"], vector)})
