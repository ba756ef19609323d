"""How large an effect is: what it leaves, in sensor sigmas, after the robot's own parameters are refitted.

The residual is the logged output minus the output of the same built robot without effects, driven by the logged inputs.
Refitting is linear within plausible bounds: a minimises |e - B a|, |a_p| <= PLAUSIBLE, e = residual in sigmas, B = change
of the outputs in sigmas per prior standard deviation of each nuisance parameter; what is left is e - B a.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import lsq_linear

from tools.simulators.rod.bench import Log, as_described, logged_inputs, run
from tools.simulators.rod.design import Day
from tools.simulators.rod.effects import Effect
from tools.simulators.rod.mechanics.rod import NoEquilibrium, Rod
from tools.simulators.rod.sensors import Noise

AMPLITUDE_ERROR = 0.03  # relative error of the amplitude that is good enough
PLAUSIBLE = 2.0  # prior standard deviations that a refit may use


def stack(logs: Sequence[Log], seen_in: str) -> np.ndarray:
    field = {"marker": "markers", "displacement": "displacement", "tension": "tension"}[seen_in]
    return np.concatenate([getattr(log, field).ravel() for log in logs])


def _nuisances(rod: Rod) -> list[tuple[Rod, float]]:
    """Return the built robot with one parameter moved at a time, and the move as a share of the parameter's prior deviation."""
    first = np.eye(len(rod.pitch))[0]
    return [
        (replace(rod, youngs_modulus=1.02 * rod.youngs_modulus), 0.02 / 0.06),
        (replace(rod, hole_radius=1.01 * rod.hole_radius), 0.01 / 0.015),
        (replace(rod, disk_mass=1.03 * rod.disk_mass), 1.0),
        (replace(rod, radius_taper=rod.radius_taper + 0.005), 1.0),
        (replace(rod, pitch=rod.pitch * (1 + 0.01 * first)), 1.0),
        (replace(rod, pitch=rod.pitch * (1 + 0.01 * first[::-1])), 1.0),
    ]


@dataclass(frozen=True)
class Scale:
    """Measures effects on a thinned day: every third trial carries the same mixture of motions.

    Solved once: how outputs move, for all effects seen in the same; the robot without effects, for all that leave the inputs alone.
    """

    rod: Rod
    day: Day
    noise: Noise
    drives: tuple[Effect, ...] = ()  # how the built robot is driven, always in force
    moved_drives: tuple[tuple[Effect, float], ...] = ()  # these with one number moved at a time, as `_nuisances`
    _moved: dict[str, np.ndarray] = field(default_factory=dict)
    _described: dict[bytes, list[Log]] = field(default_factory=dict)

    def thinned(self) -> Day:
        return replace(self.day, trials=self.day.trials[::3])

    def sigma(self, seen_in: str) -> float:
        n = self.noise
        return {"marker": n.marker, "displacement": n.displacement, "tension": n.load_cell}[seen_in]

    def moves(self, seen_in: str) -> np.ndarray:
        """Change (n, p) of the output, in sigmas, per prior deviation of each nuisance parameter."""
        if seen_in not in self._moved:
            day = self.thinned()
            at = stack(run(self.rod, self.drives, day), seen_in)
            built = [(rod, self.drives, part) for rod, part in _nuisances(self.rod)]
            built += [(self.rod, (drive,), part) for drive, part in self.moved_drives]
            moved = [(stack(run(rod, drives, day), seen_in) - at) / part for rod, drives, part in built]
            self._moved[seen_in] = np.stack(moved, axis=1) / self.sigma(seen_in)
        return self._moved[seen_in]

    def described(self, logs: Sequence[Log]) -> list[Log]:
        """What the robot without effects would log, driven by the logged inputs."""
        day = self.thinned()
        inputs = b"".join(drive.tobytes() for drive in logged_inputs(logs, day))
        if inputs not in self._described:
            self._described[inputs] = as_described(self.rod, self.drives, logs, day)
        return self._described[inputs]

    def amplitude(self, effects: Sequence[Effect], seen_in: str, moves: np.ndarray) -> float:
        """RMS residual over sigma after the linear refit."""
        logs = run(self.rod, [*effects, *self.drives], self.thinned())
        residual = stack(logs, seen_in) - stack(self.described(logs), seen_in)
        residual /= self.sigma(seen_in)
        refit = lsq_linear(moves, residual, bounds=(-PLAUSIBLE, PLAUSIBLE)).x
        return float(np.sqrt(np.mean((residual - moves @ refit) ** 2)))


def scaled(effect: Effect, wanted: float, scale: Scale) -> tuple[Effect, float]:
    """The effect at the strength that leaves `wanted` sigma, and what it really leaves; stops at `effect.most`."""
    seen_in = effect.seen_by_length if scale.day.driven_by_length else effect.seen_in
    moves = scale.moves(seen_in)

    def leaves(strength: float) -> float:
        try:
            return scale.amplitude([replace(effect, strength=strength)], seen_in, moves)
        except NoEquilibrium:
            return np.inf

    low, low_at, high, high_at = 0.0, 0.0, np.inf, np.inf
    strength = min(1.0, effect.most)
    for _ in range(12):
        found = leaves(strength)
        if abs(found - wanted) < AMPLITUDE_ERROR * wanted:
            return replace(effect, strength=strength), found
        if found < wanted:
            low, low_at = strength, found
            if strength >= effect.most:
                break
            # Below the touch of a contact nothing shows: then only doubling finds it.
            guess = strength * np.clip(wanted / found, 1.1, 4.0) if found > 0.05 * wanted else 2 * strength
        else:
            high, high_at = strength, found
            guess = strength * np.clip(wanted / found, 0.1, 0.95)
        if np.isfinite(high_at) and not low < guess < high:
            guess = low + (high - low) * np.clip((wanted - low_at) / (high_at - low_at), 0.2, 0.8)
        elif np.isinf(high_at) and np.isfinite(high):
            guess = 0.5 * (low + high)
        strength = float(min(guess, effect.most))
    return replace(effect, strength=low), low_at
