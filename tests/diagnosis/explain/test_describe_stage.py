"""The stage `describe` by hand: which words are said when."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.explain import describe as stage
from twin.diagnosis.explain.describe import Description, describe
from twin.diagnosis.thresholds import LARGE_STRUCTURE

SIGMA = np.array([2.0, 5.0])  # SI
MEASURED, LEFT = np.array([[10.0, 20.0], [30.0, 40.0]]), np.array([[1.0, 2.0], [3.0, 4.0]])
MEAN = np.array([[0.1, 0.2], [0.3, 0.4]])  # sigma
SIZE = 0.7
BARS = AcceptanceLimits(left=0.5)


class World:
    """Every sentence is one word; what it was made of is checked as it is asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.size, self.unseen, self.quick, self.verdict, self.rigs = SIZE, 0.1, 0.1, "unexplained", None
        self.beyond_accuracy = SIZE
        self.strained: tuple[str, ...] = ()
        self.score, self.predicted = 0.0, True  # of the sets that are not in force; how the best was chosen
        self.runners: list[Any] = []
        self.doubtful: tuple[str, ...] = ()
        self.doubts: list[Any] = []
        for name in ("structure", "describe_location", "since", "extrapolation", "unlikely", "left_out", "nearest"):
            monkeypatch.setattr(stage, name, getattr(self, name))
        self.pulled: Any = None
        monkeypatch.setattr(stage, "pose_dependent_force", lambda study, final: self.pulled)
        monkeypatch.setattr(stage, "mixed", lambda bench, rigs: f" two {rigs}.")
        monkeypatch.setattr(stage, "chatter", lambda size: f" chatter {size}.")
        monkeypatch.setattr(stage, "unlike", lambda unseen, size: f" unlike {unseen} {size}.")
        monkeypatch.setattr(stage, "undecided", lambda effect, rival: f" {effect} or {rival}.")
        monkeypatch.setattr(stage, "repeatability", lambda study, fit: ("repeats",))
        monkeypatch.setattr(stage, "undersampled_commands", lambda bench, trials, fit: [f"leaps of {trials}"])
        monkeypatch.setattr(stage, "components", lambda discrepancy: {"static": 1.0})
        monkeypatch.setattr(stage, "worst_channel", lambda bench, z: f"worst of {z.shape}")

    def model(self, *effects: str) -> Any:
        evaluation = SimpleNamespace(raw=[LEFT])
        fit = SimpleNamespace(effects=effects, z=np.arange(4.0), evaluation=evaluation)
        left = SimpleNamespace(mean=MEAN, size=self.size)
        return SimpleNamespace(effects=effects, fit=fit, discrepancy=left, score=self.score if effects else 0.0)

    def structure(self, bench: Any, trials: Any, z: np.ndarray, left: Any, strongest: str, line: Any, bars: Any) -> str:
        assert (z.shape, strongest, line, bars) == ((2, 2), "T1", (31.0, 0.5), BARS)
        return "Structure."

    def describe_location(self, bench: Any, trials: Any, off: np.ndarray, predicted: list[np.ndarray]) -> str:
        np.testing.assert_allclose(off, MEAN * SIGMA)
        np.testing.assert_allclose(predicted, [MEASURED - LEFT])
        return " where."

    def since(self, bench: Any, trials: Any, z: np.ndarray) -> str:
        np.testing.assert_array_equal(z, np.arange(4.0).reshape(2, 2))
        return " since."

    def extrapolation(self, study: Any, final: Any, gated: Any, by_time: bool) -> list[Any]:
        assert by_time is (self.verdict == "partly_explained")
        return [SimpleNamespace(words=lambda: "far")]

    def unlikely(self, fit: Any) -> list[str]:
        return ["unlikely"]

    def left_out(self, study: Any, fit: Any) -> Any:
        return SimpleNamespace(headline={(): 4.0, ("creep", "drift"): 1.0}[fit.effects])

    def nearest(self, effects: tuple[str, ...], share: float) -> str:
        return f" nearest {'+'.join(effects)} {share:.2f}."

    def said(self) -> Description:
        final = self.model()
        signs = SimpleNamespace(
            line=(31.0, 0.5), strained=self.strained, unseen=self.unseen, quick=self.quick, after=self.beyond_accuracy
        )
        judged: Any = SimpleNamespace(
            verdict=self.verdict, final=final, rigs=self.rigs, signs=signs, runners_up=self.runners, doubtful=self.doubtful
        )
        bench = SimpleNamespace(measured={3: MEASURED})
        objective = SimpleNamespace(whitener=SimpleNamespace(noise=SimpleNamespace(sigma=SIGMA)))
        evidence = SimpleNamespace(strongest=lambda left: [("T1", 0.5), ("T2", 0.1)])
        study: Any = SimpleNamespace(prepared=bench, trials=[3], objective=objective, evidence=evidence)
        found: Any = SimpleNamespace(
            base=final, all=[self.model("drift"), self.model("creep", "drift"), final], predicted=self.predicted
        )
        return describe(study, found, SimpleNamespace(doubts=self.doubts), judged, BARS)  # type: ignore[arg-type]


@pytest.mark.parametrize("verdict", ["noise", "explained"])
def test_what_is_explained_leaves_noise_and_its_doubts(verdict: str, monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)
    world.verdict, world.doubts = verdict, [SimpleNamespace(effect="a", rival="b")]
    found = world.said()
    assert found.words == "What is left looks like noise (smooth part 0.70 sigma). a or b."
    world.beyond_accuracy = 0.2
    own = "0.70 sigma, 0.20 beyond the description's accuracy"
    assert world.said().words == f"What is left looks like noise (smooth part {own}). a or b."
    assert found.notices == ("unlikely", "repeats", "leaps of [3]", "far")
    assert (found.strongest, found.worst_channel) == ((("T1", 0.5), ("T2", 0.1)), "worst of (2, 2)")
    assert found.components == {"static": 1.0}


@pytest.mark.parametrize(
    ("verdict", "score", "predicted", "said"),
    [("partly_explained", 1.0, True, True), ("partly_explained", 0.0, True, False), ("partly_explained", 1.0, False, False),
     ("unexplained", 1.0, True, False)],
)  # fmt: skip
def test_what_was_chosen_against_the_evidence_says_so(
    verdict: str, score: float, predicted: bool, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = World(monkeypatch)
    world.verdict, world.score, world.predicted = verdict, score, predicted
    assert (stage.PREDICTED in world.said().notices) is said


def test_claims_less_likely_than_not_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)
    world.verdict, world.doubtful = "partly_explained", ("load_cell_gain", "tilt")
    said = world.said().notices
    assert any(n.startswith("load cell gain and tilt: less likely than not") for n in said)
    world.doubtful = ()
    assert not any("less likely" in n for n in world.said().notices)


def test_what_is_left_is_said_with_its_place_and_since_when(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)
    assert world.said().words == "Structure. where. since."
    world.size = BARS.left  # too little to have a place
    assert world.said().words == "Structure. since."


def test_a_force_on_the_tip_is_said_after_the_place(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)
    world.pulled = SimpleNamespace(words=lambda: " pulled.")
    assert world.said().words == "Structure. where. pulled. since."
    world.size = BARS.left
    assert world.said().words == "Structure. since."


def test_two_rigs_and_laws_at_their_limit_are_said_in_words_and_as_notices(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)
    world.rigs, world.strained = "rigs", ("creep bent", "drift bent")  # type: ignore[assignment]
    found = world.said()
    assert found.words == "Structure. where. since. two rigs. The creep bent. The drift bent."
    assert found.notices == ("unlikely", "creep bent", "drift bent", "repeats", "leaps of [3]", "two rigs.", "far")


def test_a_smooth_error_on_trials_left_out_is_said_above_both_bars(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)
    assert BARS.left > LARGE_STRUCTURE
    world.verdict = "partly_explained"
    for unseen, said in ((0.5, ""), (0.51, " unlike 0.51 0.7.")):
        world.unseen = unseen
        assert world.said().words == f"Structure. where. since.{said}"
    world.verdict = "unexplained"
    assert world.said().words == "Structure. where. since.", "nothing was found that could hold there or not"


def test_what_is_neither_smooth_nor_noise_is_said_above_both_bars(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)
    for quick, said in ((0.5, ""), (0.51, " chatter 0.51.")):
        world.quick = quick
        assert world.said().words == f"Structure. where.{said} since."


def test_the_runner_up_is_said_with_the_share_it_takes_off_the_error_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of mean squares 4 and 1 sigma^2: half of the error."""
    world = World(monkeypatch)
    world.runners = [SimpleNamespace(effect="drift", beside=("creep",)), SimpleNamespace(effect="tilt", beside=())]
    assert world.said().words == "Structure. where. since. nearest drift+creep 0.50."
    world.doubts = [SimpleNamespace(effect="drift", rival="bias")]
    assert "nearest" not in world.said().words, "one of two that explain it is no near miss"
