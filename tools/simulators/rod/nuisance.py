"""How a built robot differs from its description without anything being wrong with it.

E +-6 %, hole radius +-1.5 %, disk mass +-3 %, spacing +-1 % each with the total within +-0.1 %, markers up to 0.2 mm off
along the disk's axis, radius taper up to 1 % base to tip. Gaussian numbers are cut at two standard deviations.
"""

from dataclasses import replace

import numpy as np

from tools.simulators.rod.mechanics.rod import Rod


def built(rng: np.random.Generator, nominal: Rod | None = None, spread: float = 1.0) -> Rod:
    """Draw one built robot; `spread` widens every tolerance, 0 is the robot as described."""
    rod = nominal or Rod()
    N = len(rod.pitch)

    def normal(size: int | None = None) -> np.ndarray:
        return np.clip(rng.normal(size=size), -2.0, 2.0)

    pitch = rod.pitch * (1 + 0.01 * spread * normal(N))
    pitch *= rod.length / pitch.sum() * (1 + 0.001 * spread * rng.uniform(-1, 1))
    return replace(
        rod,
        pitch=pitch,
        youngs_modulus=rod.youngs_modulus * float(1 + 0.06 * spread * normal()),
        radius_taper=spread * float(rng.uniform(0.0, 0.01)),
        disk_mass=rod.disk_mass * float(1 + 0.03 * spread * normal()),
        hole_radius=rod.hole_radius * float(1 + 0.015 * spread * normal()),
        marker_offset=spread * rng.uniform(-0.2e-3, 0.2e-3, N),
    )
