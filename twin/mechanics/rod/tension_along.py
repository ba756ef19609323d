"""Tension along each tendon of a chain, for display."""

import numpy as np

from twin.foundation.compiled import jit
from twin.mechanics.rod.balance.chain import apply_friction, empty_tendon_path, first_pieces, trace_tendon


@jit
def tension_along(chain, law, tension, z, s, out):
    """Fill `out` (n_tendon, n_piece) N with the tension of each piece under base tensions (n_tendon,) N.

    The slip states and distal lengths (z, s) of `ChainState` are advanced to the present shape.
    """
    nt, most = out.shape
    longest_path, distal = empty_tendon_path(most), np.zeros(most)
    for t in range(nt):
        tendon = first_pieces(longest_path, chain.n_piece[t])
        trace_tendon(chain, t, tendon, distal)
        apply_friction(tension[t], law, tendon, z[t], s[t], distal, z[t])
        for d in range(tendon.T.size):
            s[t, d], out[t, d] = distal[d], tendon.T[d]
