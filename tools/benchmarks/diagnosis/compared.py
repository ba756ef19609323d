"""What was true and what was found of each effect, as numbers that can be compared: the bench's parameters are not the twin's."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

HOUR = 3600.0
SAME_LAW, OTHER_LAW = 0.15, 0.35  # relative error allowed for the same law and for another (diagnosis.md, section 8)


def _each(values: dict[str, float], name: str) -> list[float]:
    return [values[f"{name}_{i}"] for i in (1, 2, 3)]


def _across(gravity: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """What a rotation vector does to gravity: the only part of a tilt that shows."""
    return Rotation.from_rotvec(rotation).as_matrix() @ gravity - gravity


TRAVEL = np.repeat(np.linspace(-6e-3, 1e-2, 33)[:, None], 3, axis=1)  # m, of the bench's motors


def _wave(taken_up: np.ndarray) -> np.ndarray:
    """What drives take up beside their command over `TRAVEL`, less a gain of all, which is the hole radius's, a nuisance."""
    off = taken_up - TRAVEL
    return off - TRAVEL * (off * TRAVEL).sum() / (TRAVEL**2).sum()


def _harmonic(v: dict[str, float]) -> np.ndarray:
    phase = 2.0 * np.pi * TRAVEL / v["turn"]
    return TRAVEL + _each(v, "sine") * np.sin(phase) + _each(v, "cosine") * (1.0 - np.cos(phase))


PULLS = np.linspace(0.2, 4.0, 20)  # N, of the bench's days
DOWN = np.array([0.0, 0.0, 9.81])
# an effect of the bench with fields of its own, the twin's parameters of it
Compare = Callable[[Any, dict[str, float]], tuple[object, object, float]]
# effect -> (what was true, what was found, tolerance), as arrays to be compared by their distance
COMPARED: dict[str, Compare] = {
    "tendon_friction": lambda t, v: (0.1 * t.strength, v["mu"], SAME_LAW),
    "backbone_creep": lambda t, v: (0.08 * t.strength, v["amplitude"] + v["amplitude_2"], OTHER_LAW),
    "backbone_precurvature": lambda t, v: (  # varies along the body there
        0.5 * t.strength * np.array([-np.sin(t.angle), np.cos(t.angle)]), [v["about_x"], v["about_y"]], OTHER_LAW,
    ),
    "stiffness_asymmetry": lambda t, v: (np.tanh(0.05 * t.strength), np.hypot(v["along"], v["across"]), SAME_LAW),
    "stiffness_gradient": lambda t, v: (0.2 * t.strength * t.sign, v["gradient"], SAME_LAW),
    "base_tilt": lambda t, v: (
        _across(DOWN, np.radians(t.strength) * np.array(t.axis)),
        _across(DOWN, np.array([v["about_x"], v["about_y"], v["about_z"]])), SAME_LAW,
    ),
    "camera_misalignment": lambda t, v: (
        np.radians(0.7 * t.strength) * np.array(t.axis), [v["turn_x"], v["turn_y"], v["turn_z"]], SAME_LAW,
    ),
    "tip_payload": lambda t, v: (1e-3 * t.strength, v["mass"], SAME_LAW),
    # A common factor of all cells is the hole radius's, a nuisance: what differs between them is compared.
    "load_cell_gain": lambda t, v: (_differ(0.03 * t.strength * np.array(t.share)), _differ(np.array(_each(v, "gain"))), SAME_LAW),
    "load_cell_bias": lambda t, v: (_differ(0.03 * t.strength * np.array(t.share)), _differ(np.array(_each(v, "bias"))), SAME_LAW),
    "load_cell_drift": lambda t, v: (  # its bend there, its levelling here, take part of it
        _differ(0.05 * t.strength * np.array(t.share) / HOUR), _differ(np.array(_each(v, "rate"))), OTHER_LAW,
    ),
    "tendon_routing": lambda t, v: (
        np.radians(3.0) * t.strength * t.around, v.get(f"angle_{t.tendon + 1}", 0.0), SAME_LAW,
    ),
    "time_delay": lambda t, v: (0.1 * t.strength, v["delay"], SAME_LAW),
    "actuator_lag": lambda t, v: (2 * t.zeta * 0.1 * t.strength, v["time"], SAME_LAW),  # the steady lag behind a ramp
    "actuator_saturation": lambda t, v: (  # a softer corner there
        *((16e-3 - 1.6e-3 * t.strength, v["stroke"]) if any(_each(v, "loss")) else (5.0 - 0.6 * t.strength, v["limit"])), SAME_LAW,
    ),
    "load_cell_crosstalk": lambda t, v: (
        0.03 * t.strength * np.array(t.share), [v[f"share_{i}_{j}"] for i in (1, 2, 3) for j in (1, 2, 3) if i != j], OTHER_LAW,
    ),
    "temperature_softening": lambda t, v: (0.005 * t.strength, v["rate"], SAME_LAW),
    "backbone_ageing": lambda t, v: (0.05 * t.strength / HOUR, v["rate"], OTHER_LAW),  # its compliance grows there
    # It swaps sides by another law there.
    "tendon_backlash": lambda t, v: (1e-4 * t.strength * np.array(t.worn), v["gap"] + np.array(_each(v, "gap")), OTHER_LAW),
    "tendon_elasticity": lambda t, v: (  # its toe is a hyperbola there
        t.strength * (5e-5 * PULLS + t.toe * PULLS / (PULLS + t.half)),
        v["stretch"] * PULLS - v["toe"] * np.expm1(-PULLS / v["toe_tension"]), OTHER_LAW if t.toe else SAME_LAW,
    ),
    "drive_zero": lambda t, v: (-1e-4 * t.strength * np.array(t.share), v["length"] + np.array(_each(v, "length")), OTHER_LAW),
    # A common factor of all spools is the hole radius's.
    "actuator_gain": lambda t, v: (_differ(-0.02 * t.strength * np.array(t.share)), _differ(np.array(_each(v, "gain"))), SAME_LAW),
    "transmission_error": lambda t, v: (_wave(t.pull(TRAVEL)), _wave(_harmonic(v)), OTHER_LAW),  # a whole drum there
    "sma_cooling": lambda t, v: (0.15 * t.strength * np.mean(t.gust), v["factor"] - 1.0, SAME_LAW),
    # Starts and finishes of the phases move by different amounts there: their means are what this law knows.
    "sma_hysteresis": lambda t, v: (
        2.1 * t.strength * np.array([1.0, -t.below]), [v["shift"] + 0.5 * v["width"], v["shift"] - 0.5 * v["width"]], SAME_LAW,
    ),
    "contact": lambda t, v: (1.0, 1.0 if v["stiffness"] > 0 else 0.0, SAME_LAW),  # another obstacle there: that it is found counts
}  # fmt: skip


# effect -> the twin's parameters that mean what one of the bench's does, and their true values (SI), of its fields as written down
COMPARABLE: dict[str, Callable[[dict[str, Any]], dict[str, float]]] = {
    "tendon_friction": lambda t: {"mu": 0.1 * t["strength"]},
    "stiffness_gradient": lambda t: {"gradient": 0.2 * t["strength"] * t["sign"]},
    "tip_payload": lambda t: {"mass": 1e-3 * t["strength"]},
    "time_delay": lambda t: {"delay": 0.1 * t["strength"]},
    "temperature_softening": lambda t: {"rate": 0.005 * t["strength"]},
    "tendon_elasticity": lambda t: {} if t["toe"] else {"stretch": 5e-5 * t["strength"]},
    "tendon_routing": lambda t: {f"angle_{t['tendon'] + 1}": np.radians(3.0) * t["strength"] * t["around"]},
    "camera_misalignment": lambda t: {
        f"turn_{a}": float(np.radians(0.7 * t["strength"]) * x) for a, x in zip("xyz", t["axis"], strict=True)
    },
}  # fmt: skip


def _differ(x: np.ndarray) -> np.ndarray:
    return x - x.mean()


def distance(true: object, found: object) -> float:
    """|found - true| / |true|, of numbers or arrays."""
    return float(np.linalg.norm(np.subtract(found, true)) / np.linalg.norm(true))  # type: ignore[arg-type]
