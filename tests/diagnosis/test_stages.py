"""What stands between the large stages of a diagnosis, by hand: the look before it, the objective, what is handed on, the words."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.diagnosis.checks.test_design import bench as planned
from tools.simulators.rod.design import bench_day
from twin.body import Drive
from twin.diagnosis import Settings, pipeline
from twin.diagnosis.budget import Budget
from twin.diagnosis.calibration import first_calibration
from twin.diagnosis.calibration.first_calibration import sensitivity
from twin.diagnosis.checks import preview as look
from twin.diagnosis.checks.fit_warnings import strained, unlikely
from twin.diagnosis.checks.loops import loops
from twin.diagnosis.checks.mixed_robots import MixedRobots
from twin.diagnosis.checks.preview import preview_data
from twin.diagnosis.conclusion import Conclusion
from twin.diagnosis.evidence.discrepancy import COMPONENTS, Discrepancy
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.explain.words import components, mixed, since, structure, undecided, unlike, worst_channel
from twin.diagnosis.fit_context import FitContext
from twin.diagnosis.thresholds import FEWEST_TRIALS_FOR_HELD_OUT, NAMED_ONE_BY_ONE, UNLIKELY_PARAMETER_DISTANCE
from twin.effects import effect_class
from twin.foundation.errors import DataError, SolveError
from twin.foundation.parameters import Parameter
from twin.prediction.evaluate import OUTPUT_GROUPS
from twin.prediction.motion import without_damping
from twin.prediction.prepared import PreparedRecording


@pytest.fixture(scope="module")
def plan() -> PreparedRecording:
    return planned(bench_day("hanging", np.random.default_rng(0)))


def few(plan: PreparedRecording, n: int) -> PreparedRecording:
    return replace(plan, inputs=plan.inputs[:n], measured=plan.measured[:n])


# ---- words -----------------------------------------------------------------------------------------------------------------


def left(mean: np.ndarray, main: str = "memory") -> Discrepancy:
    """A smooth error whose component `main` is 0.5 sigma over all channels, the others 0.1."""
    variance = np.array([[0.25 if c == main else 0.01 for c in COMPONENTS]])
    return Discrepancy(0.0, mean, 0.0 * mean, variance, np.zeros((1, 1)))


def growing(plan: PreparedRecording) -> np.ndarray:
    """(n, m) an error that grows to the tip, of RMS 1, largest in disk_8_y."""
    size = np.array([(o.index + 1.0) * (1.5 if o.axis == 1 else 1.0) for o in plan.outputs])
    return np.ones((plan.n_sample, 1)) * size / np.sqrt((size**2).mean())


def test_what_is_left_is_said_with_its_size_its_channel_its_place_and_what_it_moves_with(plan: PreparedRecording) -> None:
    z, every = growing(plan), range(len(plan.inputs))
    smooth = "A smooth part of 1.00 sigma is left, largest in disk_8_y; it grows from disk_1 to disk_8"
    moves = "It moves mostly with the recent past (2-30 s) (0.50 sigma), strongest with 'T1'"
    said = structure(plan, every, z, left(z), "T1", (0.0, 0.2), AcceptanceLimits())
    assert said == f"{smooth}. {moves}."
    assert components(left(z)) == {c: pytest.approx(0.5 if c == "memory" else 0.1) for c in COMPONENTS}
    assert worst_channel(plan, -z) == "disk_8_y"
    one = np.where(np.arange(z.shape[1]) == 4, 1.0, 0.9 * np.sign(np.arange(z.shape[0]) % 2 - 0.5)[:, None])
    assert worst_channel(plan, -one) == plan.outputs[4].channel.name, "the largest square, not the largest value"


def test_a_line_is_said_beside_the_smooth_part_or_alone(plan: PreparedRecording) -> None:
    z, every, bars = growing(plan), range(len(plan.inputs)), AcceptanceLimits()
    swing = np.concatenate([np.sin(2.0 * np.pi * 0.31 * i.time + 1.0) for i in plan.inputs])[:, None]
    wave = 2.0 * z * swing
    worst = 2.0 * float(np.abs(z[0]).max())  # its amplitude in the worst channel
    line = f"A line at 0.31 Hz is left, of {worst:.1f} sigma in disk_8_y; it grows from disk_1 to disk_8."
    small = left(0.5 * bars.left * z)
    assert structure(plan, every, wave + small.mean, small, "T1", (2.0 * bars.faint, 0.31), bars) == line
    both = structure(plan, every, wave + z, left(z), "T1", (2.0 * bars.faint, 0.31), bars)
    assert both.startswith("A smooth part of 1.00 sigma")
    assert both.endswith(f". {line}")
    faint = structure(plan, every, wave, small, "T1", (0.5 * bars.faint, 0.31), bars)
    assert faint.startswith("A smooth part of 0.06 sigma"), "something must be said of what is left"


def test_a_step_is_told_with_its_minutes_into_the_session(plan: PreparedRecording) -> None:
    early = plan.inputs[0].clock - 600.0 * (
        np.arange(len(plan.inputs[0].clock)) == 0
    )  # ten minutes to the first trial's second row
    plan = replace(plan, inputs=(replace(plan.inputs[0], clock=early), *plan.inputs[1:]))
    every = list(range(len(plan.inputs)))
    which = np.repeat(np.arange(len(every)), [len(i.time) for i in plan.inputs])
    z = 0.1 * np.random.default_rng(0).normal(size=(plan.n_sample, len(plan.outputs)))
    start, names = plan.inputs[0].clock[0], [i.name.removesuffix(".csv") for i in plan.inputs]
    for after in (7, 9):
        last, first = plan.inputs[after - 1], plan.inputs[after]
        ago = f"{(last.clock[-1] - start) / 60:.0f} to {(first.clock[0] - start) / 60:.0f} min into the session"
        said = since(plan, every, z + 5.0 * (which >= after)[:, None])
        between = f"between {names[after - 1]} and {names[after]}, {ago}"
        assert said == f" The calibrated robot's error changed at once {between}: what moved then?"
    assert since(plan, every, z + 5.0 * (which >= 2)[:, None]) == "", "of 999 orders some begin with the same two"
    assert since(plan, every, z + 5.0 * (which >= 1)[:, None]) == "", "one trial alone is that trial's"
    assert since(plan, every, z) == ""


def test_a_drift_between_a_morning_and_an_afternoon_is_no_step(plan: PreparedRecording) -> None:
    """What grows with the clock through two bunches of trials, hours apart, looks like a step in their order."""
    n = len(plan.inputs)
    clocks = [i.clock + (3e5 if k >= n // 2 else 0.0) for k, i in enumerate(plan.inputs)]
    apart = replace(plan, inputs=tuple(replace(i, clock=c) for i, c in zip(plan.inputs, clocks, strict=True)))
    rows = np.concatenate(clocks)[:, None] / 3e5 * np.full(len(plan.outputs), 9.0)
    assert since(apart, range(n), rows) == ""
    step = 9.0 * (np.repeat(np.arange(n), [len(i.time) for i in plan.inputs]) >= n // 2 - 2)[:, None]
    assert since(apart, range(n), step + np.zeros(len(plan.outputs))) != "", "a step before the pause is one"


def test_two_robots_and_what_does_not_hold_elsewhere_are_told_in_words(plan: PreparedRecording) -> None:
    names = [i.name.removesuffix(".csv") for i in plan.inputs]

    def said(other: int) -> str:
        return mixed(plan, MixedRobots(tuple(range(other, len(names))), tuple(range(other)), 1.0))

    assert f"{len(names) - 2} the one, 2 the other ({names[0]}, {names[1]}), better than" in said(2)
    assert f"({', '.join(names[:NAMED_ONE_BY_ONE])}), better" in said(NAMED_ONE_BY_ONE)
    assert f"({', '.join(names[:NAMED_ONE_BY_ONE])} and 1 more), better" in said(NAMED_ONE_BY_ONE + 1)
    assert unlike(0.5, 0.1).startswith(" On left-out trials a smooth error of 0.50 sigma is left, on fitted ones 0.10:")
    assert undecided("base_tilt", "tip_payload").startswith(" Base tilt or tip payload would explain more")


# ---- doubts ----------------------------------------------------------------------------------------------------------------


def fitted(value: float, effect: str | None = None, ended: bool = False, low: float = -10.0, std: float | None = 0.5) -> Any:
    parameter = Parameter("stiffness", 2.0, "N/m", low, 10.0, "by hand", std=std)
    model = SimpleNamespace(free=[SimpleNamespace(effect=effect, parameter=parameter)], value=lambda free: value)
    model.twin = SimpleNamespace(values={"stiffness": value}, effects=())
    return SimpleNamespace(model=model, at_bound=lambda: np.array([ended]), std=lambda: np.zeros(1))


def test_a_parameter_far_from_its_description_is_doubted_and_an_effects_own_is_not() -> None:
    assert (
        unlikely(fitted(2.0 - 0.5 * (UNLIKELY_PARAMETER_DISTANCE - 0.1)))
        == unlikely(fitted(2.0 + 0.5 * (UNLIKELY_PARAMETER_DISTANCE - 0.1)))
        == []
    )
    assert unlikely(fitted(4.0, effect="friction")) == unlikely(fitted(9.0, std=None)) == []
    for value in (0.0, 4.0):
        said = unlikely(fitted(value))
        assert len(said) == 1
        assert said[0].startswith(
            f"stiffness came out 4.0 standard deviations of its description away ({value:.4g} N/m, described as 2)"
        )
    kept = fitted(4.0)
    kept.model.twin.values = {}
    assert unlikely(kept) == [], "a parameter the fit left alone is as described"


def test_a_law_that_may_go_either_way_and_ended_at_an_end_is_doubted() -> None:
    said = strained(fitted(10.0, effect="base_tilt", ended=True))
    assert said == [
        "base tilt: stiffness came out at the end of its range (10 N/m); this effect is fitted to something it does not describe"
    ]
    for other in (
        fitted(10.0, effect="base_tilt"), fitted(10.0, ended=True), fitted(10.0, effect="base_tilt", ended=True, low=0.0),
    ):  # fmt: skip
        assert strained(other) == []


def test_an_obstacle_softer_than_foam_is_doubted() -> None:
    """A magnet of 1 sigma beside the robot was "explained" by a wall of 0.15 N/m (bench day 90005)."""
    found, touched = fitted(2.0), effect_class("contact")
    found.model.twin.effects = (touched({"stiffness": 0.15}), effect_class("tendon_friction")({"mu": 0.1}))
    assert strained(found) == ["contact: an obstacle of 0.15 N/m is softer than foam, rather a force that depends on the pose"]
    found.model.twin.effects = (touched({"stiffness": 20.0}), touched())
    assert strained(found) == []


# ---- what stages hand on ----------------------------------------------------------------------------------------------------


def conclusion(claims: tuple[str, ...], **more: Any) -> Any:
    """A conclusion whose twins are their effects' names."""

    def weighed(*effects: str) -> Any:
        return SimpleNamespace(
            effects=effects, fit=SimpleNamespace(model=SimpleNamespace(twin="+".join(effects) or "base")), score=len(effects)
        )

    judged = SimpleNamespace(claims=[SimpleNamespace(effect=c) for c in claims], final=weighed(*claims), verdict="explained")
    gated = SimpleNamespace(without={c: weighed(*(x for x in claims if x != c)) for c in claims}, small=())
    found = SimpleNamespace(base=weighed(), all=[weighed(), weighed("creep"), weighed("creep", "tilt")])
    return Conclusion(*(more.get(n) for n in ("study", "screening")), found, gated, judged, ())  # type: ignore[arg-type]


def test_a_conclusion_knows_its_twins() -> None:
    found = conclusion(("creep", "tilt"))
    assert (found.base, found.final) == ("base", "creep+tilt")
    assert (found.without("creep"), found.without("tilt"), found.without("drift")) == ("tilt", "creep", "creep+tilt")
    assert (found.weighed(("tilt", "creep")), found.weighed(("creep",)), found.weighed(("drift",))) == ("creep+tilt", "creep", None)


def test_the_fall_is_told_by_group_in_the_order_of_the_outputs() -> None:
    """Three rows of two markers' coordinates around one tendon: 4 - 1 = 3 and 9 - 4 = 5 of each value's square."""
    groups = ("marker", "tendon", "marker")
    bench = SimpleNamespace(outputs=[SimpleNamespace(group=g) for g in groups])
    study = FitContext(SimpleNamespace(prepared=bench), None)  # type: ignore[arg-type]
    before, after = (SimpleNamespace(z=np.tile(v, 3)) for v in ([2.0, 3.0, -2.0], [1.0, -2.0, -1.0]))
    np.testing.assert_allclose(study.fall_by_group(before, after), [18.0, 15.0])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("drive", "lacks"), [(Drive.TENSION, 1.0 + 2.0 + 3.0 + 1.0 + 10.0 + 2.0), (Drive.DISPLACEMENT, 2.0 + 1.5 + 1.0 + 10.0 + 2.0)]
)
def test_a_law_that_lets_tendons_fall_slack_lacks_what_they_would_hear(
    drive: Drive, lacks: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of trials 2 and 0, in the objective's order; a tendon at zero is slack. One held by a tension is as good as that within 0.4
    of its reading's noise, 0.5 and 0.2 N: at 0.19 and 0.1 N of the first, not at 0.09 N of the second. What is taut lacks what the
    law does not pass on: 0.25 of 4 and 0.1 of 20, and half of 3 where no reading can make it slack."""
    heard = [np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[10.0, 20.0]])]
    noise = SimpleNamespace(drive=np.array([0.5, 0.2]))
    shares = {2: np.array([[1.0, 0.1], [0.5, 0.75]]), 0: np.array([[0.3, 0.9]])}
    bench = SimpleNamespace(driven_by=lambda kind: np.full(2, kind is drive), inputs=shares, pushes=False)
    monkeypatch.setattr(
        "twin.diagnosis.fit_context.transmitted_noise",
        lambda twin, share, noise, pair: share if (twin, len(noise)) == ("twin", 2) else 0.0,
    )
    study = FitContext(
        SimpleNamespace(whitener=SimpleNamespace(input_noise_energy=heard, noise=noise), trials=[2, 0], prepared=bench), None
    )  # type: ignore[arg-type]
    tension = {0: np.array([[0.0, 0.09]]), 1: np.zeros((5, 2)), 2: np.array([[0.19, 0.0], [0.1, 0.09]])}
    traces = {k: SimpleNamespace(true=SimpleNamespace(tension=t, antagonists=False)) for k, t in tension.items()}
    fit = SimpleNamespace(evaluation=SimpleNamespace(traces=traces), model=SimpleNamespace(twin="twin"))
    assert study.blocked_input_noise(fit) == pytest.approx(lacks)  # type: ignore[arg-type]
    bench.pushes = True  # rods: none is slack, and each lacks what the law does not pass on
    assert study.blocked_input_noise(fit) == pytest.approx(1.8 + 1.5 + 1.0 + 7.0 + 2.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("drive", [Drive.TENSION, Drive.CURRENT])
def test_the_sensitivity_of_a_linear_robot_is_its_matrix(
    drive: Drive, plan: PreparedRecording, monkeypatch: pytest.MonkeyPatch
) -> None:
    """y = A u. A spring feels sqrt(dt / (2 tau)) of what its current errs by from row to row, and never more than all of it."""
    A, near = np.random.default_rng(0).normal(size=(len(plan.outputs), 3)), []
    memory = np.array([0.1, 40.0, 1e-9])  # s
    inputs = tuple(replace(i, drives=(drive,) * 3) for i in plan.inputs[:3])
    robot: Any = SimpleNamespace(springs=lambda n: "springs", n_tendon=3)
    bench = replace(plan, robot=robot, inputs=inputs, measured=plan.measured[:3])
    monkeypatch.setattr(first_calibration, "thermal_time_constant", lambda springs: memory)

    def simulate(twin: Any, moved: PreparedRecording, trials: Any, options: Any) -> list[Any]:
        near.append(options.neighbours)
        for i, before in zip(moved.inputs, bench.inputs, strict=True):
            step = np.abs(i.command - before.command).max(axis=0) / bench.reading
            assert sorted(step)[:2] == [0.0, 0.0], "one tendon at a time"
            assert 1.0 < step.max() < 4.0, "as far as readings are uncertain: larger than rounding, smaller than a bend"
        return [SimpleNamespace(outputs=lambda twin, bench, k=k: moved.inputs[k].command @ A.T) for k in trials]

    monkeypatch.setattr(first_calibration, "simulate", simulate)
    trials, twin = [2, 0], SimpleNamespace(effects=())
    flat = [bench.inputs[k].command @ A.T for k in trials]
    G = sensitivity(bench, trials, twin, flat, {0: "near"})  # type: ignore[arg-type]
    for k, g in zip(trials, G, strict=True):
        dt = float(np.median(np.diff(bench.inputs[k].time)))
        felt = np.sqrt(np.minimum(1.0, dt / (2.0 * memory))) if drive is Drive.CURRENT else np.ones(3)
        np.testing.assert_allclose(g, np.broadcast_to(A * felt, (len(bench.inputs[k].time), *A.shape)), atol=1e-9)
    assert near == [{0: "near"}] * 3
    sensitivity(bench, trials, twin, flat)  # type: ignore[arg-type]
    assert near[3:] == [{}] * 3


def test_the_noise_is_read_from_a_first_rough_fit(plan: PreparedRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fit weighs by declared noise, and by what such sensors typically have where none is declared."""
    made: list[Any] = []
    bench = few(plan, 3)
    named = [replace(o, channel=replace(o.channel, noise=1e-3)) if n == 0 else o for n, o in enumerate(bench.outputs)]
    bench = replace(bench, outputs=tuple(named))

    def objective_by_hand(bench: PreparedRecording, trials: Any, whitener: Any, jobs: int) -> Any:
        made.append((list(trials), whitener, jobs))
        return SimpleNamespace(predict=lambda twin, traces: ("traces", f"predicted by {twin} near {traces}"))

    start = SimpleNamespace(model=SimpleNamespace(twin="rough"), evaluation=SimpleNamespace(traces="those", raw="left"))
    monkeypatch.setattr(first_calibration, "Objective", objective_by_hand)
    monkeypatch.setattr(first_calibration, "Model", SimpleNamespace(base=lambda robot, twin: "base"))
    monkeypatch.setattr(
        first_calibration, "Whitener", lambda noise, measured, G, command, taut=None: (noise, G, len(measured), len(command), taut)
    )
    monkeypatch.setattr(first_calibration, "fit", lambda of, model, stop: start)
    asked: list[Any] = []

    def sensitivity_by_hand(bench: PreparedRecording, trials: Any, twin: Any, predicted: Any, near: Any) -> list[np.ndarray]:
        asked.append((list(trials), twin, predicted, near, min(float(i.command.min()) for i in bench.inputs)))
        return [np.ones((len(bench.inputs[k].time), 24, 3)) for k in trials]

    monkeypatch.setattr(first_calibration, "sensitivity", sensitivity_by_hand)
    monkeypatch.setattr(first_calibration, "estimate_noise", lambda bench, trials, raw, G: ((raw, G), ["a note"]))
    below = np.zeros_like(bench.inputs[2].command)
    below[:3, 1] = bench.reading[1] * np.array([-0.5, -2.0, -9.0])
    bench = replace(bench, inputs=(*bench.inputs[:2], replace(bench.inputs[2], command=below)))
    model, _, notes = first_calibration.objective_of(bench, SimpleNamespace(robot=None), [0, 2], Settings(jobs=1))  # type: ignore[arg-type]
    assert (model, notes) == (start.model, ["a note"])
    (trials, (rough, none, n, _, unasked), jobs), (_, (noise, G, _, _, taut), _) = made
    assert unasked is None
    assert (trials, n, jobs) == ([0, 2], 2, 1)
    np.testing.assert_array_equal(rough.sigma, [1e-3, *[OUTPUT_GROUPS["marker"].typical_noise] * 23])
    assert not any(g.any() for g in none)
    assert asked == [([0, 2], "rough", "predicted by rough near those", "those", 0.0)], "no tendon slack"
    assert all(np.all(g == 1.0) for g in taut)
    np.testing.assert_allclose(G[1][:4, 5, 1], [0.75, 0.0, 0.0, 1.0], atol=1e-12)  # of a step of two readings what pulls
    G[1][:3, :, 1] = 1.0
    assert all(np.all(g == 1.0) for g in G)
    assert noise == ("left", G)


def test_a_length_below_zero_is_paid_out_and_felt_as_any(plan: PreparedRecording) -> None:
    paid_out = tuple(replace(i, drives=(Drive.DISPLACEMENT,) * 3, command=i.command - 5.0) for i in plan.inputs[:2])
    bench = replace(plan, inputs=paid_out, measured=plan.measured[:2])
    assert np.all(first_calibration._taut_share(bench, 0) == 1.0)
    np.testing.assert_array_equal(first_calibration._unslackened(bench).inputs[1].command, paid_out[1].command)


# ---- look -------------------------------------------------------------------------------------------------------------------


def test_the_look_seals_six_trials_and_no_fewer_and_says_what_it_does(
    plan: PreparedRecording, monkeypatch: pytest.MonkeyPatch
) -> None:
    sealed: list[Any] = []
    told: list[str] = []

    def trace(name: str) -> Any:
        return SimpleNamespace(true=name, outputs=lambda twin, bench: f"readings of {name}")

    monkeypatch.setattr(look, "simulate", lambda twin, bench: [trace(i.name) for i in bench.inputs])
    monkeypatch.setattr(look, "motion_as_measured", lambda bench, twin, seen, fitted, steps: (bench, tuple(seen)))
    monkeypatch.setattr(look, "unstable_starts", lambda bench, traces: [traces[1].true])
    monkeypatch.setattr(look, "suspicions", lambda bench, twin, s, nominal: sealed.append((list(s), nominal)) or ("odd",))
    for n, count in ((FEWEST_TRIALS_FOR_HELD_OUT - 1, 0), (FEWEST_TRIALS_FOR_HELD_OUT, 2)):
        day = without_damping(few(plan, n))
        found = preview_data(day, SimpleNamespace(effects=()), Settings(), told.append)  # type: ignore[arg-type]
        assert len(found.held_out) == count
        assert sealed[-1] == (list(found.held_out), found.nominal)
        assert found.nominal == tuple(f"readings of {i.name}" for i in day.inputs)
        assert found.prepared.notices == (*day.notices, f"{day.inputs[1].name}: unstable start, its shape is one of several")
        assert found.suspicions == ("odd",)
        assert found.loops.by_trial == tuple(loop for loop in loops(day).by_trial if loop.trial not in found.held_out)
    assert told == ["nominal prediction", "possible mistakes in the files"] * 2


def test_without_an_equilibrium_what_looks_wrong_is_said_with_it(plan: PreparedRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    def simulate(twin: Any, bench: PreparedRecording) -> None:
        raise SolveError("nothing holds")

    odd = SimpleNamespace(words="grams?", change="kg")
    monkeypatch.setattr(look, "simulate", simulate)
    monkeypatch.setattr(look, "suspicions", lambda bench, twin, sealed, nominal: (odd,) if nominal is None else ())
    with pytest.raises(SolveError, match=r"^nothing holds\nSuspicion: grams\?\. Change: kg\.$"):
        preview_data(plan, SimpleNamespace(), Settings())  # type: ignore[arg-type]


# ---- pipeline ---------------------------------------------------------------------------------------------------------------


class Piped:
    """`diagnose` with every stage by hand: what each was asked, and what was reported."""

    def __init__(self, bench: PreparedRecording, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked: list[tuple[list[int], float | None]] = []
        self.reported: list[Any] = []
        self.told: list[str] = []
        self.heard: list[Any] = []
        looked = SimpleNamespace(prepared=bench, nominal="nominal", suspicions=("odd",), held_out=(1, 3))
        monkeypatch.setattr(pipeline, "on_rows_of_outputs", lambda recording: recording)
        monkeypatch.setattr(pipeline, "thinned", lambda log, whole, budget: (log, 1))
        monkeypatch.setattr(pipeline, "prepare", lambda recording, robot: bench)
        monkeypatch.setattr(pipeline, "preview_data", lambda bench, twin, settings, progress: looked)
        monkeypatch.setattr(pipeline, "conclude", self.conclude)
        monkeypatch.setattr(
            pipeline,
            "_reported",
            lambda recording, looked, found, parts, settings: (self.reported.append((found, parts, settings)), None),
        )

    def conclude(self, bench: Any, twin: Any, sealed: Any, nominal: Any, settings: Settings, progress: Any) -> str:
        assert nominal == "nominal"
        self.asked.append((list(sealed), settings.budget))
        progress("at work")
        return f"without {list(sealed)}"

    def run(self, settings: Settings | None) -> None:
        twin: Any = SimpleNamespace(robot=None)
        pipeline.diagnose(SimpleNamespace(title="a day"), twin, settings, self.told.append, self.heard.append)  # type: ignore[arg-type]


def test_fewer_than_six_trials_are_each_sealed_in_turn_and_share_the_time(
    plan: PreparedRecording, monkeypatch: pytest.MonkeyPatch
) -> None:
    few_trials = Piped(few(plan, FEWEST_TRIALS_FOR_HELD_OUT - 1), monkeypatch)
    few_trials.run(Settings(budget=60.0))
    assert few_trials.asked == [*(([k], 10.0) for k in range(5)), ([], 10.0)]  # six diagnoses within the minute
    found, parts, settings = few_trials.reported[0]
    assert (found, settings.budget) == ("without []", 60.0)
    assert parts == [(f"without [{k}]", [k]) for k in range(5)]
    assert few_trials.told[1] == "5 trials, each held out in turn, 2 of 5: at work"
    assert few_trials.told[-1] == "all 5 trials: at work"
    assert [looked.suspicions for looked in few_trials.heard] == [("odd",)]
    few_trials.run(None)
    assert few_trials.asked[-1] == ([], None)


def test_six_trials_are_diagnosed_once_and_one_is_too_few(plan: PreparedRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    six = Piped(few(plan, FEWEST_TRIALS_FOR_HELD_OUT), monkeypatch)
    six.run(Settings(budget=60.0))
    assert six.asked == [([1, 3], 60.0)]
    assert six.reported[0][:2] == ("without [1, 3]", [("without [1, 3]", (1, 3))])
    two = Piped(few(plan, 2), monkeypatch)
    two.run(None)
    assert [sealed for sealed, _ in two.asked] == [[0], [1], []]
    one = Piped(few(plan, 1), monkeypatch)
    with pytest.raises(DataError, match="at least two trials"):
        one.run(None)


@pytest.mark.parametrize(
    ("verdict", "ambiguous", "runners", "between", "asks"),
    [
        ("explained", (), ("tilt",), ("a", "b"), True), ("explained", (("a", "b"),), (), ("a", "b"), True),
        ("noise", (("a", "b"),), ("tilt",), ("a", "b"), True), ("noise", (), ("tilt",), ("a", "b"), False),
        ("explained", (), (), ("a", "b"), False), ("explained", (("a", "b"),), ("tilt",), None, False),
    ],
)  # fmt: skip
def test_the_next_experiment_is_sought_where_there_is_a_doubt(
    verdict: str, ambiguous: Any, runners: Any, between: Any, asks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    rivals = None if between is None else tuple(SimpleNamespace(fit=f"fit of {x}") for x in between)
    judged = SimpleNamespace(verdict=verdict, ambiguous=ambiguous, runners_up=runners, between=rivals)
    whitener = SimpleNamespace(noise="noise")
    study = SimpleNamespace(
        prepared="bench", objective=SimpleNamespace(whitener=whitener), progress=told.append, budget=Budget(None)
    )
    monkeypatch.setattr(pipeline, "next_experiment", lambda *asked: asked)
    made = pipeline._experiment(SimpleNamespace(judged=judged, context=study), Settings(jobs=1))  # type: ignore[arg-type]
    assert made == (("bench", "noise", "fit of a", "fit of b", 1) if asks else None)
    assert told == (["next experiment"] if asks else [])


def test_every_trial_is_shown_by_the_twin_that_had_to_predict_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sealed ones as opened, the others by the twin that saw them."""
    monkeypatch.setattr(pipeline, "predicted", lambda twin, bench, trials: [f"{twin} sees {k}" for k in trials])
    opened = SimpleNamespace(predictions=lambda pick: {k: f"{pick(conclusion(('tilt',)))} opened {k}" for k in (1, 3)})
    made = conclusion(("creep",), study=SimpleNamespace(prepared="bench"))
    shown = pipeline._predictions(made, opened, ("a", "b", "c", "d"))  # type: ignore[arg-type]
    assert shown == {
        "nominal": ["a", "b", "c", "d"],
        "calibrated": ["base sees 0", "base opened 1", "base sees 2", "base opened 3"],
        "after": ["creep sees 0", "tilt opened 1", "creep sees 2", "tilt opened 3"],
    }


def test_a_calibration_is_judged_on_trials_it_has_not_seen(plan: PreparedRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of the others opened, 2 mm off in x; its standard errors are those at the answer."""
    asked: dict[str, Any] = {}
    day = replace(without_damping(few(plan, 6)), measured=tuple(y + 5e-3 for y in plan.measured[:6]))
    off = np.array([2e-3 if o.axis == 0 else 0.0 for o in day.outputs])
    fitted = SimpleNamespace(model=SimpleNamespace(twin="calibrated"))

    def fit(objective: Any, start: Any, refresh: bool) -> Any:
        asked["fit"] = objective, start, refresh
        return fitted

    def clean(bench: PreparedRecording, nominal: Any) -> Any:
        asked.setdefault("seen", []).append([k for k, y in enumerate(bench.measured) if np.isfinite(y).any()])
        return bench, ["a spike"]

    monkeypatch.setattr(pipeline, "on_rows_of_outputs", lambda recording: recording)
    monkeypatch.setattr(pipeline, "thinned", lambda log, whole, budget: (log, 1))
    monkeypatch.setattr(pipeline, "prepare", lambda recording, robot: day)
    monkeypatch.setattr(pipeline, "predicted", lambda twin, bench, trials: [bench.measured[k] - off for k in trials])
    monkeypatch.setattr(pipeline, "without_spikes", clean)
    monkeypatch.setattr(pipeline, "objective_of", lambda bench, twin, trials, settings: ("start", "objective", []))
    monkeypatch.setattr(pipeline, "fit", fit)
    found, error, notices = pipeline.calibrated_fit(None, SimpleNamespace(robot=None))  # type: ignore[arg-type]
    assert found is fitted
    assert asked["fit"] == ("objective", "start", True)
    open_, sealed = asked["seen"]
    assert sorted(open_ + sealed) == list(range(6))
    assert len(sealed) == 2
    assert error == "2.000 mm"
    assert notices == (*day.notices, "a spike")
