"""What is left, in words: the place, the line and the moment of errors that no law of the catalogue knows."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.diagnosis.checks.test_design import bench as planned
from tests.recorded_days import half, recorded_day
from tools.simulators.rod.design import bench_day
from tools.simulators.rod.effects.unknown import ClampSlip, SoftSpot, Vibration
from twin.diagnosis import Settings, calibrated_fit
from twin.diagnosis.calibration.fit import Fit
from twin.diagnosis.evidence.discrepancy import Discrepancy, Evidence, Spectrum
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.explain.error_location import describe_location, misbent_segment, place
from twin.diagnosis.explain.words import change, nearest, since, structure, wave
from twin.diagnosis.split import split
from twin.effects.base.chain import EffectChain
from twin.prediction.prepared import PreparedRecording, prepare
from twin.prediction.simulate import output_columns
from twin.prediction.twin import Twin
from twin.robots import load

ROBOT = load("continuum")


# ---- on days of the bench --------------------------------------------------------------------------------------------------


@cache
def calibrated(effect: str | None, strength: float = 2.0) -> tuple[PreparedRecording, list[int], Fit, Discrepancy]:
    """The calibrated robot's residual on the fitted trials of half a day, no effect sought; of a step, which needs many trials to
    be told from their scatter, of the whole day."""
    day = recorded_day(effect, strength)[0]
    recording = day if effect == "clamp_slip" else half(day)
    bench = prepare(recording, ROBOT)
    fitted = split(bench, Settings().seed)[0]
    found = calibrated_fit(recording, Twin.of(ROBOT))[0]
    return bench, fitted, found, Evidence(bench, fitted, np.zeros(bench.n_tendon)).discrepancy(found.z)


def residual(effect: str | None, strength: float = 2.0) -> tuple[PreparedRecording, list[int], np.ndarray]:
    bench, fitted, found, discrepancy = calibrated(effect, strength)
    return bench, fitted, found.z.reshape(discrepancy.mean.shape)


def told_where(effect: str | None, strength: float = 2.0) -> str:
    bench, fitted, found, discrepancy = calibrated(effect, strength)
    at = [output_columns(bench, EffectChain(()).sense(t.true)) for t in found.evaluation.traces.values()]
    return describe_location(bench, fitted, discrepancy.mean, at)


def test_a_slip_of_the_clamp_is_dated() -> None:
    truth = recorded_day("clamp_slip")[1]
    assert isinstance(truth, ClampSlip)
    day, fitted, z = residual("clamp_slip")
    between = change(day, fitted, z)
    assert between is not None
    last, first = (day.inputs[k] for k in between)
    assert last.clock[0] < truth.moment < first.clock[0]
    names = [n.removesuffix(".csv") for n in (last.name, first.name)]
    assert f"changed at once between {names[0]} and {names[1]}, " in since(day, fitted, z)


@pytest.mark.parametrize(("effect", "strength"), [(None, 2.0), ("load_cell_drift", 4.0), ("backbone_creep", 4.0)])
def test_a_day_on_which_nothing_slipped_has_no_moment(effect: str | None, strength: float) -> None:
    """Noise, a drift through the day, and a memory of seconds to minutes."""
    assert since(*residual(effect, strength)) == ""


def test_a_vibration_is_a_line_that_grows_to_the_tip() -> None:
    truth = recorded_day("vibration")[1]
    assert isinstance(truth, Vibration)
    day, fitted, found, discrepancy = calibrated("vibration")
    z = found.z.reshape(discrepancy.mean.shape)
    line = Spectrum.of(day, fitted).peak(z - discrepancy.mean)
    words = structure(day, fitted, z, discrepancy, "T1", line, AcceptanceLimits())
    said = re.search(r"^A line at ([\d.]+) Hz is left, of ([\d.]+) sigma in disk_8_(x|y); it grows from disk_1 to disk_8\.$", words)
    assert said, words
    # The grid's step is half a cycle in the longest trial, 103 s.
    assert float(said[1]) == pytest.approx(truth.frequency, abs=0.5 / 103 + 0.005)
    # 1 mm at the tip along the azimuth, in sigmas of the bench's 0.2-0.4 mm, raised by up to a half where repeats vibrate too.
    along = max(abs(np.cos(truth.azimuth)), abs(np.sin(truth.azimuth)))
    assert 1e-3 * along / 6e-4 < float(said[2]) < 1e-3 * along / 2e-4


def test_a_soft_spot_is_found_where_it_is() -> None:
    truth = recorded_day("soft_spot")[1]
    assert isinstance(truth, SoftSpot)
    # Interval 0 ends at disk_1.
    assert told_where("soft_spot").endswith(f" one place, between disk_{truth.interval} and disk_{truth.interval + 1}.")


@pytest.mark.parametrize(
    ("effect", "strength"), [(None, 2.0), ("tendon_friction", 2.0), ("stiffness_gradient", 2.0), ("backbone_creep", 4.0)]
)
def test_errors_all_along_the_body_have_no_place(effect: str | None, strength: float) -> None:
    assert told_where(effect, strength) == ""


# ---- by hand ---------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def plan() -> PreparedRecording:
    return planned(bench_day("hanging", np.random.default_rng(0)))


def along_the_body(bench: PreparedRecording, size: np.ndarray) -> np.ndarray:
    """An error (n, m) of these sizes at the eight disks."""
    swing = np.sin(np.arange(bench.n_sample))[:, None]
    return swing * size[[o.index for o in bench.outputs]]


@pytest.mark.parametrize(
    ("size", "said"),
    [
        (np.arange(1.0, 9.0), "it grows from disk_1 to disk_8"),
        (np.arange(1.0, 9.0) ** 2, "it grows from disk_1 to disk_8"),
        (np.arange(8.0, 0.0, -1.0), "it fades from disk_1 to disk_8"),
        (np.linspace(1.0, 1.4, 8), "it is alike along the body"),
        (np.array([1.0, 2, 3, 4, 3, 2, 1, 1]), "it is largest around disk_4"),
        (np.where(np.arange(8) == 4, 1.0, 0.1), "disk_5 alone carries most of it: check that marker"),
    ],
)
def test_the_place_in_words(plan: PreparedRecording, size: np.ndarray, said: str) -> None:
    assert place(plan, along_the_body(plan, size)) == said


def test_a_tip_alone_has_no_place() -> None:
    tip = planned(bench_day("tip_only", np.random.default_rng(0)))
    assert place(tip, np.ones((tip.n_sample, 3))) == ""


def bent(bench: PreparedRecording, *turns: tuple[int, float]) -> tuple[list[int], np.ndarray, list[np.ndarray]]:
    """All trials of a curved rod, its error (n, m), and where it should be: at chord `k` (0 at the base) a soft spot turns all
    above it by an angle about an axis, half of that within the chord itself."""
    trials = list(range(len(bench.inputs)))
    t = np.array([[0.004 * k, -0.002 * k, 0.02] for k in range(8)])
    turned = np.zeros(8)
    for k, angle in turns:
        turned[k] += 0.5 * angle
        turned[k + 1 :] += angle
    swing = np.sin(np.arange(bench.n_sample) + 0.5)[:, None, None]
    moved = swing * np.cumsum(np.cross(turned[:, None] * np.array([0.6, 0.8, 0.0]), t), axis=0)
    rest = [np.tile(np.cumsum(t, axis=0).ravel(), (len(i.time), 1)) for i in bench.inputs]
    return trials, moved.reshape(bench.n_sample, 24), rest


@pytest.mark.parametrize("at", [1, 4, 6])
def test_a_bend_at_one_place_is_found_there(plan: PreparedRecording, at: int) -> None:
    """Its jumps at both ends of a chord are alike; the turns are about an axis across chords that are not quite along z."""
    trials, off, rest = bent(plan, (at, 0.01))
    assert misbent_segment(plan, trials, off, rest) == at
    assert (
        describe_location(plan, trials, off, rest)
        == f" The fitted robot bends wrongly at one place, between disk_{at} and disk_{at + 1}."
    )


def test_a_bend_at_the_base_is_the_clamp(plan: PreparedRecording) -> None:
    said = describe_location(plan, *bent(plan, (0, 0.01)))
    assert said == " The fitted robot is off from its base on, as a whole: check the clamp and the camera."


def test_of_two_bends_the_larger_is_the_place_if_its_jumps_have_twice_the_square(plan: PreparedRecording) -> None:
    assert misbent_segment(plan, *bent(plan, (2, 0.01), (5, 0.0069))) == 2
    assert misbent_segment(plan, *bent(plan, (2, 0.01), (5, 0.0073))) is None
    assert describe_location(plan, *bent(plan, (2, 0.01), (5, 0.0073))) == ""


def test_chords_between_points_of_a_skin_tell_no_place(plan: PreparedRecording) -> None:
    skin = replace(plan, robot=load("finger"))
    assert misbent_segment(skin, *bent(plan, (4, 0.01))) is None
    assert describe_location(skin, *bent(plan, (4, 0.01))) == ""


def test_rows_in_which_a_marker_is_missing_have_no_say_in_the_place(plan: PreparedRecording) -> None:
    trials, off, rest = bent(plan, (4, 0.01))
    measured = [y.copy() for y in plan.measured]
    measured[0][3, 7] = np.nan
    off[3] = 1e3 * off[4][::-1]
    assert misbent_segment(replace(plan, measured=tuple(measured)), trials, off, rest) == 4
    assert misbent_segment(plan, trials, off, rest) != 4
    some = slice(len(plan.inputs[0].time), None)
    assert misbent_segment(plan, trials[1:], off[some], rest[1:]) == 4


def test_fewer_than_four_markers_have_no_bend_between_them() -> None:
    day = bench_day("hanging", np.random.default_rng(0))
    for disks, found in (((2, 4, 6), None), ((2, 4, 6, 8), 1)):
        few = planned(day, disks=disks)
        trials, off, rest = bent(few, (3, 0.01))  # between disk_3 and disk_4
        columns = [3 * (k - 1) + a for k in disks for a in range(3)]
        assert misbent_segment(few, trials, off[:, columns], [r[:, columns] for r in rest]) == found


def test_three_markers_have_a_place() -> None:
    few = planned(bench_day("hanging", np.random.default_rng(0)), disks=(2, 5, 8))
    swing = np.sin(np.arange(few.n_sample))[:, None]
    assert place(few, swing * np.repeat([1.0, 2.0, 3.0], 3)) == "it grows from disk_2 to disk_8"
    assert place(few, swing * np.repeat([3.0, 2.0, 1.0], 3)) == "it fades from disk_2 to disk_8"
    seen_along_x = replace(few, outputs=few.outputs[::3])
    assert place(seen_along_x, swing * [1.0, 3.0, 2.0]) == "it is largest around disk_5"
    assert misbent_segment(seen_along_x, [], swing, []) is None, "bends need all three"


def stepped(bench: PreparedRecording, after: int, size: float, drift: float = 0.0) -> np.ndarray:
    """Noise, with a step of `size` sigma in one channel from trial `after` on, and a drift of `drift` sigma through the day."""
    clock = np.concatenate([i.clock for i in bench.inputs])
    which = np.repeat(np.arange(len(bench.inputs)), [len(i.time) for i in bench.inputs])
    z = np.random.default_rng(0).normal(size=(bench.n_sample, len(bench.outputs)))
    z[:, 5] += size * (which >= after) + drift * clock / clock.max()
    return z


def test_a_step_is_dated_and_noise_and_drift_are_not(plan: PreparedRecording) -> None:
    trials = list(range(len(plan.inputs)))
    # A trial's mean of some 77 samples scatters by 0.11 sigma in each of 24 channels, 0.57 in all; a step of s sigma in mid-day
    # has a variance of s^2/4 and must be four times 0.57^2 = 0.32: s above 2.3.
    assert change(plan, trials, stepped(plan, 9, 3.5)) == (8, 9)
    assert change(plan, trials, stepped(plan, 9, 1.5)) is None
    assert change(plan, trials, stepped(plan, 9, 0.0)) is None
    assert change(plan, trials, stepped(plan, 9, 0.0, drift=10.0)) is None
    assert change(plan, trials[:3], stepped(plan, 2, 5.0)[: sum(len(i.time) for i in plan.inputs[:3])]) is None


def test_a_wave_is_taken_out_of_noise_whatever_its_phase(plan: PreparedRecording) -> None:
    trials = list(range(len(plan.inputs)))
    phases = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, len(trials))
    swing = np.concatenate([np.cos(2.0 * np.pi * 0.3 * i.time + p) for i, p in zip(plan.inputs, phases, strict=True)])
    x = np.random.default_rng(2).normal(size=(len(swing), 2))
    x[:, 0] += 2.0 * swing
    found = wave(plan, trials, x, 0.3)
    # Two parameters a trial of 70 samples and more: noise leaves sqrt(2/70) = 0.17 sigma RMS of itself.
    assert np.sqrt(np.mean((found[:, 0] - 2.0 * swing) ** 2)) < 0.2
    assert np.sqrt(np.mean(found[:, 1] ** 2)) < 0.2


def test_the_nearest_effect_is_a_hint_only_where_it_helps() -> None:
    said = " Of the known effects base tilt with contact comes nearest, but explains only 30 % of the error on left-out trials."
    assert nearest(("base_tilt", "contact"), 0.3) == said
    assert nearest(("base_tilt",), 0.05) == nearest(("base_tilt",), float("nan")) == ""
