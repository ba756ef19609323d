"""A silicone finger: a cone with tendons and strain-sensing cords through it, clamped at its base."""

from dataclasses import dataclass

import numpy as np

from twin.body import Body
from twin.body.strain_cords import Cords
from twin.mechanics.silicone.material.lattice import Cone, Lattice, lattice

CONTACT_RINGS, CONTACT_AROUND = 19, 24  # points of the skin where a wall or post may press


@dataclass(frozen=True, kw_only=True)
class SoftBody(Body):
    """The finger as its effects may edit it: arrays are changed in place before it is solved.

    `paths` (t, p, 3) and `cord_paths` (s, p, 3) m: points at rest that tendons and cords connect by straight lines; `marker_rest`
    (m, 3) m: markers at rest. All are in the finger's own frame, rotated about z by `turn` (rad) against the base frame. A tendon's
    last point pulls at the silicone from `anchor` (m) to the tip.

    `shear` (c, q) and `bulk` (c,) are the moduli over those of the described silicone, of E `youngs_modulus` (Pa), nu `poisson`,
    `density` (kg/m^3) and Rayleigh's coefficient `damping` (s); `fibre` (c, q) is the stress-free length of fibres along z over the
    drawn one.
    """

    cone: Cone
    cells: int
    paths: np.ndarray
    anchor: float
    cord_paths: np.ndarray
    cords: Cords
    marker_rest: np.ndarray
    turn: float
    youngs_modulus: float
    poisson: float
    density: float
    damping: float
    shear: np.ndarray
    bulk: np.ndarray
    fibre: np.ndarray

    @property
    def lattice(self) -> Lattice:
        """Its lattice of cells."""
        return lattice(self.cone, self.cells)

    def first_mode_frequency(self) -> float:
        """Return the first bending frequency (Hz) of the tapered cantilever.

        By Rayleigh's quotient, with the shape of a uniform cantilever under its own weight.
        """
        z, w = np.polynomial.legendre.leggauss(8)
        s, w = 0.5 * (z + 1.0), 0.5 * w  # from clamp to tip
        free = self.cone.length - self.cone.clamp
        r = self.cone.radius(self.cone.clamp + s * free)
        bent, curved = s**2 * (6.0 - 4.0 * s + s**2), 12.0 * (1.0 - s) ** 2 / free**2
        stiff = self.youngs_modulus * w @ (0.25 * r**4 * curved**2)
        return float(np.sqrt(stiff / (self.density * w @ (r**2 * bent**2)))) / (2.0 * np.pi)

    def set_bending_anisotropy(self, along: float, across: float) -> None:
        """Set bending stiffnesses EI (1 + e) and EI (1 - e) about the principal axes.

        e cos 2 alpha = `along`, e sin 2 alpha = `across`. The modulus goes as 1 + 2 e cos 2 (azimuth - alpha), since cos^2 weighs
        half of it.
        """
        azimuth = self._azimuth()
        self.shear[:] *= np.maximum(1.0 - 2.0 * (along * np.cos(2 * azimuth) + across * np.sin(2 * azimuth)), 0.05)

    def set_stiffness_gradient(self, slope: float) -> None:
        """Scale the moduli by 1 + slope (s - 1/2), s the height from clamp to tip."""
        z = (self.lattice.quadrature[0][..., 2] - self.cone.clamp) / (self.cone.length - self.cone.clamp)
        self.shear[:] *= np.maximum(1.0 + slope * (z - 0.5), 0.05)
        self.bulk[:] *= np.maximum(1.0 + slope * (z.mean(axis=1) - 0.5), 0.05)

    def set_rest_curvature(self, about_x: float, about_y: float, slope: float) -> None:
        """Bend the stress-free shape by curvatures (1/m) times 1 + slope (s - 1/2), s the height from clamp to tip.

        Bent about y the fibres at +x are shorter, and the tip is towards +x.
        """
        x, y, z = np.moveaxis(self.lattice.quadrature[0], -1, 0)
        s = (z - self.cone.clamp) / (self.cone.length - self.cone.clamp)
        self.fibre[:] *= np.maximum(1.0 + (1.0 + slope * (s - 0.5)) * (about_x * y - about_y * x), 0.5)

    def move_tendon_holes(self, tendon: int, angle: float, further: float) -> None:
        """Move a tendon (from 0) about the axis by `angle` (rad) and away from it by `further` (m)."""
        x, y = self.paths[tendon, :, 0], self.paths[tendon, :, 1]
        radius, azimuth = np.hypot(x, y) + further, np.arctan2(y, x) + angle
        self.paths[tendon, :, 0], self.paths[tendon, :, 1] = radius * np.cos(azimuth), radius * np.sin(azimuth)

    def _azimuth(self) -> np.ndarray:
        points = self.lattice.quadrature[0]
        return np.arctan2(points[..., 1], points[..., 0])


def straight_line(azimuth: float, heights: tuple[float, float], radii: tuple[float, float], n: int) -> np.ndarray:
    """Return (n, 3) equally spaced points of a line at one azimuth (rad), from one height and radius (m) to another."""
    radius = np.linspace(*radii, n)
    return np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.linspace(*heights, n)])


def skin_points(cone: Cone) -> np.ndarray:
    """Return (CONTACT_RINGS * CONTACT_AROUND, 3) m on the free part of the cone's surface, ring by ring, the last at the tip."""
    z = np.linspace(cone.clamp, cone.length, CONTACT_RINGS + 1)[1:]
    t = 2.0 * np.pi * np.arange(CONTACT_AROUND) / CONTACT_AROUND
    Z, T = (v.ravel() for v in np.meshgrid(z, t, indexing="ij"))
    R = cone.radius(Z)
    return np.stack([R * np.cos(T), R * np.sin(T), Z], axis=1)
