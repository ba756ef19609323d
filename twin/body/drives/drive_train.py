"""Drive train: what lies between a motor's angle, current or torque and the tendons that it winds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from twin.body.route import Route
from twin.body.signals import Signals


def _empty() -> np.ndarray:
    return np.zeros((0, 1))


@dataclass(frozen=True)
class DriveTrain:
    """Spools that wind tendons over series springs with a pretension, as built against as described.

    A motor at angle a pulls tendon t in by w (a - zero), w = +-(spool radius / gear), its entry of `winding`; a command was made of
    the angle with the described w, so that

        displacement' = share displacement - w zero + stretch pretension,   share = w / w described

    with the pretension on the straight robot where the angle is at its zero, and the stretch of all tendons in the route.
    A motor's torque is the sum of w T over the tendons that it winds.
    """

    winding: np.ndarray = field(default_factory=_empty)  # (n_motor, n_tendon) m/rad, as built; of no motor (0, ...)
    share: np.ndarray = field(default_factory=lambda: np.ones(1))  # (n_tendon,), as built over as described
    shift: np.ndarray = field(default_factory=lambda: np.zeros(1))  # (n_tendon,) m, stretch pretension - w zero
    stretch: float = 0.0  # m/N
    torque_constant: np.ndarray = field(default_factory=lambda: np.ones(0))  # (n_motor,) N m/A; NaN where it is not described

    @property
    def acts(self) -> bool:
        """Whether it changes a command or a reading."""
        return bool(len(self.winding) or np.any(self.share != 1.0) or np.any(self.shift) or self.stretch)

    def deliver(self, command: Signals) -> Signals:
        """Return what reaches the tendons of a command at the motors."""
        if not (np.any(self.share != 1.0) or np.any(self.shift)):
            return command
        wound = self.share * command.displacement + self.shift
        return command.with_changes(displacement=np.where(command.driven_by_length, wound, command.displacement))

    def read(self, true: Signals) -> Signals:
        """Return the signals as seen at the motors: displacements from their zeros, angles (rad) torques (N m) and currents (A)."""
        if not self.acts:
            return true
        displacement = (true.displacement - self.shift) / self.share
        if not len(self.winding):
            return true.with_changes(displacement=displacement)
        described = self.winding / self.share
        wound = np.abs(described) > 0.0
        angle = displacement @ np.divide(1.0, described, out=np.zeros_like(described), where=wound).T / wound.sum(axis=1)
        torque = true.tension @ self.winding.T
        others = {**true.others, "motor angle": angle, "motor torque": torque, "motor current": torque / self.torque_constant}
        return true.with_changes(displacement=displacement, others=others)

    def add_to(self, route: Route) -> Route:
        """Return the route with the stretch of this train."""
        return replace(route, stretch=route.stretch + self.stretch) if self.stretch else route
