"""The tension along each tendon of a chain as it lies, for whoever shows it."""

from __future__ import annotations

import numpy as np

from twin.compiled import jit
from twin.equilibrium.chain import laid, lay, pass_on, shorter


@jit
def tension_along(chain, law, tension, z, s, out):
    """To out (n_tendon, n_piece) N what base tensions (n_tendon,) N are in each piece; slip (z, s) of `State` goes on to there."""
    nt, most = out.shape
    room, now = laid(most), np.zeros(most)
    for t in range(nt):
        tendon = shorter(room, chain.pieces[t])
        lay(chain, t, tendon, now)
        pass_on(tension[t], law, tendon, z[t], s[t], now, z[t])
        for d in range(tendon.T.size):
            s[t, d], out[t, d] = now[d], tendon.T[d]
