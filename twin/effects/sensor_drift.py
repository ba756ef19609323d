"""Sensor drift: what a sensor reads drifts with time."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from twin.body import Signals
from twin.body.drives.counts import of_a_model, tendon_names
from twin.effects.base.effect import Effect, FitStart
from twin.effects.base.saturating_drift import saturated_time, saturating_starts
from twin.foundation.parameters import Parameter

# Readings of an MJCF whose zeros drift, by the parameter of their rates.
READINGS = {
    "angle": ("joint angle", "joint shift"), "position": ("actuator angle", "actuator length"),
    "force": ("actuator torque", "actuator force"), "torque": ("joint torque", "joint force"), "tension": ("tendon tension",),
}  # fmt: skip


class SensorDrift(Effect):
    """Resistance of a strain sensor i = R_i (1 + rate_i (1 - exp(-levelling t)) / levelling), t the time since the first trial.

    It drifts by its rate at first and levels off as the cords settle; a negative levelling accelerates it, and without levelling it
    is R_i (1 + rate_i t). On a robot with an MJCF the zeros drift in the same way, y = y_true + rate (1 - exp(-levelling t)) /
    levelling: of joints' angles (`angle`) or torques (`torque`), of drives' positions (`position`) or forces (`force`), or of
    tendons' tensions (`tension`).

    Source: conductive rubber drifts by up to 8.3 % in 1,000 cycles of 14 h (KineSoft, Yoo et al. 2025, arXiv 2503.01078); fresh
    cords by per cents in minutes, then less as their filler settles (cords of one batch alike). An accelerating drift is a
    second-order Taylor expansion. Zeros of encoders creep where a magnet or a coupling slips, those of motor currents and load
    cells as amplifiers warm up.

    >>> import numpy as np
    >>> z = np.zeros
    >>> s = Signals(z(1), np.array([100.0]), z((1, 1)), z((1, 1)), z((1, 0, 3)), z(1), others={"sensor": np.array([[1000.0]])})
    >>> float(SensorDrift(rate_1=1e-4, n_tendon=1).sense(s).others["sensor"][0, 0])
    1010.0
    """

    id = "sensor_drift"
    parameters = (
        Parameter("levelling", 0.0, "1/s", -3e-4, 2e-2, "cords that settle in minutes to an hour; or ever faster", scale=1e-4),
    )
    per_tendon = (
        Parameter("rate", 0.0, "1/s", -1e-3, 1e-3, "per cents in minutes to per cents in days", std=5e-5, scale=2e-6),
        Parameter("position", 0.0, "1/s", -1e-2, 1e-2, "rad or m a second: of a coupling that slips", scale=1e-6),
        Parameter("force", 0.0, "1/s", -1e-1, 1e-1, "N or N m a second: warm-up of an amplifier", scale=2e-5),
    )
    per_joint = (
        Parameter("angle", 0.0, "1/s", -1e-2, 1e-2, "rad a second: of a magnet that slips", scale=2e-6),
        Parameter("torque", 0.0, "1/s", -1e-1, 1e-1, "N m a second: warm-up of a gauge", scale=2e-6),
    )
    of_tendons = (Parameter("tension", 0.0, "1/s", -1e-1, 1e-1, "N a second: warm-up of a load cell", scale=2e-5),)
    inactive_when_off = ("levelling",)
    needs = frozenset({"drifting sensors"})
    moves_with = "the time of day"
    plot_against = "clock"

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        """Return the parameters of strain sensors, or those of the readings of an MJCF."""
        if not of_a_model(n_tendon):
            return (*cls.parameters, *(replace(cls.per_tendon[0], name=f"rate_{i}") for i in range(1, n_tendon + 1)))
        tendons = (replace(p, name=f"{p.name}_{tendon}") for p in cls.of_tendons for tendon in tendon_names(n_tendon))
        return (*(p for p in super().all_parameters(n_tendon) if not p.name.startswith("rate_")), *tendons)

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Start with each cord alone and with all, or with all readings of a kind of an MJCF.

        Each with constant rates and with drifts that level off by the session's end.
        """
        table = {p.name: p for p in cls.all_parameters(n_tendon)}
        if of_a_model(n_tendon):
            kinds = ([n for n in table if n.startswith(f"{kind}_")] for kind in READINGS)
        else:
            single = [[f"rate_{i}"] for i in range(1, n_tendon + 1)]
            kinds = (*single, [name for names in single for name in names])
        plain = (FitStart({n: table[n].value + table[n].step for n in names}, tuple(names)) for names in kinds if names)
        yield from saturating_starts(plain, predicted, cls.parameters[0].high)

    @classmethod
    def form(cls, free: Collection[str]) -> str:
        return next((kind for kind in READINGS if any(n.startswith(f"{kind}_") for n in free)), "")

    def sense(self, true: Signals) -> Signals:
        if of_a_model(self.n_tendon):
            return self._with_moved_zeros(true)
        if "sensor" not in true.others:
            return true
        drifted = true.others["sensor"] * (
            1.0 + self.per_tendon_values("rate") * saturated_time(true.clock, self["levelling"])[:, None]
        )
        return true.with_changes(others={**true.others, "sensor": drifted})

    def _with_moved_zeros(self, true: Signals) -> Signals:
        """Return the readings of an MJCF from elements' rates (n_joint,), (n_drive,) or (n_tendon,)."""
        time, moved = saturated_time(true.clock, self["levelling"])[:, None], dict[str, np.ndarray]()
        for kind, groups in READINGS.items():
            rate = np.array([v for n, v in self.values.items() if n.startswith(f"{kind}_")])
            if rate.any():
                moved |= {g: true.others[g] + rate * time for g in groups if g in true.others}
        return true.with_changes(others={**true.others, **moved}) if moved else true
