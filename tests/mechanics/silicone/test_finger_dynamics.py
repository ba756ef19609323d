"""The soft finger in motion: it comes to rest where statics stands, half a step changes nothing, friction loses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from twin.body import Drive, Loads, Problem, Route
from twin.effects import effect_class
from twin.foundation.errors import SolveError
from twin.mechanics.silicone import SoftBody, SoftDynamics, SoftSolution, SoftStatics
from twin.mechanics.silicone.material.damping import effective_mass, update_mass
from twin.mechanics.silicone.material.flex import flex_spec
from twin.mechanics.silicone.material.law import Tangent, forces, stiffness
from twin.mechanics.silicone.motion import dynamics as moving
from twin.mechanics.silicone.motion.dynamics import RestingBody, SoftMotion, motion_step
from twin.mechanics.silicone.solver_arrays import body_arrays
from twin.prediction.rollout import Drawing, draw_controls, rollout
from twin.prediction.twin import Twin
from twin.robots import load

HANGING = np.array([0.0, 0.0, 9.81])
OUT = -6e-3  # m: paid out, slack
HELD = (Drive.DISPLACEMENT,) * 4


def finger(**values: float) -> SoftBody:
    found = load("finger").build({name.replace("__", "."): v for name, v in values.items()})
    assert isinstance(found, SoftBody)
    return found


def eased(amount: float, ramp: float, hold: float, rate: float = 50.0) -> tuple[np.ndarray, np.ndarray]:
    """Times, and commands that bring tendon 1 to `amount` on a smooth way, the others slack."""
    time = np.arange(round((ramp + hold) * rate) + 1) / rate
    s = np.minimum(1.0, time / ramp)
    command = np.full((len(time), 4), OUT)
    command[:, 0] = amount * s**2 * (3.0 - 2.0 * s)
    return time, command


def moved(problem: Problem, body: SoftBody | None = None) -> SoftSolution:
    path = SoftDynamics(body or finger()).solve(problem)
    assert path.status.all(), path.end_reason
    return path


def stood(problem: Problem, body: SoftBody | None = None) -> SoftSolution:
    path = SoftStatics(body or finger()).solve(problem)
    assert path.status.all()
    return path


def test_the_flex_is_the_lattice() -> None:
    """Its nodes' mass, and its skin."""
    body = finger()
    started = RestingBody.of(body, Problem(np.zeros(1), np.zeros((1, 4)), Loads(np.zeros(3)), drives=HELD))
    made = SoftMotion.of(flex_spec(body, 1e-3), [started], [""], ["it"])
    weight = body.density * body.lattice.quadrature[1].sum()
    clamped = body.density * body.lattice.quadrature[1].sum() - body.density * body.lattice.volume.sum()
    np.testing.assert_allclose(made.model.body_mass.sum(), weight - clamped, rtol=1e-9)
    np.testing.assert_allclose(made.bodies[0].effective_mass.mass.sum(), 3.0 * (weight - clamped), rtol=1e-9)
    # it lies on the cone, but for the depth at which the mesh is put, at facets' corners
    x = made.data.flexvert_xpos[np.hypot(*made.data.flexvert_xpos[:, :2].T) > 1e-3]
    np.testing.assert_allclose(np.hypot(x[:, 0], x[:, 1]), body.cone.radius(x[:, 2]) - 5e-4, atol=1e-6)


def test_the_metric_is_mass_and_damping_in_a_frame_that_turns() -> None:
    """Turned as a whole and strained a little, the factor's metric is that of rest, turned."""
    body = finger()
    parts, n = body_arrays(body), 3 * body.lattice.n_free
    mass, turn = np.repeat(body.density * body.lattice.volume, 3), Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    x, small = body.lattice.nodes, 1e-7 * np.random.default_rng(0).normal(size=n).reshape(-1, 3)
    own = effective_mass(body.lattice, parts, mass, 2e-5)
    moved = (x + np.vstack([np.zeros((9, 3)), small])) @ turn.T - x
    update_mass(own, parts.cells, moved)
    U = np.triu(own.upper, 1) + np.diag(1.0 / np.diag(own.upper))
    spun = np.kron(np.eye(n // 3), turn)
    A = spun.T @ U.T @ U @ spun
    f, p = np.empty(n), np.zeros((body.cells, 4))
    forces(np.vstack([np.zeros((9, 3)), small]), parts.cells, np.empty((0, 0, 6)), f, p)
    # of strains of 1e-5: second order
    np.testing.assert_allclose(A @ small.ravel() - mass * small.ravel(), 2e-5 * f, atol=2e-4 * 2e-5 * np.abs(f).max())


@pytest.mark.parametrize(
    ("drive", "gravity"), [("held", HANGING), ("tension", np.array([9.81, 0.0, 0.0]))], ids=["shortened", "pulled, sideways"]
)
def test_it_comes_to_rest_where_statics_stands(drive: str, gravity: np.ndarray) -> None:
    time, command = eased(9e-3, 0.3, 0.5)
    drives = HELD
    if drive == "tension":
        command, drives = np.maximum(command, 0.0) * (1.5 / 9e-3), (Drive.TENSION,) * 4
    problem = Problem(time, command, Loads(gravity), drives=drives)
    path, still = moved(problem), stood(replace(problem, time=time[-2:], command=command[-2:]))
    # m, of 27 mm: a held tendon's 10 um, Poisson's ratio 0.47 for 0.49, and what is left of the swing; the bar is 5e-4
    np.testing.assert_allclose(path.markers[-1], still.markers[-1], rtol=0, atol=2e-4)
    np.testing.assert_allclose(path.others["strain"][-1], still.others["strain"][-1], rtol=0, atol=2e-3 * 0.0741)
    np.testing.assert_allclose(path.tension[-1], still.tension[-1], rtol=0, atol=0.02)


def test_half_a_step_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """One way and back within a second, antagonists exchanged, with friction; the bar is 0.3 mm."""
    time = np.arange(41) / 50.0
    command = np.full((len(time), 4), OUT)
    command[:, 0] = 6e-3 * np.sin(2.0 * np.pi * time)
    command[:, 2] = -command[:, 0]
    problem = Problem(time, command, Loads(HANGING), Route(mu=0.3), drives=HELD)
    step = motion_step(finger())
    whole = moved(problem)
    monkeypatch.setattr(moving, "motion_step", lambda body: 0.5 * step)
    half = moved(problem)
    assert np.ptp(whole.markers[:, -1, 0]) > 0.02
    # m: second order but for where tendons become taut
    np.testing.assert_allclose(whole.markers, half.markers, rtol=0, atol=1.5e-4)


def test_friction_loses() -> None:
    """Pull and release of the same lengths: the base tension of a rubbing tendon is higher on the way in, lower on the way out."""
    time = np.arange(61) / 50.0
    command = np.full((len(time), 4), OUT)
    command[:, 0] = 4e-3 * (1.0 - np.cos(2.0 * np.pi * time / 1.2))
    plain, rubbing = (moved(Problem(time, command, Loads(HANGING), Route(mu=mu), drives=HELD)) for mu in (0.0, 0.4))
    still = stood(Problem(time, command, Loads(HANGING), Route(mu=0.4), drives=HELD))
    work = [float((0.5 * (p.tension[1:] + p.tension[:-1]) * np.diff(command, axis=0)).sum()) for p in (plain, rubbing, still)]
    lag = rubbing.tension[15, 0] - rubbing.tension[45, 0]
    assert rubbing.tension[15, 0] > 1.03 * plain.tension[15, 0] > 1.06 * rubbing.tension[45, 0]
    # N: the loop is friction's, as statics has it; the silicone's own damping adds the plain one's
    swing = plain.tension[15, 0] - plain.tension[45, 0]
    assert lag - swing == pytest.approx(still.tension[15, 0] - still.tension[45, 0], abs=0.02)
    assert 0.0 < work[0] < 0.5 * work[1]  # J: dissipated
    assert work[1] - work[0] == pytest.approx(work[2], rel=0.1)


def test_a_free_swing_has_the_frequency_and_damping_of_its_tangent() -> None:
    """Let go from a bend of 3 mm: against the lowest eigenvalue of the rest tangent and the nodes' masses, that is closed form."""
    body = finger(silicone__damping=4e-3)
    parts = body_arrays(replace(body, poisson=0.47))
    time = np.arange(151) / 250.0
    command = np.zeros((len(time), 4))
    command[0, 0] = 0.1
    x = moved(Problem(time, command, Loads(np.zeros(3)), drives=(Drive.TENSION,) * 4), body).markers[:, -1, 0]
    n = 3 * body.lattice.n_free
    tangent = Tangent(np.empty((n, n)), np.zeros((body.cells, 4, 81)), np.zeros((body.cells, 4)))
    stiffness(np.zeros((n // 3 + 9, 3)), parts.cells, np.empty((0, 0, 6)), tangent)
    mass = np.repeat(body.density * body.lattice.volume, 3)
    omega = np.sqrt(np.linalg.eigvalsh(tangent.K / np.sqrt(np.outer(mass, mass)))[0])
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    crossing = time[up] - x[up] * (time[1] - time[0]) / (x[up + 1] - x[up])
    period = np.diff(crossing).mean()
    assert 2.0 * np.pi / period == pytest.approx(omega, rel=0.02)  # a tenth of a per cent of damping, higher modes, the step
    assert body.first_mode_frequency() == pytest.approx(omega / (2.0 * np.pi), rel=0.1)  # Rayleigh's beam has no shear
    peaks = np.array([np.abs(x[(time >= a) & (time < a + 0.5 * period)]).max() for a in crossing[:-1]])
    decay = np.log(peaks[:-1] / peaks[1:]).mean() / (2.0 * np.pi)
    assert decay == pytest.approx(0.5 * 4e-3 * omega, rel=0.1)


def test_gravity_pulls_where_it_points() -> None:
    """Weightless and slack it stays; let go sideways it falls that way, and a payload with it."""
    time = np.linspace(0.0, 0.6, 7)
    slack = np.full((7, 4), OUT)
    for gravity in (np.array([0.0, 9.81, 0.0]), np.array([-9.81, 0.0, 0.0])):
        problem = Problem(time, slack, Loads(gravity, payload=2e-3), drives=HELD)
        path = moved(problem)
        np.testing.assert_allclose(path.markers, stood(problem).markers, rtol=0, atol=5e-5)  # m: it starts at rest
        sag = path.markers[-1, -1, :2] @ gravity[:2] / 9.81
        assert sag > 2e-3
    still = moved(Problem(time, slack, Loads(np.zeros(3)), drives=HELD))
    np.testing.assert_allclose(still.markers, still.markers[:1].repeat(7, axis=0), rtol=0, atol=1e-9)


def test_a_cell_inside_out_is_named_with_its_time() -> None:
    time = np.array([0.0, 0.1, 0.2, 0.3])
    path = SoftDynamics(finger()).solve(
        Problem(time, np.outer([0.0, 0.0, 1.0, 1.0], [60.0, 0.0, 60.0, 0.0]), Loads(HANGING), drives=(Drive.TENSION,) * 4)
    )
    assert path.status.tolist() == [1, 1, 0, 0]
    assert np.isnan(path.markers[2:]).all()
    assert "the finger is lost at t = 0.1" in path.end_reason
    assert "inside out" in path.end_reason or "no finite speed" in path.end_reason


def test_what_is_not_stepped_says_so() -> None:
    effect = effect_class("contact")({"stiffness": 50.0}, n_tendon=4)
    loads = effect.surround(Loads(HANGING))
    with pytest.raises(SolveError, match="static equilibria"):
        RestingBody.of(finger(), Problem(np.zeros(1), np.zeros((1, 4)), loads, effect.route(), drives=HELD))


def test_rollouts_are_the_same_bit_for_bit_from_one_worker_and_from_two() -> None:
    twin = Twin.of("finger")
    controls = draw_controls(twin, 2, 3, Drawing(seconds=0.6, rate=50.0, drive=Drive.DISPLACEMENT))
    one, two = (rollout(twin, controls, jobs=jobs) for jobs in (1, 2))
    assert not one.lost
    assert "MuJoCo steps" in one.recording.source
    assert one.recording.data_hash() == two.recording.data_hash()
