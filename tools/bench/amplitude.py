"""How large an effect is: what it leaves, in sensor sigmas, after the robot's own parameters are refitted.

The residual is the logged output minus the output of the same built robot without effects, driven by the logged inputs.
Refitting is linear: the residual's projection on the change of the outputs with each nuisance parameter is taken out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tools.bench.bench import Log, as_described, run
from tools.bench.design import Day
from tools.bench.effects import Effect
from tools.bench.rod import NoEquilibrium, Rod
from tools.bench.sensors import Noise

CLOSE = 0.03  # relative error of the amplitude that is good enough


def _stack(logs: Sequence[Log], seen_in: str) -> np.ndarray:
    field = {"marker": "markers", "displacement": "displacement", "tension": "tension"}[seen_in]
    return np.concatenate([getattr(log, field).ravel() for log in logs])


def _nuisances(rod: Rod) -> list[Rod]:
    """The built robot with one parameter moved at a time; the first two pitches stand for all."""
    bump = np.eye(len(rod.pitch))
    return [
        replace(rod, youngs_modulus=1.02 * rod.youngs_modulus),
        replace(rod, hole_radius=1.01 * rod.hole_radius),
        replace(rod, disk_mass=1.03 * rod.disk_mass),
        replace(rod, radius_taper=rod.radius_taper + 0.005),
        replace(rod, pitch=rod.pitch * (1 + 0.01 * bump[0])),
        replace(rod, pitch=rod.pitch * (1 + 0.01 * bump[-1])),
    ]


@dataclass(frozen=True)
class Scale:
    """Measures effects on a thinned day: every third trial carries the same mixture of motions."""

    rod: Rod
    day: Day
    noise: Noise

    def thinned(self) -> Day:
        return replace(self.day, trials=self.day.trials[::3])

    def basis(self, seen_in: str) -> np.ndarray:
        """Orthonormal directions (n, p) of the nuisance parameters in the output."""
        day = self.thinned()
        at = _stack(run(self.rod, [], day), seen_in)
        moved = np.stack([_stack(run(rod, [], day), seen_in) - at for rod in _nuisances(self.rod)], axis=1)
        return np.linalg.qr(moved)[0]

    def amplitude(self, effects: Sequence[Effect], seen_in: str, basis: np.ndarray) -> float:
        """RMS residual over sigma after the linear refit."""
        day = self.thinned()
        logs = run(self.rod, effects, day)
        residual = _stack(logs, seen_in) - _stack(as_described(self.rod, logs, day), seen_in)
        left = residual - basis @ (basis.T @ residual)
        sigma = {
            "marker": self.noise.marker,
            "displacement": self.noise.displacement,
            "tension": self.noise.load_cell,
        }[seen_in]
        return float(np.sqrt(np.mean(left**2)) / sigma)


def scaled(effect: Effect, wanted: float, scale: Scale) -> tuple[Effect, float]:
    """The effect at the strength that leaves `wanted` sigma, and what it really leaves; stops at `effect.most`."""
    seen_in = effect.seen_by_length if scale.day.by_length else effect.seen_in
    basis = scale.basis(seen_in)

    def leaves(strength: float) -> float:
        try:
            return scale.amplitude([replace(effect, strength=strength)], seen_in, basis)
        except NoEquilibrium:
            return np.inf

    low, low_at, high, high_at = 0.0, 0.0, np.inf, np.inf
    strength = min(1.0, effect.most)
    for _ in range(12):
        found = leaves(strength)
        if abs(found - wanted) < CLOSE * wanted:
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
