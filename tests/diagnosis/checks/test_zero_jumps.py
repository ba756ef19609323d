"""Zeros that jump, by hand: the statistics against closed forms and simulation, the law against geometry; whole days are in
`test_zeros.py`."""

from __future__ import annotations

import importlib
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.diagnosis.checks.test_design import bench
from tools.simulators.rod.design import bench_day
from twin.body import Signals
from twin.diagnosis.calibration.model import Model
from twin.diagnosis.checks import jump_detection as jumps
from twin.diagnosis.checks.zero_jumps import (
    SHIFT,
    TURN,
    Jump,
    Zeros,
    jumps_of,
    rezeroed,
    with_zero_jumps,
    without,
    without_zero_jumps,
    words,
)
from twin.diagnosis.thresholds import CLEAR_CHI_SQUARE, TRIALS_AROUND_JUMP
from twin.foundation.errors import SolveError
from twin.measurements import Channel
from twin.prediction.prepared import Output, PreparedRecording
from twin.prediction.twin import Twin

CAMERA, SECOND = Jump("marker", 9.0, 10.0), Jump("marker", 19.0, 20.0)
ENCODERS = Jump("angle", 9.0, 10.0, (0, 2))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def scattered(x: np.ndarray) -> float:
    return float(((x - x.mean(axis=0)) ** 2).sum())


def test_what_a_step_takes_off_the_scatter_is_that_of_two_means(rng: np.random.Generator) -> None:
    """Analysis of variance: the sum of squares about one mean less that about one mean on either side."""
    S = rng.normal(size=(14, 3))
    taken = jumps._explained(S[None])[0]
    for k in range(14):
        for a in range(TRIALS_AROUND_JUMP + 1):
            for b in range(TRIALS_AROUND_JUMP + 1):
                there = min(a, b) >= 2 and a <= k <= 14 - b
                whole, one, other = S[k - a : k + b], S[k - a : k], S[k : k + b]
                off = scattered(whole) - scattered(one) - scattered(other) if there else 0.0
                assert taken[k, a, b] == pytest.approx(off, abs=1e-12), (k, a, b)


def largest(S: np.ndarray) -> float:
    """T of one series (K,), as the module's docstring writes it."""
    return float(jumps._explained(S[None, :, None]).max() / np.median(np.diff(S) ** 2))


def test_hardly_a_white_series_has_so_clear_a_step(rng: np.random.Generator) -> None:
    """The largest of 999 is beaten by one in a thousand; 3 of 600 would be by chance in 2 % of the tries. Whatever the scale."""
    bar = jumps._by_chance(16)
    found = [largest(rng.normal(size=16)) for _ in range(600)]
    assert sum(t > bar for t in found) <= 3
    assert max(found) > bar / 10.0, "the bar is the largest of a thousand, not out of reach"
    S = rng.normal(size=16)
    assert largest(1e3 * S) == pytest.approx(largest(S))


def steps(S: np.ndarray, start: np.ndarray | None = None, bar: float = CLEAR_CHI_SQUARE) -> list[tuple[int, int, int]]:
    return list(jumps._steps(S[:, None], np.arange(float(len(S))) if start is None else start, bar))


def test_a_step_is_found_where_it_is_and_the_clearest_first(rng: np.random.Generator) -> None:
    """Of noise of 1 a step of 30 after 7 of 16 trials; a smaller one later comes after it."""
    S = 0.5 * rng.normal(size=16) + 30.0 * (np.arange(16) >= 7)
    assert steps(S)[0][0] == 7
    assert {k for k, _, _ in steps(S + 12.0 * (np.arange(16) >= 12))} >= {7}
    assert steps(S + 12.0 * (np.arange(16) >= 12))[0][0] == 7
    assert steps(S, bar=1e12) == []


def test_a_drift_is_no_step() -> None:
    """Of a line its best step leaves a quarter; and by the clock, not by the number of the trial."""
    assert steps(np.arange(16.0)) == []
    late = np.where(np.arange(16) >= 8, 200.0, 0.0) + np.arange(16.0)  # a pause at noon: the drift went on
    assert steps(late, start=late) == []
    assert steps(late)[0][0] == 8  # no pause: the same numbers are a step


def test_within_trials_the_metric_makes_residuals_white(rng: np.random.Generator) -> None:
    """C = 1 + their covariance within trials, whatever their means: M C M = 1."""
    L = rng.normal(size=(3, 3))
    off = [rng.normal(size=(4000, 3)) @ L.T + m for m in (0.0, 100.0, -50.0)]
    M = jumps._metric(off)
    np.testing.assert_allclose(M @ (np.eye(3) + L @ L.T) @ M, np.eye(3), atol=0.1)  # 12,000 rows: 1 % each, times some conditioning
    np.testing.assert_allclose(M, M.T, atol=1e-12)


def test_a_mean_is_of_what_is_there() -> None:
    found = jumps._mean(np.array([[1.0, np.nan, np.nan], [3.0, 4.0, np.nan]]))
    np.testing.assert_array_equal(found, [2.0, 4.0, np.nan])


def test_a_basis_spans_what_the_columns_do_and_nothing_else(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 6))
    Q = jumps._basis(np.column_stack([1e-6 * a, 1e6 * b, a + b]))
    assert Q.shape == (6, 2)
    np.testing.assert_allclose(Q.T @ Q, np.eye(2), atol=1e-12)
    for x in (a, b):
        np.testing.assert_allclose(Q @ (Q.T @ x), x, atol=1e-9)
    assert jumps._basis(np.zeros((6, 0))).shape == (6, 0)


def test_rows_are_placed_along_a_step_by_what_is_seen_of_them(rng: np.random.Generator) -> None:
    before, D = rng.normal(size=5), np.array([1.0, -2.0, 0.5, 3.0, 0.0])
    x = before + np.outer([0.0, 1.0, 0.3], D)
    x[2, [0, 3]] = np.nan
    np.testing.assert_allclose(jumps._along(x, before, D), [0.0, 1.0, 0.3])


@pytest.mark.parametrize(("row", "last", "since"), [(None, 0, 0), (12, 11, 12), (3, 2, 3)])
def test_a_jump_is_between_trials_unless_a_row_is_clearly_better(
    row: int | None, last: int, since: int, rng: np.random.Generator
) -> None:
    """Two trials of 20 rows, 100 s apart; by rows of the first, or of the second after `row`."""
    time = np.arange(20.0)
    inputs = [SimpleNamespace(clock=time), SimpleNamespace(clock=100.0 + time)]
    study: Any = SimpleNamespace(prepared=SimpleNamespace(inputs=inputs, outputs=[]), trials=[0, 1])
    moved = np.concatenate([np.zeros(20), np.ones(20)]) if row is None else (np.arange(40) >= row + 20).astype(float)
    D = np.array([2.0, -1.0])
    off = np.outer(moved, D) + 0.3 * rng.normal(size=(40, 2))
    found = jumps._located(study, [off[:20], off[20:]], "marker", 1, np.zeros(2), D)
    expected = (19.0, 100.0) if row is None else (100.0 + last, 100.0 + since)
    assert (found.last, found.since, found.joints) == (*expected, ())
    early = off[::-1] @ np.diag([-1.0, -1.0]) + D  # backwards in time it is a step as well, one row further
    found = jumps._located(study, [early[:20], early[20:]], "marker", 1, np.zeros(2), D)
    assert found.since == (100.0 if row is None else 20.0 - row)


@pytest.mark.parametrize(
    ("turn", "shift", "clamp"),
    [
        ((0, 0, 0.13), (0, 0, 0), True),
        ((0, 0.02, 0), (0, 0, 0), True),
        ((0, 0, 0.13), (2e-3, 0, 0), False),
        ((0, 0, 0), (1e-3, 0, 0), False),
    ],
)
def test_a_turn_about_the_base_alone_may_be_the_clamp(turn: tuple, shift: tuple, clamp: bool, rng: np.random.Generator) -> None:
    """Least squares of a turn and a shift by hand, over poses bent by up to 20 mm: 200 rows of eight markers, noise 0.25 mm. The
    fall foretold where the shift is left out is the one that a fit without it has."""
    z = np.linspace(0.015, 0.12, 8)
    bend = rng.uniform(-1.4, 1.4, size=(200, 1, 2))
    points = np.concatenate([bend * z[:, None] ** 2, np.broadcast_to(z[:, None], (200, 8, 1))], axis=2).reshape(-1, 3)
    G = np.concatenate(
        [np.concatenate([np.cross(e, points)[:, :, None] for e in np.eye(3)], axis=2), np.tile(np.eye(3), (len(points), 1, 1))],
        axis=2,
    )
    G = G.reshape(-1, 6) / 2.5e-4
    y = G @ np.array([*turn, *shift], float) + rng.normal(size=len(G))
    x = np.linalg.lstsq(G, y, rcond=None)[0]
    cost = float(((y - G @ x) ** 2).sum())
    model = with_zero_jumps(Model(Twin.of("continuum"), ()), [CAMERA])
    steps_of = np.array([f.parameter.step for f in model.free])
    after: Any = SimpleNamespace(
        cost=cost,
        information=lambda: (G * steps_of).T @ (G * steps_of),
        model=SimpleNamespace(twin=model.twin, free=model.free, vector=lambda: x / steps_of),
    )
    before: Any = SimpleNamespace(cost=float(y @ y))
    outputs = [SimpleNamespace(group="marker", index=k) for k in range(8)]
    study: Any = SimpleNamespace(prepared=SimpleNamespace(outputs=outputs))
    assert jumps.may_be_clamp(study, before, after, CAMERA) is clamp
    alone = np.linalg.lstsq(G[:, :3], y, rcond=None)[0]
    without_shift = float(((y - G[:, :3] @ alone) ** 2).sum())
    assert (without_shift - cost < 0.1 * (before.cost - cost)) is clamp
    study.prepared.outputs = outputs[:1]
    assert not jumps.may_be_clamp(study, before, after, CAMERA), "one point tells nothing of it"


def test_a_condition_that_was_one_thing_before_and_another_after_parts_the_trials() -> None:
    done = np.array([[1.0, 0.0], [2.0, 5.0], [3.0, 1.0], [4.0, 4.0]])
    assert jumps._parted(done, 2)
    assert jumps._parted(-done, 2), "falling as well"
    assert not jumps._parted(done[:, 1:], 2)
    assert not jumps._parted(np.ones((4, 2)), 2), "what is alike throughout parts nothing"


def test_what_was_done_in_a_trial_is_its_mean_command_its_pace_and_its_loads() -> None:
    """A triangle of 2 N up and down in 40 s: 1 N in the mean, 0.1 N/s."""
    day = bench(bench_day("default", np.random.default_rng(0)))
    time = np.linspace(0.0, 40.0, 401)
    command = np.outer(2.0 - np.abs(time - 20.0) / 10.0, [1.0, 0.0, 0.0])
    loads = replace(day.inputs[0].loads, payload=0.02)
    done = jumps._conditions(replace(day.inputs[0], time=time, command=command, loads=loads))
    np.testing.assert_allclose(done[:5], [1.0, 0.0, 0.0, 0.1, 0.02], rtol=3e-3)
    np.testing.assert_array_equal(done[6:], [*loads.gravity, *loads.force])


def planned() -> PreparedRecording:
    return bench(bench_day("default", np.random.default_rng(0)))


def test_patterns_are_what_small_moves_of_the_camera_do(rng: np.random.Generator) -> None:
    """Column by column the derivative of R x + shift by finite rotations, in sigmas, of markers where they are predicted; joints'
    zeros move each its own angle."""
    day = planned()
    n = len(day.outputs)
    day = replace(day, outputs=(*day.outputs, Output(Channel("joint_1_angle", "output", "rad", 1e-3), "angle", 0, 0)))
    sigma, where = np.r_[rng.uniform(1e-4, 3e-4, n), 1e-3], np.r_[rng.normal(size=n) * 0.05, 0.1]
    measured = tuple(np.tile(where + 0.02, (len(i.time), 1)) for i in day.inputs)
    raw = [np.full_like(y, 0.02) for y in measured]
    study: Any = SimpleNamespace(
        prepared=replace(day, measured=measured), trials=range(len(raw)),
        objective=SimpleNamespace(whitener=SimpleNamespace(noise=SimpleNamespace(sigma=sigma))),
    )  # fmt: skip
    fit: Any = SimpleNamespace(evaluation=SimpleNamespace(raw=raw))
    (angle, zero, clamp), (marker, moved, turned) = jumps._patterns(study, fit)
    assert (angle, marker) == ("angle", "marker")
    np.testing.assert_array_equal(zero, np.eye(n + 1)[:, n:])
    assert clamp.shape == (n + 1, 0)
    points: dict[int, np.ndarray] = {}
    for c, o in enumerate(day.outputs[:n]):
        points.setdefault(o.index, np.zeros(3))[o.axis] = where[c]
    small = 1e-6
    for k in range(6):
        R = Rotation.from_rotvec(small * np.eye(3)[k - 3]).as_matrix() if k >= 3 else np.eye(3)
        shift = small * np.eye(3)[k] if k < 3 else np.zeros(3)
        by = [(R @ points[o.index] + shift - points[o.index])[o.axis] / small / sigma[c] for c, o in enumerate(day.outputs[:n])]
        np.testing.assert_allclose(moved[:, k], [*by, 0.0], atol=1e-2)  # of some hundreds in a metre a radian and a sigma
    np.testing.assert_array_equal(turned, moved[:, 3:])


def looked_through(day: PreparedRecording, raw: list[np.ndarray], *taken: Jump) -> Jump | None:
    noise = SimpleNamespace(sigma=np.full(len(day.outputs), 3e-4))
    study: Any = SimpleNamespace(
        prepared=day, trials=range(len(raw)), objective=SimpleNamespace(whitener=SimpleNamespace(noise=noise))
    )
    fit: Any = SimpleNamespace(evaluation=SimpleNamespace(raw=raw))
    return jumps.next_jump(study, fit, taken)


def test_a_camera_that_moved_between_trials_is_the_next_jump_and_found_once(rng: np.random.Generator) -> None:
    """Residuals of markers along a straight robot: noise, what the robot gets wrong and bends, and a shift from the tenth trial on.
    Not where the payload changed there too, nor what moves less than half the noise, nor where it only turns about the base."""
    day = planned()
    place = {o.index: np.array([0.0, 0.0, 0.02 * (o.index + 1)]) for o in day.outputs}
    where = np.array([place[o.index][o.axis] for o in day.outputs])
    bend = np.array([place[o.index][2] ** 2 if o.axis == 0 else 0.0 for o in day.outputs]) / 0.16**2
    measured = tuple(np.tile(where, (len(i.time), 1)) for i in day.inputs)
    day = replace(day, measured=measured)
    axis = np.array([o.axis for o in day.outputs])

    def raw(moved: np.ndarray) -> list[np.ndarray]:
        off = [3e-4 * rng.normal(size=y.shape) + np.outer(1e-3 * rng.normal(size=len(y)), bend) for y in measured]
        return [x + (k >= 10) * moved for k, x in enumerate(off)]

    shift, faint = np.array([1e-3, -2e-3, 1e-3])[axis], np.array([1e-4, 1e-4, 0.0])[axis]
    found = looked_through(day, raw(shift))
    assert found is not None
    assert found == Jump("marker", float(day.inputs[9].clock[-1]), float(day.inputs[10].clock[0]))
    assert looked_through(day, raw(shift), found) is None
    for row in (day.inputs[9].clock[0], day.inputs[10].clock[-1]):
        assert looked_through(day, raw(shift), replace(found, since=float(row))) is None, "wherever in the two trials it was put"
    assert looked_through(day, raw(shift), replace(found, since=float(day.inputs[11].clock[0]))) == found
    assert looked_through(day, raw(shift), replace(found, group="angle")) == found, "another zero may jump at that time"
    assert looked_through(day, raw(faint)) is None
    slipped = np.array([np.cross([0.01, 0.02, 0.0], place[o.index])[o.axis] for o in day.outputs])
    assert looked_through(day, raw(slipped)) is None
    heavier = [replace(i, loads=replace(i.loads, payload=0.05 + 0.001 * k if k >= 10 else 0.0)) for k, i in enumerate(day.inputs)]
    assert looked_through(replace(day, inputs=tuple(heavier)), raw(shift)) is None


def signals(n: int = 30) -> Signals:
    rng, clock = np.random.default_rng(1), np.arange(float(n))
    z = np.zeros((n, 3))
    return Signals(
        clock, clock, z, z, 0.05 * rng.normal(size=(n, 4, 3)), clock, others={"angle": rng.normal(size=(n, 3)), "torque": z[:, :1]}
    )


def law(*of: Jump, **values: float) -> Zeros:
    (made,) = (e for e in with_zero_jumps(Model(Twin.of("continuum"), ()), of).twin.effects if isinstance(e, Zeros))
    return type(made)(values)


def test_a_camera_moves_all_markers_from_the_jump_on_and_nothing_else() -> None:
    turn, shift = np.array([0.02, -0.01, 0.03]), np.array([1e-3, -2e-3, 3e-3])
    values = {f"{x}_1": v for x, v in zip((*TURN, *SHIFT), (*turn, *shift), strict=True)}
    true = signals()
    seen = law(CAMERA, **values).sense(true)
    np.testing.assert_array_equal(seen.markers[:10], true.markers[:10])
    angle = np.linalg.norm(turn)
    axis, x = turn / angle, true.markers[10:]
    turned = x * np.cos(angle) + np.cross(axis, x) * np.sin(angle) + np.multiply.outer(x @ axis, axis) * (1 - np.cos(angle))
    np.testing.assert_allclose(seen.markers[10:], turned + shift, atol=1e-12)
    np.testing.assert_array_equal(seen.others["angle"], true.others["angle"])
    twice = law(CAMERA, SECOND, **values, shift_x_2=0.1).sense(true)
    np.testing.assert_allclose(twice.markers[20:] - seen.markers[20:], np.tile([0.1, 0.0, 0.0], (10, 4, 1)), atol=1e-12)
    np.testing.assert_array_equal(twice.markers[:20], seen.markers[:20])


def test_encoders_count_from_elsewhere_each_by_its_own() -> None:
    true = signals()
    seen = law(ENCODERS, angle_1_1=0.2, angle_3_1=-0.1).sense(true)
    off = np.outer(np.arange(30) >= 10, [0.2, 0.0, -0.1])
    np.testing.assert_allclose(seen.others["angle"], true.others["angle"] + off)
    np.testing.assert_array_equal(seen.markers, true.markers)
    assert set(seen.others) == set(true.others)
    still = replace(true, others={})
    assert not law(ENCODERS, angle_1_1=0.2).sense(still).others


def test_a_jump_is_taken_out_alone_and_none_is_handed_on() -> None:
    both = law(CAMERA, ENCODERS, shift_x_1=1e-3, angle_1_2=0.2)
    assert without(both, CAMERA).values == law(CAMERA, ENCODERS, angle_1_2=0.2).values
    assert without(both, ENCODERS).values == law(CAMERA, ENCODERS, shift_x_1=1e-3).values
    model = with_zero_jumps(Model(Twin.of("continuum"), ()), (CAMERA, ENCODERS))
    assert jumps_of(model.twin) == (CAMERA, ENCODERS)
    assert [f.parameter.name for f in model.free] == [*(f"{x}_1" for x in (*TURN, *SHIFT)), "angle_1_2", "angle_3_2"]
    assert not without_zero_jumps(model.twin).effects
    assert jumps_of(without_zero_jumps(model.twin)) == ()


def said(day: PreparedRecording, jump: Jump, *by: float) -> list[str]:
    """What is said of a jump that was fitted to be `by` with a standard error of 1e-3 each."""
    names = [f"{x}_1" for x in jump.numbers]
    fitted = {n: SimpleNamespace(value=x, std=1e-3) for n, x in zip(names, by, strict=True)}
    twin = with_zero_jumps(Model(Twin.of("continuum"), ()), (jump,)).twin
    fit: Any = SimpleNamespace(fitted=lambda effect: fitted, model=SimpleNamespace(twin=twin))
    return words(day, fit)


def test_a_jump_is_said_with_its_size_its_time_and_the_trials_beside_it() -> None:
    day = planned()
    name = [t.label for t in sorted(day.recording.trials, key=lambda t: t.start or 0.0)]
    begin, end = ([float(i.clock[k]) for i in day.inputs] for k in (0, -1))
    minutes = f"{(begin[4] - begin[0]) / 60.0:.0f} min into the session"
    (camera,) = said(day, Jump("marker", end[3], begin[4]), 0.03, 0.0, 0.04, 3e-3, 4e-3, 0.0)  # 0.05 rad, 5 mm
    assert camera.startswith(
        f"the markers' frame moved by 5.0 mm and 2.9 deg (the camera, not the robot), between {name[3]} and {name[4]}"
    )
    assert minutes in camera
    within = Jump("marker", float(day.inputs[4].clock[5]), float(day.inputs[4].clock[6]))
    (inside,) = said(day, within, *np.zeros(6))
    assert f"within {name[4]}, {within.since - begin[4]:.1f} s from its start" in inside
    joints = Jump("angle", end[3], begin[4], (0, 1))
    (sure,) = said(day, joints, np.deg2rad(2.0), 2e-3)  # 35 and 2 standard errors
    assert "the zero jumped: joint_1_angle by 2.00 deg, between" in sure
    (neither,) = said(day, joints, 1e-3, 2e-3)
    assert "joint_1_angle by 0.06 deg, joint_2_angle by 0.11 deg" in neither
    tip = replace(day, outputs=tuple(o for o in day.outputs if o.index == 7))
    assert "one point cannot show which" in said(tip, Jump("marker", end[3], begin[4]), *np.zeros(6))[0]
    _, lost = said(day, Jump("marker", end[3], begin[6]), *np.zeros(6))
    assert lost.startswith(f"{name[4]}, {name[5]}: run between these two rows")


def test_a_trials_zero_is_taken_anew_from_its_first_rows() -> None:
    """Of points one shift of all, of angles each its own; what is not there says nothing."""
    day = planned()
    angles = [Output(Channel(f"joint_{j}_angle", "output", "rad", 1e-3), "angle", j - 1, 0) for j in (1, 2)]
    day = replace(day, outputs=(*day.outputs, *angles))
    n = len(day.outputs)
    axis = np.array([o.axis for o in day.outputs[:-2]])
    raw = np.tile(np.r_[np.array([1e-3, 2e-3, 3e-3])[axis], 0.1, 0.2], (12, 1))
    raw[5:] += 1.0
    raw[0, 0] = np.nan
    points, joints = rezeroed(day, "marker", raw), rezeroed(day, "angle", raw)
    np.testing.assert_allclose(points[1:5, :-2], 0.0, atol=1e-12)
    np.testing.assert_allclose(points[5:, :-2], 1.0)
    np.testing.assert_array_equal(points[:, -2:], raw[:, -2:])
    np.testing.assert_allclose(joints[:5, -2:], 0.0, atol=1e-12)
    np.testing.assert_array_equal(joints[:, : n - 2], raw[:, : n - 2])
    unseen = np.full_like(raw, np.nan)
    np.testing.assert_array_equal(rezeroed(day, "marker", unseen), unseen)


@pytest.mark.parametrize(
    ("lost", "stands", "clamp", "taken"),
    [(False, True, False, True), (True, True, False, False), (False, False, False, False), (False, True, True, False)],
    ids=["a jump", "no equilibrium with it", "not clear in its fit", "perhaps the clamp"],
)
def test_a_jump_is_taken_if_its_fit_says_so(
    lost: bool, stands: bool, clamp: bool, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = importlib.import_module("twin.diagnosis.calibration.calibrate")
    base, fitted = (SimpleNamespace(model=None, evaluation=None) for _ in range(2))

    def fit(*_: Any, **__: Any) -> Any:
        if lost:
            raise SolveError("no neighbour has an equilibrium")
        return fitted

    for name, stand_in in (
        ("next_jump", lambda study, found, jumps: CAMERA if found is base else None), ("with_zero_jumps", lambda *_: None),
        ("fit", fit),
        ("stands", lambda *_: stands), ("may_be_clamp", lambda study, before, after, jump: clamp and before is base),
    ):  # fmt: skip
        monkeypatch.setattr(stage, name, stand_in)
    study: Any = SimpleNamespace(objective=None, progress=lambda words: None)
    assert stage._with_jumps(study, base) is (fitted if taken else base)
