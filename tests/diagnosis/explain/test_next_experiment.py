"""The menu of next experiments: within what the robot was commanded, and never of nothing."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from tests.diagnosis.checks.test_design import bench
from tests.robots.test_motors import RADIUS, turned
from tests.robots.test_motors import robot as motor_robot
from tools.simulators.rod.design import bench_day
from twin.body import Drive
from twin.diagnosis.explain import next_experiment as stage
from twin.diagnosis.explain.next_experiment import Experiment, menu, next_experiment
from twin.diagnosis.noise.model import Noise
from twin.foundation.errors import SolveError
from twin.prediction.prepared import PreparedRecording, prepare


@cache
def planned(design: str) -> PreparedRecording:
    return bench(bench_day(design, np.random.default_rng(0)))


def scaled(day: PreparedRecording, share: float) -> PreparedRecording:
    return replace(day, inputs=tuple(replace(i, command=share * i.command) for i in day.inputs))


@pytest.mark.parametrize("design", ["default", "by_length"])
@pytest.mark.parametrize("share", [1.0, 0.01])
def test_what_is_proposed_was_commanded_before_and_is_not_nothing(design: str, share: float) -> None:
    day = scaled(planned(design), share)
    top = max(float(np.abs(i.command).max()) for i in day.inputs)
    proposed = menu(day)
    assert len(proposed) > 6
    for words, trial in proposed:
        assert np.abs(trial.command).max() <= top * (1.0 + 1e-12), words
        assert not re.search(r"(?<![\d.])0(\.0+)? (N|mm|A)\b", words), words
        assert words.startswith("rest") or np.abs(trial.command).max() > 0.5 * top, words


def test_a_robot_that_was_never_commanded_is_asked_for_rest_alone() -> None:
    still = scaled(planned("default"), 0.0)
    assert {words.split(",")[0] for words, _ in menu(still)} == {"rest unloaded for 60 s"}


def test_the_menu_has_a_pull_that_parts_direction_from_time() -> None:
    """Some commands are reached by release before they are pulled to again."""
    day = planned("default")
    trial = next(t for words, t in menu(day) if "release it to half, pull it again" in words)
    pull = trial.command[:, 0]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(pull))))
    assert len(turns) == 3  # top, half, top
    assert pull[[0, -1]].tolist() == [0.0, 0.0]
    assert pull[turns[1] + 1] == pytest.approx(0.5 * pull.max(), rel=0.05)


@pytest.mark.parametrize(("heaviest", "asked"), [(0.0, [0, 10]), (0.005, [0, 15]), (0.02, [0, 30])])
def test_a_payload_is_asked_for_up_to_three_times_the_heaviest_and_30_g(heaviest: float, asked: list[int]) -> None:
    day = planned("default")
    light = tuple(replace(i, loads=replace(i.loads, payload=heaviest if k == 2 else 0.0)) for k, i in enumerate(day.inputs))
    proposed = menu(replace(day, inputs=light))
    assert sorted({round(1e3 * t.loads.payload) for _, t in proposed}) == asked
    assert {words.split(", ")[-1] for words, _ in proposed} == {f"tip payload {g} g" for g in asked}


def test_a_trial_comes_a_minute_after_the_last_and_has_the_rate_that_it_says() -> None:
    day = planned("default")
    last = max(i.clock[-1] for i in day.inputs)
    for words, trial in menu(day):
        said = re.search(r"(\d+) s", words)
        assert said
        assert trial.time[-1] == float(said[1]), words
        np.testing.assert_allclose(trial.clock - trial.time, last + 60.0)
    slow, fast = (next(t for w, t in menu(day) if w.startswith("pull tendon 2") and how in w) for how in ("y (120 s)", "t (4 s)"))
    np.testing.assert_array_equal(slow.command, fast.command)
    top = max(float(i.command[:, 1].max()) for i in day.inputs)
    assert slow.command[:, 1].max() == pytest.approx(max(float(i.command.max()) for i in day.inputs))
    assert top <= slow.command[:, 1].max()
    assert not slow.command[:, [0, 2]].any()
    assert slow.command[[0, -1], 1].tolist() == [0.0, 0.0]


def test_a_pull_and_its_release_are_as_fast() -> None:
    """So that a loop between them is friction's, not the rate's: seen backwards in time the trial is the same."""
    pulls = [t for words, t in menu(planned("default")) if "and release it, " in words and "again" not in words]
    assert len(pulls) >= 6
    for trial in pulls:
        np.testing.assert_allclose(trial.command, trial.command[::-1])
        np.testing.assert_allclose(np.abs(np.diff(trial.command[:, trial.command.any(axis=0)], axis=0)).min(axis=0).max(), 0.0)


def test_a_tendon_that_does_not_pull_is_paid_out_where_displacements_are_commanded() -> None:
    day = planned("by_length")
    held = next(t for w, t in menu(day) if w.startswith("step tendon 3"))
    top = max(float(i.command.max()) for i in day.inputs)
    np.testing.assert_allclose(held.command[1:], np.tile([-0.75, -0.75, 0.75], (len(held.time) - 1, 1)) * top)
    assert not any("circle" in words for words, _ in menu(day))
    assert any("circle" in words for words, _ in menu(planned("default")))


def test_a_circle_pulls_each_tendon_in_its_turn() -> None:
    """0.6 (1 + cos) / 2, a third of a turn apart: together nine tenths of the largest command at all times."""
    day = planned("default")
    top = max(float(i.command.max()) for i in day.inputs)
    circle = next(t for w, t in menu(day) if "circle" in w)
    np.testing.assert_allclose(circle.command.sum(axis=1), 0.9 * top)
    np.testing.assert_allclose(circle.command[[0, -1]] / top, np.tile([0.6, 0.15, 0.15], (2, 1)))
    third = np.abs(circle.time - 80.0 / 3.0).argmin()
    assert int(np.argmax(circle.command[third])) == 1


def test_springs_are_heated_and_given_time_to_cool() -> None:
    day = planned("default")
    heated = tuple(replace(i, drives=(Drive.CURRENT,) * 3) for i in day.inputs)
    proposed = {words: trial for words, trial in menu(replace(day, inputs=heated)) if "spring 2" in words}
    assert len(proposed) == 8
    for words, trial in proposed.items():
        assert re.match(r"heat spring 2 with up to [\d.]+ A\b|step spring 2 to ", words)
        assert trial.time[-1] >= 40.0, words
    assert {"slowly (120 s)", "fast (40 s)", "slowly (240 s)"} <= {words.split(", ")[-2] for words in proposed}


def test_a_jaw_is_asked_for_torques_from_none_to_the_largest() -> None:
    day = planned("default")
    turned = [replace(i, loads=replace(i.loads, torque=np.full(1, 0.02 + 0.01 * (k % 3)))) for k, i in enumerate(day.inputs)]
    jaw: Any = SimpleNamespace(build=lambda: SimpleNamespace(load_channels={"jaw_torque": "torque"}), n_tendon=3)
    proposed = menu(replace(day, inputs=tuple(turned), robot=jaw))
    assert sorted({float(t.loads.torque[0]) for _, t in proposed}) == pytest.approx([0.0, 0.01, 0.02, 0.04])
    assert {words.split(", ")[-1] for words, _ in proposed} == {f"load torque {x} N m" for x in ("0", "0.01", "0.02", "0.04")}


# ---- by hand ---------------------------------------------------------------------------------------------------------------

RNG = np.random.default_rng(0)
KNOWN = np.diag([2.0, 0.5])  # what today's data tell of the rival's two parameters


class Lines:
    """Stands in for `Objective`: on every trial two models differ by `d`, and the rival's parameters move it by `J`."""

    d: ClassVar[dict[str, np.ndarray]] = {}
    J: ClassVar[dict[str, np.ndarray]] = {}
    lost: ClassVar[set[str]] = set()

    def __init__(self, bench: PreparedRecording, trials: list[int], whitener: Any, jobs: int) -> None:
        (self.name,) = (i.name for i in bench.inputs)
        assert (trials, len(bench.measured[0])) == ([0], len(bench.inputs[0].time))
        assert not whitener.noise.drive.any()

    def evaluate(self, model: Any, near: Any = None) -> Any:
        if self.name in self.lost:
            raise SolveError("lost")
        assert near == (None if model.rival else "the rival's")
        of_rival = np.ones(8)
        return SimpleNamespace(z=of_rival + (0.0 if model.rival else self.d[self.name]), traces="the rival's")

    def jacobian(self, at: Any, which: range) -> np.ndarray:
        assert (at.z == 1.0).all()
        assert list(which) == [0, 1]
        if f"J {self.name}" in self.lost:
            raise SolveError("lost")
        return self.J[self.name]


def fitted(rival: bool) -> Any:
    twin = SimpleNamespace(effects=[SimpleNamespace(id="creep" if rival else "friction")])
    return SimpleNamespace(model=SimpleNamespace(twin=twin, free=[0, 1], rival=rival), information=lambda: KNOWN)


def proposed(monkeypatch: pytest.MonkeyPatch, *lost: str, **trials: tuple[np.ndarray, np.ndarray]) -> Experiment | None:
    """Of a menu of these trials, with d and J of each."""
    day = planned("default")
    monkeypatch.setattr(stage, "Objective", Lines)
    monkeypatch.setattr(stage, "menu", lambda bench: [(name, replace(day.inputs[0], name=name)) for name in trials])
    Lines.d, Lines.J = ({n: t[k] for n, t in trials.items()} for k in (0, 1))
    Lines.lost = set(lost)
    m = len(day.outputs)
    noise = Noise(np.ones(m), np.full(day.n_tendon, 0.1), np.zeros(m), "by hand")
    return next_experiment(day, noise, fitted(False), fitted(True), jobs=1)


def test_no_derivatives_are_taken_of_trials_that_cannot_separate_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a rival could imitate only lessens |d|^2: of trials that differ by less than is found already, or by as much, no
    solves of all its neighbours are paid for."""
    d, nothing, taken = RNG.normal(size=8), np.zeros((8, 2)), []

    class Counted(Lines):
        def jacobian(self, at: Any, which: range) -> np.ndarray:
            taken.append(self.name)
            return super().jacobian(at, which)

    monkeypatch.setattr(sys.modules[__name__], "Lines", Counted)
    found = proposed(monkeypatch, best=(d, nothing), alike=(d, nothing), less=(0.9 * d, nothing), least=(0.1 * d, nothing))
    assert found is not None
    assert (found.words, taken) == ("best", ["best"])
    taken.clear()
    imitated = np.column_stack([9.0 * d, d])  # all of it: no trial to propose, and the same with a load that is not felt
    found = proposed(monkeypatch, loud=(9.0 * d, imitated), loaded=(9.0 * d, imitated), best=(d, nothing))
    assert found is not None
    assert (found.words, taken) == ("best", ["loud", "best"])


def apart(d: np.ndarray, J: np.ndarray) -> float:
    """min over x of |d - J x|^2 + x' KNOWN x, as least squares written out."""
    A, b = np.vstack([J, np.sqrt(KNOWN)]), np.append(d, [0.0, 0.0])
    return float(((b - A @ np.linalg.lstsq(A, b, rcond=None)[0]) ** 2).sum())


def test_the_trial_that_the_rival_cannot_imitate_is_proposed_with_the_runs_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """`loud` differs most, but mostly by what the rival's parameters do; `far` as much as `best`, and comes later."""
    J = RNG.normal(size=(8, 2))
    loud, best = 9.0 * J[:, 0] + 0.1 * RNG.normal(size=8), RNG.normal(size=8)
    found = proposed(monkeypatch, loud=(loud, 90.0 * J), faint=(0.1 * best, J), best=(best, J), far=(best, J))
    assert found is not None
    assert (found.words, found.trial.name) == ("best", "best")
    assert found.separation == pytest.approx(apart(best, J), rel=1e-6)  # held by 1e-9
    assert apart(loud, 90.0 * J) < found.separation < float(best @ best) < float(loud @ loud)
    assert found.repeats == np.ceil(25.0 / found.separation) > 1
    assert found.between == (("friction",), ("creep",))


def test_a_trial_that_cannot_be_solved_is_nobodys_next(monkeypatch: pytest.MonkeyPatch) -> None:
    d, J = RNG.normal(size=8), RNG.normal(size=(8, 2))
    for lost in ("steep", "J steep"):
        found = proposed(monkeypatch, lost, steep=(9.0 * d, J), flat=(d, J))
        assert found is not None
        assert found.words == "flat"
    assert proposed(monkeypatch, "flat", flat=(d, J)) is None


def test_one_run_may_do_and_more_than_fifty_are_no_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    d, J = np.eye(8)[0], np.zeros((8, 2))
    for separation, repeats in ((100.0, 1), (0.5001, 50), (0.4999, None), (0.0, None)):
        found = proposed(monkeypatch, only=(np.sqrt(separation) * d, J))
        assert (found and found.repeats) == repeats


def test_a_robot_with_motors_is_asked_to_turn_them(tmp_path: Path) -> None:
    """A motor pulls one antagonist in as it lets the other go, and the other pair stays where it is."""
    built = motor_robot(tmp_path / "r")
    angle = np.column_stack([np.linspace(0.0, -0.4, 7), np.linspace(0.0, 0.3, 7)])
    proposed = [(words, t.command) for words, t in menu(prepare(turned(angle), built)) if not words.startswith("rest")]
    assert {words.split(" to ")[0].removeprefix("step ") for words, _ in proposed if "three quarters" not in words} == {
        "turn motor_1_angle", "turn motor_2_angle",
    }  # fmt: skip
    for words, command in proposed:
        mine, other = ((0, 2), (1, 3)) if "motor_1" in words else ((1, 3), (0, 2))
        np.testing.assert_allclose(command[:, mine[0]], -command[:, mine[1]], atol=1e-15)
        assert not command[:, other].any()
    farthest = next(c for words, c in proposed if words.startswith("turn motor_1_angle to -0.4 rad and release it, slowly"))
    assert farthest[:, 0].min() == pytest.approx(-0.4 * RADIUS)
