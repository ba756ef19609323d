"""The hand: three fingers turned, in what they are solved, calibrated and stepped by; and the things it touches."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest

from twin.body import Drive, Loads, Problem, Route
from twin.diagnosis import Settings, calibrated_fit
from twin.diagnosis.calibration.fit import Fit
from twin.foundation.errors import DataError, SolveError
from twin.measurements import Channel, Recording, Trial, read
from twin.mechanics.silicone import HandBody, HandDynamics, HandStatics, SoftStatics
from twin.mechanics.silicone.motion.scene import Part, Scene, SceneState, Thing
from twin.mechanics.silicone.motion.things import ThingPoses
from twin.mechanics.silicone.statics import rotation_about_z
from twin.prediction.prepared import prepare
from twin.prediction.twin import Twin
from twin.robots import load
from twin.robots.robot import models_folder

HANGING = np.array([0.0, 0.0, 9.81])
OUT = -6e-3  # m: paid out, slack
HELD = (Drive.DISPLACEMENT,) * 12
BALL = Thing("ball", "sphere", (0.025,), 0.03, (0.0, 0.0, 0.092))
TABLE = Thing("table", "box", (0.1, 0.1, 0.005), 1.0, (0.0, 0.0, 0.122), fixed=True)


def hand(**values: float) -> HandBody:
    found = load("hand").build({name.replace("__", "."): v for name, v in values.items()})
    assert isinstance(found, HandBody)
    return found


def bends(n: int, seconds: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Times and commands: finger 1 bends by tendon 1, finger 2 by its 2 and 3, finger 3 not at all."""
    s = np.linspace(0.0, 1.0, n)
    command = np.full((n, 12), OUT)
    for tendon, amount in ((0, 6e-3), (5, 5e-3), (6, 3e-3)):
        command[:, tendon] = amount * s**2 * (3.0 - 2.0 * s)
    return seconds * s, command


@pytest.mark.parametrize("gravity", [HANGING, np.array([5.0, -3.0, 2.0])], ids=["hanging", "oblique"])
def test_at_rest_it_is_three_fingers_turned(gravity: np.ndarray) -> None:
    """Each finger's own statics under gravity as its frame has it, turned by its frame and moved to its place: to rounding."""
    time, command = bends(5)
    path = HandStatics(hand(mounting__angle_2=0.1)).solve(Problem(time, command, Loads(gravity), drives=HELD))
    assert path.status.all()
    for k in range(3):
        a = 2.0 * np.pi * k / 3
        frame, place = rotation_about_z(a + np.pi), 0.05 * np.array([np.cos(a), np.sin(a), 0.0])
        one = load("finger").build({"mounting.angle": 0.1 if k == 1 else 0.0})
        own = SoftStatics(one).solve(
            Problem(time, command[:, 4 * k : 4 * k + 4], Loads(frame.T @ gravity), drives=(Drive.DISPLACEMENT,) * 4)
        )
        np.testing.assert_allclose(path.markers[:, 11 * k : 11 * k + 11], own.markers @ frame.T + place, rtol=0, atol=1e-12)
        np.testing.assert_allclose(path.tension[:, 4 * k : 4 * k + 4], own.tension, rtol=0, atol=1e-12)
        np.testing.assert_allclose(path.others["sensor"][:, 4 * k : 4 * k + 4], own.others["sensor"], rtol=1e-12)


def test_tendon_1_closes_the_hand() -> None:
    """Each first tendon bends its finger towards the palm's axis."""
    command = np.full((2, 12), OUT)
    command[1, ::4] = 5e-3
    tips = HandStatics(hand()).solve(Problem(np.arange(2.0), command, Loads(HANGING), drives=HELD)).markers[:, 10::11]
    radius = np.hypot(tips[..., 0], tips[..., 1])
    np.testing.assert_allclose(radius[0], 0.05, atol=1e-6)
    assert (radius[1] < 0.04).all()
    np.testing.assert_allclose(radius[1], radius[1, 0], atol=1e-6)


def test_in_motion_it_comes_to_rest_where_statics_stands() -> None:
    """In one model, under oblique gravity, with friction: each finger where its statics has it; the bar is 0.5 mm."""
    time, command = bends(21, 0.4)
    time, command = np.append(time, 0.7), np.vstack([command, command[-1:]])
    problem = Problem(time, command, Loads(np.array([3.0, -2.0, 9.0])), Route(mu=0.2), drives=HELD)
    moved, still = HandDynamics(hand()).solve(problem), HandStatics(hand()).solve(problem)
    assert moved.status.all(), moved.end_reason
    np.testing.assert_allclose(moved.markers[-1], still.markers[-1], rtol=0, atol=2e-4)
    np.testing.assert_allclose(moved.tension[-1], still.tension[-1], rtol=0, atol=0.02)


def test_a_finger_that_is_lost_is_named() -> None:
    command = np.zeros((3, 12))
    command[1:, [4, 6]] = 60.0  # N
    path = HandDynamics(hand()).solve(Problem(np.array([0.0, 0.1, 0.2]), command, Loads(HANGING), drives=(Drive.TENSION,) * 12))
    assert "finger 2 is lost at t = 0.0" in path.end_reason
    assert path.status.tolist() == [1, 0, 0]


# ---- measurement sets ------------------------------------------------------------------------------------------------------------


@cache
def day() -> Recording:
    """A few samples of two trials of a finger on the finite element bench, felt by its cords."""
    recording = read(models_folder() / "finger/samples/drift")
    channels = tuple(c for c in recording.channels if c.role == "input" or "resistance" in c.name)
    trials = tuple(
        replace(t, time=t.time[::7], values={c.name: t.values[c.name][::7] for c in channels})
        for t in recording.trials
        if t.name.startswith("pair")
    )
    return replace(recording, channels=channels, trials=trials)


@cache
def three_days() -> Recording:
    """The same finger three times, as a hand would log it."""
    one, fingers = day(), (1, 2, 3)
    channels = tuple(replace(c, name=f"finger_{k}_{c.name}") for k in fingers for c in one.channels)
    trials = (replace(t, values={f"finger_{k}_{n}": v for k in fingers for n, v in t.values.items()}) for t in one.trials)
    return replace(one, robot="hand", channels=channels, trials=tuple(trials))


def fitted(recording: Recording) -> Fit:
    return calibrated_fit(recording, Twin.of(recording.robot), Settings(jobs=1))[0]


def test_a_hand_s_set_is_calibrated_finger_by_finger() -> None:
    """The same finger's days three times over, from other finite elements: each finger's numbers come out as the finger's alone."""
    one, three = fitted(day()), fitted(three_days())
    own = {f.label: v * f.parameter.step for f, v in zip(one.model.free, one.model.vector(), strict=True)}
    spread = {f.label: s * f.parameter.step for f, s in zip(one.model.free, one.std(), strict=True)}
    for f, v in zip(three.model.free, three.model.vector(), strict=True):
        row, _, index = f.label.rpartition("_")
        label = f"{row}_{(int(index) - 1) % 4 + 1}" if row.startswith("sensors.") else row
        # a tenth of its standard error: noise and derivatives are estimated from other numbers of trials and channels
        assert v * f.parameter.step == pytest.approx(own[label], abs=0.1 * spread[label] + 1e-9), f.label


def test_a_hand_s_set_is_predicted() -> None:
    """Measured resistances, of cords that are good to 20 %, beside those of the hand as described."""
    seen = Twin.of("hand").predict(three_days())
    for measured, predicted in zip(three_days().trials, seen.trials, strict=True):
        for name, values in predicted.values.items():
            if "resistance" in name:
                np.testing.assert_allclose(values, measured.values[name], rtol=0.3)
    assert [c.name for c in seen.outputs()] == [c.name for c in three_days().outputs()]


def test_a_finger_that_is_not_there_is_refused_by_name() -> None:
    one = three_days()
    stray = Channel("finger_4_sensor_1_resistance", "output", "ohm", 0.3)
    trials = tuple(Trial(t.name, t.time, {**t.values, stray.name: np.ones(len(t.time))}, t.conditions) for t in one.trials)
    with pytest.raises(DataError, match="'hand' has 3 fingers, and finger_4_sensor_1_resistance"):
        prepare(replace(one, channels=(*one.channels, stray), trials=trials), load("hand"))


def test_uneven_fingers_are_refused(tmp_path) -> None:  # type: ignore[no-untyped-def]
    text = (models_folder() / "hand/robot.toml").read_text("utf-8")
    (tmp_path / "odd").mkdir()
    (tmp_path / "odd/robot.toml").write_text(text.replace("sensors = 12", "sensors = 11"), "utf-8")
    with pytest.raises(DataError, match="sensors = 11 cannot be shared evenly by 3 fingers"):
        load("odd", relative_to=tmp_path)


# ---- contact ---------------------------------------------------------------------------------------------------------------------


def depth(scene: Scene, seen: SceneState, radius: float) -> float:
    """How far the skin (the mesh, and its rim of 0.5 mm) is inside a ball, m."""
    points = scene.data.flexvert_xpos
    return radius + 5e-4 - float(np.linalg.norm(points - seen.place[0], axis=1).min())


def close(scene: Scene, to: float, seconds: float = 0.6) -> list[SceneState]:
    """All fingers by their first servo, on a smooth way."""
    s = np.linspace(0.0, 1.0, 16)[1:]
    return [scene.step(np.tile([to * x**2 * (3.0 - 2.0 * x), 0.0], (3, 1)), seconds / 15) for x in s]


def test_a_ball_rests_on_a_table() -> None:
    scene = Scene(hand(), [replace(BALL, place=(0.0, 0.0, 0.0915)), TABLE], HANGING)
    for _ in range(20):
        seen = scene.step(np.zeros((3, 2)), 0.02)
    assert seen.touching == 0
    np.testing.assert_allclose(seen.place[0], [0.0, 0.0, 0.092], atol=3e-4)  # m: it sinks in as far as its weight says
    assert np.abs(seen.velocity).max() < 1e-3


def test_a_finger_pushes_a_ball_away_and_not_through() -> None:
    """Finger 1 alone pushes along its x axis, towards -x of the palm; without weight the ball moves on, by Newton's third law."""
    scene = Scene(hand(), [replace(BALL, place=(0.0, 0.0, 0.08), friction=0.2)], np.zeros(3))
    worst, seen = 0.0, scene.observe()
    for k in range(1, 31):
        seen = scene.step(np.array([[9e-3 * min(1.0, k / 25), 0.0], [0.0, 0.0], [0.0, 0.0]]), 0.02)
        worst = max(worst, depth(scene, seen, 0.025))
    x, y, _ = seen.place[0]
    assert x < -2e-3
    assert abs(y) < 1e-3
    assert seen.velocity[0, 0] < -5e-3
    assert worst < 1.5e-3  # m, of a finger 20 mm thick


def test_three_fingers_hold_a_ball_against_its_weight() -> None:
    """Squeezed, then the table's gravity is turned off its side: it is held within millimetres, and does not fall through."""
    scene = Scene(hand(), [BALL, TABLE], HANGING)
    seen = close(scene, 8e-3)[-1]
    assert seen.touching >= 3
    assert depth(scene, seen, 0.025) < 1e-3
    free = close(Scene(hand(), [], HANGING), 8e-3)[-1]
    assert np.linalg.norm(seen.nodes - free.nodes, axis=2).max() > 3e-3  # the ball keeps the fingers apart
    assert (seen.tension[:, 0] > free.tension[:, 0] + 0.1).all()
    scene.model.opt.gravity[:] = [0.0, 3.0, 0.0]
    for _ in range(10):
        seen = scene.step(np.tile([8e-3, 0.0], (3, 1)), 0.02)
    assert np.linalg.norm(seen.place[0] - [0.0, 0.0, 0.092]) < 5e-3  # let go it would be 60 mm away


def test_a_step_among_contacts_is_the_one_mujoco_solves() -> None:
    """MuJoCo's own elements and Newton's method, given the contacts' softness: K as its flex's stiffness in frames that turn, the
    rest of the force, and the tensions found, applied. Tendons and contacts are all in one solve here, MuJoCo's is independent."""
    scene = Scene(hand(), [replace(BALL, friction=0.03), TABLE], HANGING)
    close(scene, 8e-3, 0.36)
    scene.step([[9e-3, 0.0], [8e-3, 1e-3], [8e-3, 0.0]], 0.02)
    moving, h = scene.motion, scene.motion.step
    before = copy.copy(scene.data)
    mujoco.mj_step1(scene.model, before)  # contacts' springs as described, not as `discrete` folds them
    spring, damping, impedance, _ = before.efc_KBIP.reshape(-1, 4).T.copy()
    command = np.concatenate([scene.observe().servos, -scene.observe().servos], axis=1)
    moving.run(command, command, 1)
    model = copy.copy(scene.model)
    model.opt.integrator, model.opt.solver = mujoco.mjtIntegrator.mjINT_DISCRETE, mujoco.mjtSolver.mjSOL_NEWTON
    model.opt.tolerance, model.opt.iterations = 1e-14, 1000
    off = mujoco.mjtDisableBit
    model.opt.disableflags &= ~(off.mjDSBL_SPRING | off.mjDSBL_DAMPER)
    b = moving.resting[0].body.damping
    model.flex_stiffness[:] = np.concatenate([-limb.effective_mass.damping.ravel() / (h * b) for limb in moving.bodies])
    model.flex_damping[:] = b - h
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = before.qpos, before.qvel
    mujoco.mj_step1(model, data)
    J = np.zeros((data.nefc, model.nv))
    for r in range(data.nefc):
        entry = slice(data.efc_J_rowadr[r], data.efc_J_rowadr[r] + data.efc_J_rownnz[r])
        J[r, data.efc_J_colind[entry]] = data.efc_J[entry]
    inverse = np.diag(1.0 / data.M[model.M_rowadr + model.M_rownnz - 1])
    for limb in moving.bodies:
        U = np.triu(limb.effective_mass.upper, 1) + np.diag(1.0 / np.diag(limb.effective_mass.upper))
        inverse[np.ix_(limb.dof, limb.dof)] = np.linalg.inv(U.T @ U)
        force = -limb.work.f + limb.force - limb.tension @ limb.work.tendons.pull
        data.qfrc_applied[limb.dof] = force - data.qfrc_spring[limb.dof]
    hard = 1.0 / h + damping + h * spring * impedance
    W = (J @ inverse @ J.T)[::3, ::3].diagonal()
    D = np.repeat((hard * impedance)[::3] / ((1.0 - impedance[::3]) * W), 3) * np.tile([1.0, 20.0, 20.0], len(W))
    place = data.contact.pos[data.efc_id[::3]]
    alike = (np.abs(place[:, None] - place).max(axis=2) < 1e-9).sum(axis=1)
    assert alike.max() > 1  # a vertex, once for each of its facets, which share what one has here
    D /= np.repeat(alike, 3)
    goal = (data.efc_vel / h - spring * impedance * (data.efc_pos - data.efc_margin)) / hard
    data.efc_D[:], data.efc_R[:], data.efc_aref[:] = h * D, 1.0 / (h * D), (goal - data.efc_vel) / h
    for contact in data.contact:
        contact.mu = contact.friction[0] / np.sqrt(20.0)
    for stage in (mujoco.mj_fwdActuation, mujoco.mj_fwdAcceleration, mujoco.mj_fwdConstraint):
        stage(model, data)
    states = set(data.efc_state.tolist())
    assert mujoco.mjtConstraintState.mjCNSTRSTATE_CONE in states  # some slide
    assert mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC in states  # some stick
    assert np.abs(J @ before.qvel).max() > 1e-3
    after = before.qvel + h * data.qacc
    # m/s, of 16 mm/s: MuJoCo's iterations stop at 5e-11
    np.testing.assert_allclose(scene.data.qvel, after, rtol=0, atol=1e-8)


def test_reset_and_repeat_are_the_same_bit_for_bit() -> None:
    scene = Scene(hand(), [BALL, TABLE], HANGING, Route(mu=0.2))
    first = close(scene, 8e-3, 0.3)[-1]
    scene.reset()
    second = close(scene, 8e-3, 0.3)[-1]
    for name in ("nodes", "tension", "place", "turn", "velocity", "resistance"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(DataError, match="no shape 'cone'; allowed: sphere, cylinder, box"):
        Thing("x", "cone", (0.1,), 1.0, (0.0, 0.0, 0.0))
    with pytest.raises(DataError, match="2 sizes"):
        Thing("x", "cylinder", (0.1,), 1.0, (0.0, 0.0, 0.0))
    scene = Scene(hand(), [], HANGING)
    with pytest.raises(DataError, match="servo 4"):
        scene.step(np.array([[0.0, 0.0], [0.0, np.nan], [0.0, 0.0]]), 0.02)
    with pytest.raises(SolveError, match=r"finger 1 is lost at t = "):
        scene.step(np.array([[0.09, 0.0], [0.0, 0.0], [0.0, 0.0]]), 0.1)


HINGED = Thing(
    "cup", "box", (0.01, 0.012, 0.004), 0.02, (0.3, 0.1, 0.2), (0.8, 0.0, 0.6, 0.0), hinge=((0.02, 0.0, -0.01), (0.0, 2.0, 0.0)),
    parts=(Part("sphere", (0.01,), (0.0, 0.01, 0.02), mass=0.01),),
)  # fmt: skip


def test_a_hinged_thing_is_where_mujoco_has_it() -> None:
    """Place, turn and velocities, which are told from the angle alone."""
    spec = mujoco.MjSpec()
    HINGED.add(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = 1.2, 3.0
    mujoco.mj_forward(model, data)
    speed = np.empty(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, 1, speed, 0)
    place, turn, velocity = ThingPoses(model, [HINGED]).read(data)
    np.testing.assert_allclose(place[0], data.xpos[1], atol=1e-12)
    np.testing.assert_allclose(turn[0], data.xquat[1], atol=1e-12)
    np.testing.assert_allclose(velocity[0, :3], speed[3:], atol=1e-12)
    np.testing.assert_allclose(data.xmat[1].reshape(3, 3) @ velocity[0, 3:], speed[:3], atol=1e-12)


def test_a_hinged_thing_swings_as_a_pendulum() -> None:
    """Far from the fingers, by the hand's own steps: the period of small swings about its stable rest, from its masses, to 1 %."""
    bob = Thing("bob", "sphere", (0.005,), 0.02, (0.3, 0.0, 0.1), hinge=((0.0, 0.0, -0.05), (0.0, 1.0, 0.0)))
    scene = Scene(hand(), [bob], HANGING)
    scene.data.qpos[-1] = 0.05
    places = [scene.step(np.zeros((3, 2)), 0.01).place[0, 0] - 0.3 for _ in range(60)]
    arm = 0.05 + 0.4 * 0.005**2 / 0.05  # of the simple pendulum that swings alike
    crossed = np.flatnonzero(np.diff(np.sign(places)))[:2]
    exact = [0.01 * (k + 1 + places[k] / (places[k] - places[k + 1])) for k in crossed]
    assert exact[1] - exact[0] == pytest.approx(np.pi * np.sqrt(arm / 9.81), rel=0.01)


def test_parts_must_leave_a_free_thing_balanced() -> None:
    replace(HINGED, hinge=None, fixed=True)
    with pytest.raises(DataError, match="balance them"):
        replace(HINGED, hinge=None)
    with pytest.raises(DataError, match="3 sizes"):
        replace(HINGED, parts=(Part("box", (0.01,), (0.0, 0.0, 0.0)),))
