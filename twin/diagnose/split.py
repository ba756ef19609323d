"""Which trials no fit may see: about a quarter, drawn by the seed, never one of a repeated pair while others are left."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from twin.bench import Bench
from twin.residual import repeats

SHARE = 0.25


def split(bench: Bench, seed: int, shown: Collection[int] = ()) -> tuple[list[int], list[int]]:
    """(fitted, held out) trials, both in order of the clock. Repeats stay with the fitted ones, which need them for the noise, and
    so do the trials `shown`."""
    n = len(bench.inputs)
    repeated = {k for pair in repeats(bench) for k in pair}
    wanted = max(1, round(SHARE * n))
    order = np.random.default_rng(seed).permutation(n)
    preferred = [int(k) for k in order if k not in repeated] + [int(k) for k in order if k in repeated]
    held = sorted([k for k in preferred if k not in shown][:wanted])
    return [k for k in range(n) if k not in held], held
