"""The twin of a soft finger as its tendons hold it: one equilibrium after another, and what each tendon changes in it.

With K the tangent of the equilibrium, P (n, t) the force of a unit tension on the nodes and G (t, n) the slopes of the paths,

    du/dT = -K^-1 P,      dL/dT = G du/dT,      dx/dT = W du/dT,      deps/dT = (deps/du) du/dT

K is the one that Newton's method inverted last: near this shape, not at it, as long as its steps still shrink with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.errors import SolveError
from twin.factory.points import named_points
from twin.factory.solve import CLOSE, hang, march, weight_of
from twin.soft import SoftStatics
from twin.soft.solid import Solid
from twin.soft.statics import turned
from twin.threads import single_thread
from twin.twin import Twin


@dataclass(frozen=True)
class Response:
    """By tension, of every tendon: `points` (P, 3, t) m/N in the finger's own frame, `strain` (s, t) 1/N of the cords, `length`
    (t, t) m/N by which the paths grow."""

    points: np.ndarray
    strain: np.ndarray
    length: np.ndarray


class HeldFinger:
    """A finger in free air. Effects on its body and along its tendons act; it does not creep. One instance serves one thread."""

    def __init__(self, twin: Twin) -> None:
        """Hanging at rest. Raises DataError for a robot that is no single soft finger."""
        body = twin.robot.silicone(twin.body())
        self.body, self.route = body, twin.laws.route
        self.statics = SoftStatics(body)
        self.rest = named_points(twin.robot).rest
        self._weights = body.lattice.weights(self.rest)
        self._turn = turned(body.turn)
        self._solid = Solid(self.statics.parts)
        self._burden = weight_of(body, twin.robot.gravity @ self._turn)
        self._shape = self._solid.rest()
        with single_thread():
            self._hanging = hang(self._solid, self._shape, self._burden)
        self.shortening: np.ndarray = np.zeros(len(self._hanging))

    @property
    def tension(self) -> np.ndarray:
        """(t,) N at the tendons' bases."""
        return self._shape.tension

    @property
    def loose(self) -> np.ndarray:
        """(t,) m that each tendon may be shortened by before it pulls; zero where it does."""
        stretched = self.route.stretch * self.tension
        return np.maximum(self._hanging - self.shortening - self._solid.pulled.length + stretched, 0.0)

    def own(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the base frame in the finger's own, which is turned by the mounting angle."""
        return points @ self._turn

    def hold(self, shortening: np.ndarray, close: float = CLOSE) -> None:
        """Move to tendons shortened by (t,) m from the hanging rest, until Newton's steps are below `close` (m). Raises SolveError
        where no equilibrium is found on the way; it then stays where it was."""
        start, goal = (self.shortening, self._burden), (np.asarray(shortening, float), self._burden)
        with single_thread():
            shape, found = march(self._solid, self._shape, self._hanging, start, goal, self.route, close)
            if not found:  # what the tendons do is known again where it stays
                march(self._solid, self._shape, self._hanging, start, start, self.route, close)
        if not found:
            raise SolveError(f"no equilibrium on the way to tendons shortened by {np.round(1e3 * goal[0], 2).tolist()} mm")
        self._shape, self.shortening = shape, goal[0].copy()

    def points(self) -> np.ndarray:
        """(P, 3) m in the finger's own frame."""
        return self.rest + self._weights @ self._shape.u

    def strain(self) -> np.ndarray:
        """(s,) of the cords."""
        return self.statics.strain_slope(self._shape.u)[0]

    def response(self) -> Response:
        """Raises SolveError where a failed `hold` has left none."""
        inverse, pulled = self._shape.inverse, self._solid.pulled
        if inverse is None:
            raise SolveError("the finger was not found again where it stayed; start it anew from its hanging rest")
        moved = -(inverse @ pulled.pull.T.astype(np.float32)).astype(float)  # (n, t)
        points = (self._weights @ moved.reshape(len(moved) // 3, -1)).reshape(-1, 3, moved.shape[1])
        length = pulled.gradient @ moved - self.route.stretch * np.eye(moved.shape[1])
        return Response(points, self.statics.strain_slope(self._shape.u)[1] @ moved, length)
