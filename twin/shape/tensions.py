"""Shape from load cells in real time, with an error bar; an unknown payload is estimated along where tendon displacements are read.

Each doubtful number theta_k (the payload, the friction coefficient, ...) has a sister robot with that number one standard deviation
higher, which feels the same tensions: since friction remembers, only a robot with the same history tells what theta_k does. With
Y_k = y_k - y the sister's lead, x the doubts in standard deviations (x ~ N(0, P), P = I at first) and displacements d:

    d_measured - d = D x + noise,   P <- P - K D P,   x <- x + K (...)                (an extended Kalman filter on constants)
    markers = y + Y x,   cov(markers) = Y P Y' + G sigma_T^2 G'                       G = dy/dT

Without displacements P stays, and the error bar is what the doubts and the load cells leave.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from twin.effects import Loads
from twin.errors import TwinError
from twin.kinematics import LoadedRobot
from twin.twin import Twin

PAYLOAD = "payload"
ROUNDS = 5  # of one reading
FORGET = 1e-5  # of a doubt's first variance, at every reading: numbers may wander, and the filter is linear where nature is not
FAR = 0.25  # standard deviations: a payload found further from the robots' own is given to them
UNMODELLED = 5e-5  # m: what a tendon displacement is off by besides noise; the twin's own accuracy at the tendons


@dataclass(frozen=True)
class Estimate:
    """Markers (n_marker, 3) m with their standard deviation, the doubtful numbers with theirs, by name, SI."""

    markers: np.ndarray
    std: np.ndarray
    found: Mapping[str, tuple[float, float]]


class TensionShape:
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

        Raises TwinError for a doubt about nothing the twin has.
        """
        self.tension_noise, self.noise = tension_noise, float(np.hypot(displacement_noise, UNMODELLED))
        self.names = tuple(doubts)
        self.size = np.array([doubts[n] for n in self.names])
        self.centre = np.array([_value(twin, loads, n) for n in self.names])
        self.robot = LoadedRobot(twin, loads)
        self.sisters = [LoadedRobot(*_moved(twin, loads, n, d)) for n, d in doubts.items()]
        self.x, self.P = np.zeros(len(doubts)), np.eye(len(doubts))

    def update(self, tension: np.ndarray, displacement: np.ndarray | None = None) -> Estimate:
        """Load cells (n_tendon,) N, and tendon displacements (n_tendon,) m where known (NaN where one is not), to a shape.

        Raises SolveError for tensions without an equilibrium.
        """
        for robot in (self.robot, *self.sisters):
            robot.pull(tension)
        if displacement is not None:
            self._learn(np.asarray(displacement, float))
        shape, leads = self.robot.shape(), [sister.shape() for sister in self.sisters]
        Y = np.array([s.markers - shape.markers for s in leads]).reshape(len(leads), shape.markers.size)
        G = self.robot.gradient().reshape(len(tension), -1)
        variance = np.einsum("ki,kl,li->i", Y, self.P, Y) + self.tension_noise**2 * (G**2).sum(axis=0)
        markers = shape.markers + (self.x @ Y).reshape(shape.markers.shape)
        std = np.sqrt(np.diag(self.P)) * self.size
        found = {n: (float(v), float(e)) for n, v, e in zip(self.names, self.centre + self.x * self.size, std, strict=True)}
        return Estimate(markers, np.sqrt(variance).reshape(markers.shape), found)

    def _learn(self, measured: np.ndarray) -> None:
        """One iterated step of the filter: linearised again where the payload found is far from the one the robots carry."""
        seen = np.isfinite(measured)
        x, P = self.x, self.P + FORGET * np.eye(len(self.P))
        for _ in range(ROUNDS):
            predicted = self.robot.shape().displacement
            leads = [s.shape().displacement - predicted for s in self.sisters]
            D = np.array(leads).reshape(len(leads), len(predicted)).T[seen]
            S = D @ P @ D.T + self.noise**2 * np.eye(len(D))
            K = np.linalg.solve(S, D @ P).T
            self.x = x + K @ ((measured - predicted)[seen] - D @ x)
            self.P = P - K @ D @ P
            moved = self._recentred()
            if moved is None:
                return
            x = x - moved

    def _recentred(self) -> np.ndarray | None:
        """Give the robots the payload found, no less than none; the change in standard deviations, None where it is small."""
        moved = np.zeros(len(self.names))
        if PAYLOAD in self.names:
            k = self.names.index(PAYLOAD)
            payload = max(0.0, self.centre[k] + self.x[k] * self.size[k])
            moved[k] = (payload - self.centre[k]) / self.size[k]
            if abs(moved[k]) > FAR:
                for n, robot in zip((None, *self.names), (self.robot, *self.sisters), strict=True):
                    robot.burden(payload + (self.size[k] if n == PAYLOAD else 0.0))
                self.centre[k] = payload
                self.x = self.x - moved
                return moved
        return None


def _value(twin: Twin, loads: Loads, name: str) -> float:
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


def _moved(twin: Twin, loads: Loads, name: str, by: float) -> tuple[Twin, Loads]:
    value = _value(twin, loads, name) + by
    if name == PAYLOAD:
        return twin, replace(loads, payload=value)
    effect, _, parameter = name.partition(".")
    laws = tuple(type(e)({**e.values, parameter: value}, e.n_tendon) if e.id == effect else e for e in twin.effects)
    return (
        (replace(twin, effects=laws), loads)
        if laws != twin.effects
        else (replace(twin, values={**twin.values, name: value}), loads)
    )
