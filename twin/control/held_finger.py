"""Equilibria of a soft finger with held tendons, one after another, and their response to each tendon's tension.

With K the tangent of the equilibrium, P (n, t) the force of a unit tension on the nodes and G (t, n) the slopes of the paths,

    du/dT = -K^-1 P,      dL/dT = G du/dT,      dx/dT = W du/dT,      deps/dT = (deps/du) du/dT

K is the one that Newton's method inverted last: near this shape, not at it, as long as its steps still shrink with it.
"""

from dataclasses import dataclass

import numpy as np

from twin.foundation.errors import SolveError
from twin.foundation.parallel import single_thread
from twin.mechanics.silicone import SoftStatics
from twin.mechanics.silicone.single_equilibrium import (
    MOVE_TOLERANCE,
    SoftEquilibrium,
    hang_at_rest,
    move_equilibrium,
    nodal_weight,
)
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.twin import Twin
from twin.robots.named_points import named_points


@dataclass(frozen=True)
class TendonResponse:
    """Response to the tension of each tendon.

    `points` (P, 3, t) m/N in the finger's own frame, `strain` (s, t) 1/N of the cords, `length` (t, t) m/N by which the paths grow.
    """

    points: np.ndarray
    strain: np.ndarray
    length: np.ndarray


class HeldFinger:
    """A finger in free air under held tendons, with effects on its body and along its tendons, without creep.

    One instance serves one thread.
    """

    def __init__(self, twin: Twin) -> None:
        """Hang the finger at rest. Raises DataError for a robot that is no single soft finger."""
        body = twin.robot.silicone(twin.body())
        self.body, self.route = body, twin.effect_chain.route
        self.statics = SoftStatics(body)
        self.rest = named_points(twin.robot).rest
        self._weights = body.lattice.weights(self.rest)
        self._turn = rotation_about_z(body.turn)
        self._solid = SoftEquilibrium(self.statics.arrays)
        self._burden = nodal_weight(body, twin.robot.gravity @ self._turn)
        self._shape = self._solid.undeformed()
        with single_thread():
            self._hanging = hang_at_rest(self._solid, self._shape, self._burden)
        self.shortening: np.ndarray = np.zeros(len(self._hanging))

    @property
    def tension(self) -> np.ndarray:
        """Tensions (t,) N at the tendons' bases."""
        return self._shape.tension

    @property
    def slack(self) -> np.ndarray:
        """Travel (t,) m by which each tendon may be shortened before it pulls; zero where it pulls."""
        stretched = self.route.stretch * self.tension
        return np.maximum(self._hanging - self.shortening - self._solid.tendons.path + stretched, 0.0)

    def to_finger_frame(self, points: np.ndarray) -> np.ndarray:
        """Return points (..., 3) of the base frame in the finger's own, which is turned by the mounting angle."""
        return points @ self._turn

    def hold_at(self, shortening: np.ndarray, close: float = MOVE_TOLERANCE) -> None:
        """Move to tendons shortened by (t,) m from the hanging rest, until Newton's steps are below `close` (m).

        Raises SolveError where no equilibrium is found on the way; the finger then stays where it was.
        """
        start, goal = (self.shortening, self._burden), (np.asarray(shortening, float), self._burden)
        with single_thread():
            shape, found = move_equilibrium(self._solid, self._shape, self._hanging, start, goal, self.route, close)
            if not found:  # solves the tendons again where it stays
                move_equilibrium(self._solid, self._shape, self._hanging, start, start, self.route, close)
        if not found:
            raise SolveError(f"no equilibrium on the way to tendons shortened by {np.round(1e3 * goal[0], 2).tolist()} mm")
        self._shape, self.shortening = shape, goal[0].copy()

    def points(self) -> np.ndarray:
        """Return the named points (P, 3) m in the finger's own frame."""
        return self.rest + self._weights @ self._shape.u

    def strain(self) -> np.ndarray:
        """Return the strains (s,) of the cords."""
        return self.statics.strain_slope(self._shape.u)[0]

    def tendon_response(self) -> TendonResponse:
        """Return the response to tensions here. Raises SolveError where a failed `hold_at` has left no tangent."""
        inverse, tendons = self._shape.inverse, self._solid.tendons
        if inverse is None:
            raise SolveError("the equilibrium was not found again after a failed move; start a new finger from its hanging rest")
        displacement = -(inverse @ tendons.pull.T.astype(np.float32)).astype(float)  # (n, t)
        points = (self._weights @ displacement.reshape(len(displacement) // 3, -1)).reshape(-1, 3, displacement.shape[1])
        length = tendons.gradient @ displacement - self.route.stretch * np.eye(displacement.shape[1])
        return TendonResponse(points, self.statics.strain_slope(self._shape.u)[1] @ displacement, length)
