"""The cable tool: a lumped law of its transmission, fitted at two loads and two rates, tested at the others.

The twin has no family for a geared jaw yet; the law stands here alone. With q the angle at the input, tau the load torque at the
jaw, z in [-1, 1] the slip state of friction (z' = dq / delta, clipped), the cable pair carries

    T = tau + z (f0 + mu |tau|)

and the jaw stands at

    a = a0 + ratio q + T / k + (gap / 2) tanh(T / seat)

elasticity T/k of the pair, a gap that a torque of some `seat` takes up, friction that turns both into a loop. Under a large load T
keeps its sign and the gap is never crossed: the loop shrinks with load though friction grows, as measured.

Source: Coulomb and capstan friction with linear pre-sliding (Dahl 1968); dead zone with a soft edge. Priors: ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from tools.comparisons.row import Row
from tools.importers import cable_tool
from twin.measurements import Recording, Trial

# value, std, low, high
PRIOR = {
    "a0": (1.3, 0.2, -10.0, 10.0),  # rad
    "ratio": (-0.9, 0.1, -2.0, 2.0),
    "compliance": (1.0, 1.0, 0.0, 10.0),  # rad / (N m), 1/k
    "f0": (0.015, 0.01, 0.0, 0.2),  # N m
    "mu": (0.1, 0.1, 0.0, 1.0),
    "delta": (0.05, 0.03, 0.005, 0.3),  # rad
    "gap": (0.1, 0.05, 0.0, 0.5),  # rad
    "seat": (0.015, 0.01, 0.003, 0.1),  # N m
}
PARTS = {"friction": ("f0", "mu"), "slack": ("gap",), "elasticity": ("compliance",)}
SIGMA = 0.01  # rad, what such a law may leave, correlated over a cycle: a row counts a fiftieth
CYCLE = 50.0
FITTED = {("load20", "0.1Hz"), ("load30", "0.1Hz"), ("load20", "0.3Hz"), ("load30", "0.3Hz")}
TESTED_LOADS, TESTED_RATE = ("load10", "load40"), "0.5Hz"


def compare(folder: Path) -> tuple[list[Row], Recording, None]:
    recording, dropped = cable_tool.read(folder)
    print(f"cable_tool: {len(recording.trials)} runs\n{dropped}")
    kind = {t.name: tuple(t.label.split("_")) for t in recording.trials}
    fitted = [t for t in recording.trials if kind[t.name] in FITTED]
    tested = [t for t in recording.trials if kind[t.name][0] in TESTED_LOADS or kind[t.name][1] == TESTED_RATE]
    linear = fit(fitted, frozenset(sum(PARTS.values(), ())))
    whole = fit(fitted, frozenset())
    share = error(whole, tested) / error(linear, tested)
    rows = [
        Row(
            "cable tool, output angle RMS, other loads and rate, law outside the twin", "<= 50 %", "<= 30 %",
            f"{error(linear, tested):.2f} -> {error(whole, tested):.2f} deg ({100 * share:.0f} %)", share <= 0.5, share <= 0.3,
        )
    ]  # fmt: skip
    off = {}
    for t in recording.trials:
        measured, modelled = width(t, t.values["joint_2_angle"]), width(t, predict(whole, t))
        off.setdefault(kind[t.name][0], []).append((measured, modelled))
    worst = max(abs(float(np.mean([b / a - 1.0 for a, b in pairs]))) for pairs in off.values())
    told = ", ".join(f"{k[4:]} %: {np.mean([a for a, _ in p]):.1f}/{np.mean([b for _, b in p]):.1f}" for k, p in off.items())
    rows.append(Row("  loop width by load, measured/law, deg", "within 25 %", "within 10 %", told, worst <= 0.25, worst <= 0.1))
    without = {name: error(fit(fitted, frozenset(off)), tested) for name, off in PARTS.items()}
    said = ", ".join(f"{name} {e:.2f}" for name, e in without.items())
    rows.append(
        Row(
            "  the same without one part, deg (slack or elasticity: one stands for both)",
            "named",
            "",
            f"{said} (with all {error(whole, tested):.2f})",
            None,
        )
    )
    values = ", ".join(f"{name} {value:.3g}" for name, value in whole.items())
    rows.append(Row("  parameters, SI", "", "", values, None))
    rows.append(Row("cable tool, diagnosis by the twin", "<= 5 min", "<= 1 min", "none: no family for it yet", False))
    return rows, recording, None


def predict(law: dict[str, float], trial: Trial) -> np.ndarray:
    """The jaw's angle (n,) rad."""
    q, tau = trial.values["joint_1_angle"], trial.values["joint_2_torque"]
    z, side = np.empty_like(q), 0.0
    for i, travel in enumerate(np.diff(q, prepend=q[0])):
        side = min(1.0, max(-1.0, side + travel / law["delta"]))
        z[i] = side
    T = tau + z * (law["f0"] + law["mu"] * np.abs(tau))
    return law["a0"] + law["ratio"] * q + law["compliance"] * T + 0.5 * law["gap"] * np.tanh(T / law["seat"])


def fit(trials: Sequence[Trial], off: frozenset[str]) -> dict[str, float]:
    """The law's parameters by least squares with their priors; those in `off` are zero."""
    free = [name for name in PRIOR if name not in off]
    value, std, low, high = np.array([PRIOR[name] for name in free]).T

    def law(x: np.ndarray) -> dict[str, float]:
        return (
            dict.fromkeys(off, 0.0)
            | {n: PRIOR[n][0] for n in PRIOR if n not in off}
            | dict(zip(free, value + std * x, strict=True))
        )

    def left(x: np.ndarray) -> np.ndarray:
        each = [(predict(law(x), t) - t.values["joint_2_angle"]) / (SIGMA * np.sqrt(CYCLE)) for t in trials]
        return np.concatenate([*each, x])

    return law(least_squares(left, np.zeros(len(free)), bounds=((low - value) / std, (high - value) / std)).x)


def error(law: dict[str, float], trials: Sequence[Trial]) -> float:
    """RMS of the output angle, deg."""
    return float(np.rad2deg(np.sqrt(np.mean(np.concatenate([(predict(law, t) - t.values["joint_2_angle"]) ** 2 for t in trials])))))


def width(trial: Trial, angle: np.ndarray) -> float:
    """How far the way there and the way back lie apart at the middle of the stroke, deg."""
    q = trial.values["joint_1_angle"]
    rising = np.gradient(q) > 0
    middle = np.abs(q - 0.5 * (q.min() + q.max())) < 0.1 * np.ptp(q)
    line = np.polyfit(q[middle], angle[middle], 1)
    off = angle - np.polyval(line, q)
    return float(np.rad2deg(abs(off[rising & middle].mean() - off[~rising & middle].mean())))
