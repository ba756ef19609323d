"""Shape from strain sensors, judged on a day of the independent finite element bench, which shares no code with the twin and which
nothing was trained on: `python -m tools.simulators.finger --shape --seed 22`, its third test trial left out."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tools.benchmarks.shape.baselines.constant_curvature import ConstantCurvatureEstimator
from twin.body import Signals
from twin.effects import effect_class
from twin.foundation.errors import DataError, TwinError
from twin.measurements import Recording, read
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import read_twin
from twin.robots import load, sample
from twin.shape.alignment.align import Alignment, align
from twin.shape.alignment.drift_correction import correct_drift
from twin.shape.alignment.report import alignment_lines, read_band_widening, write_alignment
from twin.shape.estimators.deformation_modes import ModeCoupling
from twin.shape.estimators.estimator import Z90, Estimator, SensorReadings, estimator_class, estimators
from twin.shape.estimators.modal import ModalEstimator
from twin.shape.estimators.physics import PhysicsEstimator
from twin.shape.estimators.weights import read_weights
from twin.shape.predict import predict_shapes
from twin.shape.sensing import read_sensors

DATA = Path(__file__).parents[1] / "data"
LAWS = pytest.mark.parametrize("name", sorted(estimators()))


@pytest.fixture(scope="module")
def day() -> Recording:
    return read(DATA / "finger_shape")


@pytest.fixture(scope="module")
def aligned(day: Recording) -> Alignment:
    told: list[str] = []
    found = align(day, Twin.of(load("finger")), told.append)
    steps = ("turning the finger onto its clouds", "sweep 1", "sweep 2", "bands of this finger")  # some seconds each
    assert [s in t for s, t in zip(steps, told, strict=True)] == [True] * 4
    return found


@pytest.fixture(scope="module")
def shapes(day: Recording, aligned: Alignment) -> Callable[[str], dict[str, np.ndarray]]:
    """What an estimator makes of the two test trials."""
    return cache(
        lambda name: predict_shapes(only(day, "test_1", "test_2"), estimator_class(name)(aligned.twin), aligned.widening)[0]
    )


def errors(arrays: dict[str, np.ndarray], trial: str) -> tuple[np.ndarray, np.ndarray]:
    """Distances (f, P) m from the truth, and the estimated std."""
    true = np.load(DATA / "finger_shape_truth.npz")
    at = np.abs(arrays[f"{trial}_time"][None] - true[f"{trial}_time"][:, None]).argmin(axis=1)
    places = true[f"{trial}_vertices"] * float(true["unit_mm"]) * 1e-3
    return np.linalg.norm(arrays[f"{trial}_vertices"][at] - places, axis=2), arrays[f"{trial}_std"][at]


def only(day: Recording, *trials: str) -> Recording:
    return day.select(trials)


# ---- alignment ----------------------------------------------------------------------------------------------------------------


def test_alignment_finds_the_built_finger(aligned: Alignment) -> None:
    """Bars: 0.2 deg moves a tip bent by 30 mm by 0.1 mm; 5 % of kappa is a twentieth of a bend, some 0.5 mm of 10."""
    true = json.loads((DATA / "finger_shape_truth.json").read_text())["finger"]
    found = {n: f.value for n, f in aligned.fitted.items()}
    assert np.rad2deg(found["mounting.angle"]) == pytest.approx(true["phi_deg"], abs=0.2)
    for i in range(4):
        assert found[f"sensors.resistance_{i + 1}"] == pytest.approx(true["R0_ohm"][i], rel=2e-3)
        assert found[f"sensors.stretch_{i + 1}"] == pytest.approx(true["kappa_stretch"][i], rel=0.05)
        assert found[f"sensors.compression_{i + 1}"] == pytest.approx(true["kappa_compression"][i], rel=0.02)
    assert aligned.distance_after < aligned.distance_before
    assert aligned.undetermined == ("silicone.youngs_modulus",)


def test_alignment_is_read_back(aligned: Alignment, tmp_path: Path) -> None:
    write_alignment(aligned, tmp_path / "al", {})
    assert read_twin(tmp_path / "al").values == pytest.approx(dict(aligned.twin.values))
    assert json.loads((tmp_path / "al/alignment.json").read_text())["cloud_frames"] == aligned.cloud_count
    assert read_band_widening(str(tmp_path / "al")) == aligned.widening
    text = alignment_lines(aligned)
    assert (
        f" {1e3 * aligned.distance_before:.3f} mm (root mean square) from the visible skin before,"
        f" {1e3 * aligned.distance_after:.3f} mm after" in text[1 + len(aligned.fitted)]
    )
    angle = aligned.fitted["mounting.angle"]
    assert text[1].split()[:4] == ["mounting.angle", f"{np.degrees(angle.value):.4g}", "+-", f"{np.degrees(angle.std or 0.0):.2g}"]
    assert (aligned.widening.factors.keys(), aligned.widening.known_contacts) == (estimators().keys(), ("hand, force unknown",))
    assert aligned.widening.free_factors.keys() == estimators().keys()


def test_alignment_without_clouds_or_without_free_motion_is_refused(day: Recording) -> None:
    with pytest.raises(DataError, match="no trial has clouds"):
        align(only(day, "test_1"), Twin.of(load("finger")))
    with pytest.raises(DataError, match="free motion"):
        align(only(day, "align_2", "test_1"), Twin.of(load("finger")))


# ---- a twin that is not of this finger ----------------------------------------------------------------------------------------


def test_a_twin_of_this_finger_is_not_doubted(day: Recording, aligned: Alignment) -> None:
    _, notices = predict_shapes(day, ModalEstimator(aligned.twin), aligned.widening)
    assert not [n for n in notices if "align" in n or "unlike" in n]


def test_a_twin_never_aligned_says_so(day: Recording) -> None:
    notices = " ".join(predict_shapes(only(day, "test_1"), ModalEstimator(Twin.of(load("finger"))))[1])
    assert "never aligned" in notices
    assert "run twin align" in notices


def test_a_twin_of_another_finger_says_how_far_off_it_is(aligned: Alignment) -> None:
    """Monday is another finger of the independent bench: the strains of its free motion put points elsewhere by this twin."""
    _, notices = predict_shapes(read(sample("monday")), ModalEstimator(aligned.twin), aligned.widening)
    (notice,) = [n for n in notices if "another finger" in n]
    doubt = float(re.findall(r"points ([\d.]+) mm off", notice)[0])
    assert doubt > 0.2


def test_frames_outside_the_training_are_counted_by_trial(day: Recording, aligned: Alignment) -> None:
    """Undeclared, the hand of the second test makes strains that tendons alone do not."""
    arrays, notices = predict_shapes(only(silent(day), "test_1", "test_2"), ModalEstimator(aligned.twin), aligned.widening)
    (notice,) = [n for n in notices if "NAME_outside" in n]
    flags = arrays["test_2_outside"]
    assert notice.endswith(f": test_2 {flags.sum()} of {len(flags)}")


# ---- every estimator ----------------------------------------------------------------------------------------------------------


@LAWS
def test_estimators_keep_the_contract(name: str, aligned: Alignment) -> None:
    law = estimator_class(name)(aligned.twin)
    felt = SensorReadings(
        np.array([[0.003] * 4, [0.03, -0.02, -0.03, 0.02], [np.nan, -0.02, -0.03, 0.02]]), np.full((3, 4), -15e-3)
    )
    shapes = law.estimate(felt)
    n = len(law.points.rest)
    assert (shapes.displacements.shape, shapes.std.shape, shapes.outside.shape) == ((3, n, 3), (3, n), (3,))
    assert shapes.outside.dtype == bool
    assert np.isfinite(shapes.displacements).all()
    assert (shapes.std > 0.0).all()
    again = law.estimate(felt)
    assert np.array_equal(again.displacements, shapes.displacements)  # nothing is remembered from call to call
    held = law.points.rest[:, 2] <= aligned.twin.robot.build().cone.clamp  # type: ignore[attr-defined]
    assert np.abs(shapes.displacements[:, held]).max() < 1e-9
    assert law.description


@LAWS
def test_a_row_that_follows_none_starts_anew(name: str, aligned: Alignment) -> None:
    """Whatever stands above it; and a finger that has stood still is estimated as one that is seen for the first time. To 5 um: the
    static solve starts from the row above."""
    law = estimator_class(name)(aligned.twin)
    rest, bent = np.full(4, 0.003), np.array([0.03, -0.02, -0.03, 0.02])
    long = np.full((4, 4), -15e-3)
    rows = SensorReadings(np.stack([rest, rest, bent, bent]), long, follows=np.array([False, True, False, True]))
    moved = law.estimate(rows).displacements
    alone = law.estimate(SensorReadings(bent[None], long[:1])).displacements[0]
    np.testing.assert_allclose(moved[2], alone, atol=5e-6)
    np.testing.assert_allclose(moved[3], alone, atol=5e-6)


def test_folding_remembers_three_rows(aligned: Alignment) -> None:
    """What was felt up to three rows before counts, what was before that does not."""
    law = estimator_class("folding")(aligned.twin)
    rest, bent = np.full(4, 0.003), np.array([0.03, -0.02, -0.03, 0.02])

    def after(*before: np.ndarray) -> np.ndarray:
        rows = np.stack([*before, bent])
        return law.estimate(SensorReadings(rows, np.full((len(rows), 4), -15e-3), follows=np.arange(len(rows)) > 0)).displacements[
            -1
        ]

    still = after(bent, bent, bent)
    np.testing.assert_allclose(after(rest, bent, bent, bent), still, atol=1e-12)
    assert all(np.abs(after(*x) - still).max() > 1e-5 for x in ([rest, bent, bent], [bent, rest, bent], [bent, bent, rest]))


@LAWS
def test_a_hanging_finger_is_straight(name: str, aligned: Alignment) -> None:
    """At the strain that its weight makes; the networks may be off by their own error at small shapes, 0.2 to 0.3 mm."""
    law = estimator_class(name)(aligned.twin)
    shapes = law.estimate(SensorReadings(np.full((1, 4), 0.003), np.full((1, 4), -15e-3)))
    assert np.linalg.norm(shapes.displacements[0], axis=1).mean() < 5e-4


BARS = {"physics": 0.8e-3, "modal": 0.8e-3, "folding": 1.3e-3, "constant_curvature": 2.5e-3}


@LAWS
def test_error_on_the_independent_bench(name: str, shapes: Callable[[str], dict[str, np.ndarray]]) -> None:
    """Issue 16: 0.8 mm is the aim on free motion and hand pushes, 1.3 mm must be; the baselines are only asked to be baselines. A
    new estimator is held to the must."""
    bar = BARS.get(name, 1.3e-3)
    arrays = shapes(name)
    for trial in ("test_1", "test_2"):
        assert errors(arrays, trial)[0].mean() < bar
        assert arrays[f"{trial}_cloud"].shape[2] == 3


def test_alignment_halves_the_error_at_least(day: Recording, aligned: Alignment) -> None:
    trial = only(day, "test_2")
    before, after = (
        errors(predict_shapes(trial, ModalEstimator(t))[0], "test_2")[0].mean() for t in (Twin.of(load("finger")), aligned.twin)
    )  # fmt: skip
    assert after < 0.5 * before


@pytest.mark.parametrize("name", ["physics", "modal"])
def test_the_band_holds_what_it_says(name: str, shapes: Callable[[str], dict[str, np.ndarray]]) -> None:
    """90 % of points; a trial's frames are alike, so that 80 % is still by chance. In free motion, where only the twin's own error
    and the alignment's are left, no more than 0.35 mm wide on average: 1.645 of 1.3 % of a way of 10 mm, and the network's own."""
    arrays = shapes(name)
    for trial in ("test_1", "test_2"):
        away, std = errors(arrays, trial)
        assert (away < Z90 * std).mean() > 0.8
    assert Z90 * errors(arrays, "test_1")[1].mean() < 0.35e-3


def test_a_push_that_nobody_declared_is_flagged(day: Recording, aligned: Alignment) -> None:
    """A hand in a trial that is said to be free: wherever it moves the points by more than a millimetre (all tendons are paid out),
    the strains say so, and the shape is sought as if it had been declared; in free motion nothing is flagged."""
    arrays, _ = predict_shapes(silent(day), ModalEstimator(aligned.twin), aligned.widening)
    assert not arrays["test_1_outside"].any()
    true = np.load(DATA / "finger_shape_truth.npz")
    at = np.abs(arrays["test_2_time"][None] - true["test_2_time"][:, None]).argmin(axis=1)
    moved = np.linalg.norm(true["test_2_vertices"] - true["test_2_vertices"][0], axis=2).mean(axis=1) * float(true["unit_mm"]) > 1.0
    assert moved.sum() > 10
    assert arrays["test_2_outside"][at][moved].all()
    away, std = errors(arrays, "test_2")
    assert away.mean() < BARS["modal"]
    assert (away < Z90 * std).mean() > 0.8


def test_physics_knows_a_push_that_nobody_declared(day: Recording, aligned: Alignment) -> None:
    """In frames of a free trial and of a pushed one, taken for free; the latter's shapes are those of a declared push."""
    law, (free, hand) = PhysicsEstimator(aligned.twin), read_sensors(only(day, "test_1", "test_2"), aligned.twin)[0]
    for trial, presses in ((free, False), (hand, True)):
        some = slice(60, 63)
        felt = SensorReadings(trial.strain(law.body.cords)[some], trial.displacement[some], pushed=False)
        shapes = law.estimate(felt)
        assert (shapes.outside == presses).all()
        assert shapes.pressed is not None
        assert (shapes.pressed == presses).all()
        if presses:
            declared = law.estimate(replace(felt, pushed=True))
            assert np.abs(shapes.displacements - declared.displacements).max() < 5e-5  # found from other starts


def silent(day: Recording) -> Recording:
    return replace(day, trials=tuple(replace(t, other={}) for t in only(day, "test_1", "test_2").trials))


def test_what_pushed_in_no_alignment_is_outside(day: Recording, aligned: Alignment) -> None:
    """The same push under another name: marked where the finger is pressed, and only there."""
    trial, law = only(day, "test_2").trials[0], ModalEstimator(aligned.twin)
    strange = replace(day, trials=(replace(trial, other={"external_contact": "two edges"}),))
    known, other = (predict_shapes(r, law, aligned.widening)[0]["test_2_outside"] for r in (only(day, "test_2"), strange))
    assert not known.any()
    assert other.mean() > 0.5
    assert not other[0]  # it begins at rest


def test_the_free_strains_are_those_of_the_twin(aligned: Alignment) -> None:
    """Of a pull, of two antagonists against each other, and of nothing but slack tendons: the network against the twin's own
    equilibria, to 1.5e-3, three times what a strain is wrong by anyhow."""
    asked = 1e-3 * np.array([[8.0, -9.0, -9.0, -9.0], [3.0, -6.0, 0.0, -6.0], [-9.0, -15.0, -6.0, -15.0]])
    walk = PhysicsEstimator(aligned.twin)
    shapes = walk.estimate(SensorReadings(np.full((3, 4), np.nan), asked, pushed=False)).displacements
    nodes = np.linalg.lstsq(walk.weights, shapes.transpose(1, 0, 2).reshape(len(walk.points.rest), -1), rcond=None)[0]
    strains = walk.statics.sensor_signals(nodes.reshape(-1, 3, 3).transpose(1, 0, 2))["strain"]
    assert np.abs(ModalEstimator(aligned.twin).network.tendon_strains(asked) - strains).max() < 1.5e-3


# ---- drift --------------------------------------------------------------------------------------------------------------------


def drifted(day: Recording, by: dict[str, float]) -> Recording:
    names = [f"sensor_{i}_resistance" for i in (1, 2)]
    return day.with_values([{n: t.values[n] * by[t.label] for n in names} for t in day.trials], day.source)


def test_drift_of_any_kind_is_told_by_free_motion_and_undone(day: Recording, aligned: Alignment) -> None:
    """Two sensors read 8 % more in both tests, the first of which is free: the error under the hand rises by 0.06 mm at most, the
    bar of issue 16, where without the free trial it rises by more than ten times that."""
    law, tests = ModalEstimator(aligned.twin), only(day, "test_1", "test_2")

    def error(recording: Recording) -> float:
        return float(errors(predict_shapes(recording, law)[0], "test_2")[0].mean())

    lying, good = drifted(tests, {"test_1": 1.08, "test_2": 1.08}), error(tests)
    assert abs(error(lying) - good) < 0.06e-3
    assert error(only(lying, "test_2")) - good > 0.6e-3
    assert "drift, undone" in predict_shapes(lying, law)[1][-1]


def test_between_free_trials_drift_goes_by_the_clock(day: Recording, aligned: Alignment) -> None:
    free, hand = (read_sensors(only(day, name), aligned.twin)[0][0] for name in ("test_1", "test_2"))
    late = replace(free, resistance=1.08 * free.resistance)
    found, said = correct_drift([free, hand, late], [0.0, 900.0, 1000.0], aligned.twin)
    by = [np.median(b.resistance / a.resistance) for a, b in zip((free, hand, late), found, strict=True)]
    assert np.log(by) == pytest.approx([0.0, -0.9 * np.log(1.08), -np.log(1.08)], abs=4e-3)  # g itself is good to 2e-3
    assert len(said) == 1


def test_a_twin_whose_tendons_make_other_strains_tells_no_drift(day: Recording, aligned: Alignment) -> None:
    """Its network knows the finger as described; a sensor's own effect changes nothing of that."""
    free = read_sensors(only(day, "test_1"), aligned.twin)[0][0]
    lying = replace(free, resistance=1.08 * free.resistance)
    for effect, told in (("stiffness_asymmetry", False), ("sensor_gain", True)):
        twin = replace(aligned.twin, effects=(effect_class(effect)({}, aligned.twin.robot.n_tendon),))
        assert bool(correct_drift([lying], [0.0], twin)[1]) == told


def test_a_push_that_nobody_declared_is_no_drift(day: Recording, aligned: Alignment) -> None:
    """Nor is what sensors that do not drift are off by anyhow."""
    sensed = read_sensors(silent(day), aligned.twin)[0]
    found, said = correct_drift(sensed, [0.0, 100.0], aligned.twin)
    assert not said
    assert all(a is b for a, b in zip(sensed, found, strict=True))


def test_the_band_is_wider_the_harder_the_push(aligned: Alignment) -> None:
    """The strengths of hands are not known beforehand: the same pattern of strains, four times as large, leaves more open."""
    strain, slack = np.array([[0.01, -0.005, -0.004, 0.008]]), np.full((1, 4), -15e-3)
    gentle, hard = (PhysicsEstimator(aligned.twin).estimate(SensorReadings(k * strain, slack)).std for k in (1.0, 4.0))
    assert hard.mean() > 1.5 * gentle.mean()


def test_knowing_that_nothing_presses_narrows_the_band(aligned: Alignment) -> None:
    taut = np.array([[-6e-3, -6e-3, 6e-3, 6e-3]])
    strain = ModalEstimator(aligned.twin).network.tendon_strains(taut)  # which tendons alone make: nothing is felt pressing
    for law in (PhysicsEstimator(aligned.twin), ModalEstimator(aligned.twin)):
        pushed, free = (law.estimate(SensorReadings(strain, taut, p)).std.mean() for p in (True, False))
        assert free < pushed


def test_the_skin_goes_with_the_points(day: Recording, aligned: Alignment) -> None:
    """Every named point of the skin has skin nearby: rings lie 2.5 mm apart, 1.25 mm from the furthest."""
    law = ModalEstimator(aligned.twin)
    arrays, _ = predict_shapes(only(day, "test_2"), law)
    frame = len(arrays["test_2_time"]) // 2
    points = arrays["test_2_vertices"][frame][law.points.skin]
    gap = np.linalg.norm(points[:, None] - arrays["test_2_cloud"][frame][None], axis=2).min(axis=1)
    assert gap.max() < 2.5e-3


# ---- sensors that fail or lie -------------------------------------------------------------------------------------------------


def changed(day: Recording, sensor: int, values: float) -> Recording:
    name = f"sensor_{sensor}_resistance"
    return day.with_values([{name: np.full(len(t.time), values)} for t in day.trials], day.source)


def test_a_lost_sensor_makes_nothing_strange(aligned: Alignment) -> None:
    """An ordinary bend, in which opposite sensors go together, is one without any of its sensors too; one beyond all that was
    trained on is not."""
    bend, slack = np.array([0.05, -0.03, -0.04, 0.03]), np.full((5, 4), -15e-3)
    strain = np.tile(bend, (5, 1))
    strain[np.arange(4), np.arange(4)] = np.nan
    law = ModalEstimator(aligned.twin)
    assert not law.estimate(SensorReadings(strain, slack)).outside.any()
    assert law.estimate(SensorReadings(6.0 * strain, slack)).outside.all()


@pytest.mark.parametrize(("value", "said"), [(1000.0, "dead"), (1e6, "open or short"), (np.nan, "empty")])
def test_a_lost_sensor_is_named_and_done_without(value: float, said: str, day: Recording, aligned: Alignment) -> None:
    trial = only(day, "test_2")
    whole = errors(predict_shapes(trial, ModalEstimator(aligned.twin))[0], "test_2")[0].mean()
    arrays, notices = predict_shapes(changed(trial, 2, value), ModalEstimator(aligned.twin))
    assert any("sensor_2" in n and said in n for n in notices)
    assert errors(arrays, "test_2")[0].mean() < 2.0 * whole  # the bar of issue 16


def test_drift_that_the_twin_knows_is_undone(day: Recording, aligned: Alignment) -> None:
    """Resistances as a drifting sensor would report them, read by a twin with that drift, are the strains before."""
    drift = effect_class("sensor_drift")({"rate_1": 2e-4}, 4)
    twin = replace(aligned.twin, effects=(drift,))
    rate = {t.name: 1.0 + 2e-4 * ((t.start or 0.0) + t.time - t.time[0]) for t in day.trials}
    name = "sensor_1_resistance"
    drifted = day.with_values([{name: t.values[name] * rate[t.name]} for t in day.trials], day.source)
    plain, undone = read_sensors(day, aligned.twin)[0], read_sensors(drifted, twin)[0]
    for a, b in zip(plain, undone, strict=True):
        assert np.allclose(a.resistance, b.resistance, rtol=1e-9)


def test_hysteresis_that_the_twin_knows_is_undone_in_each_trial_alone(day: Recording, aligned: Alignment) -> None:
    """Readings of sensors that lag by 2 s and have a play; what is undone starts anew with every trial, whichever came before."""
    law = effect_class("sensor_hysteresis")({"share": 0.2, "time": 2.0, "width": 1e-3, "swap": 5e-3}, 4)
    twin, names = replace(aligned.twin, effects=(law,)), [f"sensor_{i}_resistance" for i in range(1, 5)]
    plain, values = read_sensors(day, aligned.twin)[0], []
    for trial in day.trials:
        R, t, none = np.stack([trial.values[n] for n in names], axis=1), trial.time, np.zeros((len(trial.time), 0))
        rest = np.broadcast_to(ModalEstimator(aligned.twin).body.cords.rest, R.shape)
        true = Signals(t, t, none, none, none[:, :, None], t, others={"sensor": R, "sensor_rest": rest})
        values.append(dict(zip(names, law.sense(true).others["sensor"].T, strict=True)))
    lagging = day.with_values(values, day.source)
    undone = read_sensors(lagging, twin)[0]
    for a, b in zip(plain, undone, strict=True):
        assert np.allclose(a.resistance, b.resistance, rtol=1e-5)  # 1e-5 of a strain's range: 30 rounds, each leaving a third
    alone = read_sensors(only(lagging, "test_2"), twin)[0][0]
    assert np.array_equal(alone.resistance, next(s for s in undone if s.name == alone.name).resistance)


def test_bad_resistances_and_robots_are_refused(day: Recording, aligned: Alignment, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="above zero"):
        predict_shapes(changed(day, 3, 0.0), ModalEstimator(aligned.twin))
    without = replace(
        day, channels=tuple(c for c in day.channels if c.name != "sensor_3_resistance"),
        trials=tuple(replace(t, values={k: v for k, v in t.values.items() if k != "sensor_3_resistance"}) for t in day.trials),
    )  # fmt: skip
    with pytest.raises(DataError, match="sensor_3_resistance"):
        predict_shapes(without, ModalEstimator(aligned.twin))
    with pytest.raises(DataError, match="has no strain sensors"):
        ConstantCurvatureEstimator(Twin.of(load("continuum")))
    with pytest.raises(TwinError, match="physics"):
        estimator_class("no_such")


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_truncated_weights_are_refused(share: float, tmp_path: Path) -> None:
    whole = (load("finger").folder / "modal.npz").read_bytes()
    path = tmp_path / "modal.npz"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(DataError, match="twin train"):
        read_weights(path, ModalEstimator.weights_format())


def test_weights_of_another_format_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "modal.npz", format=np.array("other/1"))
    with pytest.raises(DataError, match="other/1"):
        read_weights(tmp_path / "modal.npz", ModalEstimator.weights_format())


def test_weights_are_small() -> None:
    assert sum(path.stat().st_size for path in load("finger").folder.glob("*.npz")) < 2e6


# ---- parts --------------------------------------------------------------------------------------------------------------------


def test_slope_of_the_habit() -> None:
    """Against differences."""
    rng = np.random.default_rng(0)
    habit = ModeCoupling(rng.normal(size=(10, 5)), np.eye(5), np.array([2.0, 1.5, 1.0, 1.0, 1.0]))
    habit.coefficient[:, :2] = 0.0
    z, h = rng.normal(size=5), 1e-6
    numeric = np.stack([(habit(z + h * e)[0] - habit(z - h * e)[0]) / (2 * h) for e in np.eye(5)], axis=1)
    assert np.allclose(habit(z)[1], numeric, atol=1e-7)


def test_an_arc_bends_away_from_the_stretched_cord(aligned: Alignment) -> None:
    """Cord 1 at 45 degrees stretched, cord 3 opposite shortened: the tip goes to 225 degrees."""
    law: Estimator = ConstantCurvatureEstimator(aligned.twin)
    moved = law.estimate(SensorReadings(np.array([[0.05, 0.0, -0.05, 0.0]]), np.zeros((1, 4)))).displacements[0]
    tip = moved[law.points.rest[:, 2].argmax()]
    assert np.rad2deg(np.arctan2(tip[1], tip[0])) % 360 == pytest.approx(225.0, abs=5.0)
