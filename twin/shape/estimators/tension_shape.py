"""Shape of a rod from load cells in real time, with an error bar; an unknown payload is estimated from tendon displacements.

Each uncertain number theta_k (the payload, the friction coefficient, ...) has a perturbed robot with that number one standard
deviation higher, under the same tensions: friction depends on history, so only a robot with the same history shows the effect of
theta_k. With Y_k = y_k - y the perturbed robot's difference, x the uncertain numbers in standard deviations (x ~ N(0, P), P = I at
first) and displacements d:

    d_measured - d = D x + noise,   P <- P - K D P,   x <- x + K (...)                (an extended Kalman filter on constants)
    markers = y + Y x,   cov(markers) = Y P Y' + G sigma_T^2 G'                       G = dy/dT

Without displacements P stays, and the error bar is that of the uncertain numbers and the load cells.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin.body import Loads
from twin.foundation.errors import TwinError
from twin.prediction.kinematics import LoadedRobot
from twin.prediction.twin import Twin

PAYLOAD = "payload"
FILTER_ITERATIONS = 5  # relinearisations for one reading
VARIANCE_GROWTH = 1e-5  # of the initial variance, at every reading: numbers may wander, and the filter is linearised
RECENTRE_DISTANCE = 0.25  # standard deviations: a payload found further away is given to the robots
UNMODELLED_TRAVEL = 5e-5  # m: error of a tendon displacement besides noise; the twin's own accuracy at the tendons


@dataclass(frozen=True)
class TensionShapeEstimate:
    """Markers (n_marker, 3) m with their standard deviation, and the uncertain numbers with theirs, by name, SI."""

    markers: np.ndarray
    std: np.ndarray
    parameters: Mapping[str, tuple[float, float]]


class TensionShapeFilter:
    """The running estimate of one robot's shape. Start it with the robot at rest and slack."""

    def __init__(
        self,
        twin: Twin,
        loads: Loads,
        doubts: Mapping[str, float],
        *,
        tension_noise: float = 0.01,
        displacement_noise: float = 2e-5,
    ) -> None:
        """`doubts`: standard deviations, SI, of "payload", of a robot's parameter, or of an effect's, as "tendon_friction.mu".

        Raises TwinError for a name that the twin does not have.
        """
        self.tension_noise, self.noise = tension_noise, float(np.hypot(displacement_noise, UNMODELLED_TRAVEL))
        self.names = tuple(doubts)
        self.size = np.array([doubts[n] for n in self.names])
        self.centre = np.array([_parameter_value(twin, loads, n) for n in self.names])
        self.robot = LoadedRobot(twin, loads)
        self.perturbed_robots = [LoadedRobot(*_perturb(twin, loads, n, d)) for n, d in doubts.items()]
        self.x, self.P = np.zeros(len(doubts)), np.eye(len(doubts))

    def update(self, tension: np.ndarray, displacement: np.ndarray | None = None) -> TensionShapeEstimate:
        """Update the estimate by load cells (n_tendon,) N and, where known, tendon displacements (n_tendon,) m, NaN where missing.

        Raises SolveError for tensions without an equilibrium.
        """
        for robot in (self.robot, *self.perturbed_robots):
            robot.pull(tension)
        if displacement is not None:
            self._update_uncertain(np.asarray(displacement, float))
        shape, leads = self.robot.shape(), [sister.shape() for sister in self.perturbed_robots]
        Y = np.array([s.markers - shape.markers for s in leads]).reshape(len(leads), shape.markers.size)
        G = self.robot.gradient().reshape(len(tension), -1)
        variance = np.einsum("ki,kl,li->i", Y, self.P, Y) + self.tension_noise**2 * (G**2).sum(axis=0)
        markers = shape.markers + (self.x @ Y).reshape(shape.markers.shape)
        std = np.sqrt(np.diag(self.P)) * self.size
        parameters = {n: (float(v), float(e)) for n, v, e in zip(self.names, self.centre + self.x * self.size, std, strict=True)}
        return TensionShapeEstimate(markers, np.sqrt(variance).reshape(markers.shape), parameters)

    def _update_uncertain(self, measured: np.ndarray) -> None:
        """Take one iterated step of the filter, relinearised while the payload found is far from that of the robots."""
        finite = np.isfinite(measured)
        x, P = self.x, self.P + VARIANCE_GROWTH * np.eye(len(self.P))
        for _ in range(FILTER_ITERATIONS):
            predicted = self.robot.shape().displacement
            leads = [s.shape().displacement - predicted for s in self.perturbed_robots]
            D = np.array(leads).reshape(len(leads), len(predicted)).T[finite]
            S = D @ P @ D.T + self.noise**2 * np.eye(len(D))
            K = np.linalg.solve(S, D @ P).T
            self.x = x + K @ ((measured - predicted)[finite] - D @ x)
            self.P = P - K @ D @ P
            change = self._recentre_payload()
            if change is None:
                return
            x = x - change

    def _recentre_payload(self) -> np.ndarray | None:
        """Give the robots the payload found, at least zero, and return the change in standard deviations, None where it is
        small."""
        change = np.zeros(len(self.names))
        if PAYLOAD in self.names:
            k = self.names.index(PAYLOAD)
            payload = max(0.0, self.centre[k] + self.x[k] * self.size[k])
            change[k] = (payload - self.centre[k]) / self.size[k]
            if abs(change[k]) > RECENTRE_DISTANCE:
                for n, robot in zip((None, *self.names), (self.robot, *self.perturbed_robots), strict=True):
                    robot.set_payload(payload + (self.size[k] if n == PAYLOAD else 0.0))
                self.centre[k] = payload
                self.x = self.x - change
                return change
        return None


def _parameter_value(twin: Twin, loads: Loads, name: str) -> float:
    """Return the twin's value of an uncertain number. Raises TwinError for a name that the twin does not have."""
    if name == PAYLOAD:
        return loads.payload
    effect, _, parameter = name.partition(".")
    for law in twin.effects:
        if law.id == effect and parameter in law.values:
            return law[parameter]
    nominal = {p.name: p.value for p in twin.robot.parameters}
    if name not in nominal:
        known = [PAYLOAD, *nominal, *(f"{e.id}.{p}" for e in twin.effects for p in e.values)]
        raise TwinError(f"no number {name!r} in this twin; doubts may be about {', '.join(known)}")
    return twin.values.get(name, nominal[name])


def _perturb(twin: Twin, loads: Loads, name: str, by: float) -> tuple[Twin, Loads]:
    """Return the twin and loads with one number higher by `by`."""
    value = _parameter_value(twin, loads, name) + by
    if name == PAYLOAD:
        return twin, replace(loads, payload=value)
    effect, _, parameter = name.partition(".")
    laws = tuple(type(e)({**e.values, parameter: value}, e.n_tendon) if e.id == effect else e for e in twin.effects)
    return (
        (replace(twin, effects=laws), loads)
        if laws != twin.effects
        else (replace(twin, values={**twin.values, name: value}), loads)
    )
