"""A load that depends on the pose, described: a magnet of the independent bench beside the robot, and what is none."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recorded_days import half, recorded_day
from tools.simulators.rod.effects.unknown import Magnet
from twin.diagnosis import Settings
from twin.diagnosis.calibration.first_calibration import objective_of
from twin.diagnosis.calibration.fit import fit
from twin.diagnosis.evidence.discrepancy import Evidence
from twin.diagnosis.evidence.scored_model import score_model
from twin.diagnosis.explain.pose_dependent_force import PoseDependentForce, pose_dependent_force
from twin.diagnosis.fit_context import FitContext
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load


def found_on(effect: str | None, strength: float) -> tuple[PoseDependentForce | None, np.ndarray, object]:
    """What a calibrated robot's error on a day is, seen as a force on the tip; and where the tip is."""
    recording, truth = recorded_day(effect, strength, seed=11, design="default")
    robot = load("continuum")
    prepared = prepare(half(recording), robot)
    trials = list(range(len(prepared.inputs)))
    start, objective, _ = objective_of(prepared, Twin.of(robot), trials, Settings())
    study = FitContext(objective, Evidence(prepared, trials, objective.whitener.noise.drive))
    final = score_model(study, fit(objective, start, refresh=True))
    tip = np.concatenate([final.fit.evaluation.traces[k].true.markers[:, -1] for k in trials])
    return pose_dependent_force(study, final), tip, truth


@pytest.mark.parametrize("strength", [2.0, 4.0])
def test_a_magnet_is_described_as_what_it_does(strength: float) -> None:
    """F = 1e-6 N m^3 strength d / (d^2 + (20 mm)^2)^2 towards it, which a law of first order follows in part: by how
    much it changes is right to a factor of two and a half."""
    found, tip, magnet = found_on("magnet", strength)
    assert isinstance(magnet, Magnet)
    assert found is not None
    d = np.array(magnet.point) - tip
    true = 1e-6 * magnet.strength * d / ((d**2).sum(axis=1, keepdims=True) + 0.02**2) ** 2
    change = float(np.quantile(np.linalg.norm(true - true.mean(axis=0), axis=1), 0.9))
    assert change / 2.5 < found.change < 2.5 * change
    assert 0.5 <= found.share <= 1.0
    assert f"{100 * found.share:.0f} % of it: a magnet" in found.words()


@pytest.mark.parametrize(("effect", "strength"), [(None, 0.0), ("helix", 2.0), ("soft_spot", 2.0), ("tip_payload", 4.0)])
def test_what_is_no_such_force_is_not_called_one(effect: str | None, strength: float) -> None:
    """Noise, a misrouted tendon, a spot that bends, and a mass, which pulls alike wherever the tip is."""
    assert found_on(effect, strength)[0] is None
