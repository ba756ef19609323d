"""The equilibria of one trial."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

NOT_FOUND, DIRECT, FOLLOWED = 0, 1, 2  # status of a solve


@dataclass(frozen=True)
class Path:
    """The equilibria of one trial: base tension (n, n_tendon) N, markers (n, n_marker, 3) m, path (n, n_tendon) m, q (n, nv) rad,
    temperature of springs (n, n_tendon) K, status (n,), `started`; slip states and distal tendon lengths (n_tendon, n_disk) at its
    end."""

    tension: np.ndarray
    markers: np.ndarray
    path: np.ndarray
    q: np.ndarray
    temperature: np.ndarray
    status: np.ndarray
    started: int
    slip: np.ndarray
    distal: np.ndarray
    LU: np.ndarray = field(repr=False)  # (n, nv, nv), or empty

    @property
    def unstable_start(self) -> bool:
        """Whether the loaded, untensioned robot has no stable shape near straight (a load past buckling)."""
        return self.started != DIRECT
