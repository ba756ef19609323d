"""Every effect finds its own parameters in data of the independent bench, whose law is its own.

The data come from rod equations that share no code with the twin; where the bench's law differs on purpose (creep with two times,
curvature that varies along the body, another pre-sliding, a gap instead of a wall), the tolerance says so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.conftest import Day
from tools.bench.effects import all_effects
from tools.bench.effects.effect import Effect as Truth
from twin.bench import prepare
from twin.calibrate import Fit, fit
from twin.diagnose import Settings
from twin.diagnose.evidence import Evidence
from twin.diagnose.null import ACCEPT
from twin.diagnose.objective import objective_of
from twin.diagnose.screen import dictionary, screen
from twin.diagnose.search import _fuller, weigh
from twin.effects import catalogue
from twin.robots import load
from twin.twin import Twin

HOUR = 3600.0
SAME, OTHER = 0.15, 0.35  # relative error allowed for the same law and for another (diagnosis.md, section 8)
STRENGTH = {"load_cell_bias": 4.0, "load_cell_drift": 3.0, "base_tilt": 4.0, "tip_payload": 4.0, "contact": 1.6, "time_delay": 0.8,
            "actuator_saturation": 3.5, "tendon_backlash": 4.0, "load_cell_crosstalk": 1.0}  # fmt: skip


def _each(values: dict[str, float], name: str) -> list[float]:
    return [values[f"{name}_{i}"] for i in (1, 2, 3)]


def _across(gravity: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """What a rotation vector does to gravity: the only part of a tilt that shows."""
    return Rotation.from_rotvec(rotation).as_matrix() @ gravity - gravity


def _routed(i: int, angle: float, radius: float) -> np.ndarray:
    out = np.zeros((3, 2))
    out[i] = angle, radius / 8e-3
    return out


DOWN = np.array([0.0, 0.0, 9.81])
Compare = Callable[[Truth, dict[str, float]], tuple[object, object, float]]
# effect -> (what was true, what was found, tolerance), as arrays to be compared by their distance
COMPARED: dict[str, Compare] = {
    "tendon_friction": lambda t, v: (0.1 * t.strength, v["mu"], SAME),
    "backbone_creep": lambda t, v: (0.08 * t.strength, v["amplitude"] + v["amplitude_2"], OTHER),
    "backbone_precurvature": lambda t, v: (  # varies along the body there
        0.5 * t.strength * np.array([-np.sin(t.angle), np.cos(t.angle)]), [v["about_x"], v["about_y"]], OTHER,
    ),
    "stiffness_asymmetry": lambda t, v: (np.tanh(0.05 * t.strength), np.hypot(v["along"], v["across"]), SAME),
    "stiffness_gradient": lambda t, v: (0.2 * t.strength * t.sign, v["gradient"], SAME),
    "base_tilt": lambda t, v: (
        _across(DOWN, np.radians(t.strength) * np.array(t.axis)),
        _across(DOWN, np.array([v["about_x"], v["about_y"], v["about_z"]])), SAME,
    ),
    "camera_misalignment": lambda t, v: (
        np.radians(0.7 * t.strength) * np.array(t.axis), [v["turn_x"], v["turn_y"], v["turn_z"]], SAME,
    ),
    "tip_payload": lambda t, v: (1e-3 * t.strength, v["mass"], SAME),
    # A common factor of all cells is the hole radius's, a nuisance: what differs between them is compared.
    "load_cell_gain": lambda t, v: (_differ(0.03 * t.strength * np.array(t.share)), _differ(np.array(_each(v, "gain"))), SAME),
    "load_cell_bias": lambda t, v: (_differ(0.03 * t.strength * np.array(t.share)), _differ(np.array(_each(v, "bias"))), SAME),
    "load_cell_drift": lambda t, v: (  # the bend takes part of it
        _differ(0.05 * t.strength * np.array(t.share) / HOUR), _differ(np.array(_each(v, "rate"))), OTHER,
    ),
    "tendon_routing": lambda t, v: (
        np.radians(3.0) * t.strength * t.around, v.get(f"angle_{t.tendon + 1}", 0.0), SAME,
    ),
    "time_delay": lambda t, v: (0.1 * t.strength, v["delay"], SAME),
    # Another law there: of second order, whose steady lag behind a ramp is 2 zeta tau.
    "actuator_lag": lambda t, v: (2 * t.zeta * 0.1 * t.strength, v["time"] + v["time_2"], OTHER),
    "actuator_saturation": lambda t, v: (5.0 - 0.6 * t.strength, v["limit"], SAME),  # a softer corner there
    "load_cell_crosstalk": lambda t, v: (
        0.03 * t.strength * np.array(t.share), [v[f"share_{i}_{j}"] for i in (1, 2, 3) for j in (1, 2, 3) if i != j], OTHER,
    ),
    "temperature_softening": lambda t, v: (0.005 * t.strength, v["rate"], SAME),
    "backbone_ageing": lambda t, v: (0.05 * t.strength / HOUR, v["rate"], OTHER),  # its compliance grows there
    "tendon_backlash": lambda t, v: (1e-4 * t.strength, v["gap"], OTHER),  # swaps sides by another law there
    "tendon_elasticity": lambda t, v: (5e-5 * t.strength, v["stretch"], SAME),
    "sma_cooling": lambda t, v: (0.15 * t.strength * np.mean(t.gust), v["factor"] - 1.0, SAME),
    # Starts and finishes of the phases move by different amounts there: their means are what this law knows.
    "sma_hysteresis": lambda t, v: (
        2.1 * t.strength * np.array([1.0, -t.below]), [v["shift"] + 0.5 * v["width"], v["shift"] - 0.5 * v["width"]], SAME,
    ),
    "contact": lambda t, v: (1.0, 1.0 if v["stiffness"] > 0 else 0.0, SAME),  # another obstacle there: that it is found counts
}  # fmt: skip


def _differ(x: np.ndarray) -> np.ndarray:
    return x - x.mean()


def fitted_alone(bench: Day, effect: str) -> tuple[Fit, Fit, Truth]:
    """Base and base + effect fitted to a day with that effect."""
    design = "by_current" if all_effects()[effect].by_current else "hanging"
    recording, truth = bench(effect, STRENGTH.get(effect, 2.0), design=design)
    assert truth is not None
    robot = load("continuum")
    prepared = prepare(recording, robot)
    trials = list(range(len(prepared.inputs)))
    start, objective, _ = objective_of(prepared, Twin.of(robot), trials, Settings())
    base = fit(objective, start, refresh=True)
    evidence = Evidence(prepared, trials)
    every = screen(objective, evidence, base, weigh(objective, evidence, base).discrepancy, dictionary(objective, base), top=99)
    found = [c for c in every if c.effect == effect]
    assert found, "the screening must see an effect of this size"
    fits = [fit(objective, base.model.with_effect(effect, c.start.values, c.start.free, 3), J=base.J) for c in found]
    best = weigh(objective, evidence, min(fits, key=lambda f: f.cost))
    return base, _fuller(objective, evidence, best, (effect,), ACCEPT, lambda words: None).fit, truth


@pytest.mark.parametrize("effect", sorted(catalogue()))
def test_it_recovers_its_own_parameters(bench: Day, effect: str) -> None:
    base, fitted, truth = fitted_alone(bench, effect)
    values = next(e for e in fitted.model.twin.effects if e.id == effect).values
    true, found, tolerance = COMPARED[effect](truth, values)
    distance = np.linalg.norm(np.subtract(found, true)) / np.linalg.norm(true)
    assert distance < tolerance, f"true {true}, found {found}"
    # White residuals have a mean square of one; of what stood above it the effect must take three quarters, whatever its law,
    # and nearly all where the law is the bench's own.
    before, after = (float(np.mean(f.z[f.z != 0] ** 2)) for f in (base, fitted))
    assert after - 1.0 < 0.25 * (before - 1.0)
    assert tolerance == OTHER or effect == "contact" or after < 1.15


def test_every_effect_of_the_catalogue_is_compared() -> None:
    assert set(COMPARED) == set(catalogue())
