"""Encoder offset: the reading of a joint's angle counts from elsewhere."""

from __future__ import annotations

import numpy as np

from twin.body import Signals
from twin.body.drives.counts import joint_names
from twin.effects.base.effect import Effect
from twin.foundation.parameters import Parameter


class EncoderOffset(Effect):
    """The reading of each joint is q_read = q + offset; the servo closes its loop on its own sensor and does not feel it.

    Source: a magnet or a disk glued by eye: degrees.

    >>> from twin.body import Counts
    >>> EncoderOffset(offset_hip=0.02, n_tendon=Counts.of(1, ("hip",))).per_joint_values("offset")
    (0.02,)
    """

    id = "encoder_offset"
    per_joint = (Parameter("offset", 0.0, "rad", -0.5, 0.5, "glued by eye: degrees", scale=5e-3),)
    needs = frozenset({"encoders"})
    moves_with = "nothing: it is the same in every pose"
    plot_against = "position"

    def sense(self, true: Signals) -> Signals:
        offset = np.array(self.per_joint_values("offset"))
        if not joint_names(self.n_tendon) or "joint angle" not in true.others or not offset.any():
            return true
        return true.with_changes(others={**true.others, "joint angle": true.others["joint angle"] + offset})
