"""What passes the gates: by hand, with refits whose costs are known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.body import Drive
from twin.diagnosis.budget import Budget
from twin.diagnosis.checks.identifiability import Visibility
from twin.diagnosis.evidence.null_distribution import AcceptanceLimits
from twin.diagnosis.search.screen import Screening
from twin.diagnosis.verdict import gate as stage
from twin.diagnosis.verdict.gate import gate

N = 10_000  # samples


class World:
    """Sets of effects whose |z|^2 falls by n a^2 for each effect of a sigmas: in the markers, or where `sensed` in the sensors."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **sigmas: float) -> None:
        self.sigmas = sigmas
        self.sensed: set[str] = set()
        self.history = 0.0  # what of an effect depends on more than the pose, sigma
        self.plainly: dict[str, float] = {}  # by how many sigmas an effect moves the outputs as they are; negative: away from them
        self.plain_history = 0.0  # what of that depends on more than the pose
        self.context: Any = SimpleNamespace(
            objective=SimpleNamespace(n=N, bends=False), budget=Budget(), progress=lambda words: None,
            fall_by_group=lambda a, b: a.z**2 - b.z**2,
            evidence=SimpleNamespace(beyond_pose=self.beyond_pose), unwhitened=lambda fit: fit.plain, accuracy=0.0,
            excused=np.full(2, np.inf),
        )  # fmt: skip
        self.rest: dict[tuple[str, ...], tuple[float, float]] = {}  # smooth error fitted, left out
        monkeypatch.setattr(stage, "refit_without", lambda s, base, best, e, known: self.of(*(x for x in best.effects if x != e)))
        monkeypatch.setattr(stage, "left_out", lambda study, fit: self.left_out(fit.effects))
        monkeypatch.setattr(stage, "with_effect_added", lambda study, rest, rival, start: self.of(*rest.effects, rival))
        monkeypatch.setattr(stage, "described", lambda study, rest: None)

    def beyond_pose(self, z: np.ndarray) -> float:
        if z.size == 1:
            return self.plain_history
        self.asked = z
        return self.history

    def of(self, *effects: str) -> Any:
        missing = {e: a**2 for e, a in self.sigmas.items() if e not in effects}
        square = N * (1.0 + sum(missing.values()))
        felt = N * sum(a for e, a in missing.items() if e in self.sensed)
        plain = np.sqrt([N * (100.0 + sum(a * abs(a) for e, a in self.plainly.items() if e not in effects))])
        fit = SimpleNamespace(z=np.sqrt([square - felt, felt]), effects=tuple(sorted(effects)), fitted=lambda e: {}, plain=plain)
        size_of = self.rest.get(tuple(sorted(effects)), (0.0, 0.0))[0]
        laws = tuple((e, "toe" if e == "ropes" else "") for e in sorted(effects))
        size = SimpleNamespace(beyond=lambda accuracy: size_of - accuracy, size=size_of)
        return SimpleNamespace(effects=tuple(sorted(effects)), forms=laws, fit=fit, score=-square, discrepancy=size)

    def left_out(self, effects: tuple[str, ...]) -> Any:
        return SimpleNamespace(structure=self.rest.get(tuple(sorted(effects)), (0.0, 0.0))[1])

    def gated(self, *effects: str, table: tuple[Visibility, ...] = (), accuracy: float = 0.0) -> Any:
        best = self.of(*effects)
        found: Any = SimpleNamespace(base=self.of(), best=best, all=(best, self.of()))
        patterns: Any = tuple(SimpleNamespace(effect=v.rival, start=None) for v in table)
        screening = Screening(SimpleNamespace(patterns=patterns), AcceptanceLimits(accuracy=accuracy), table)  # type: ignore[arg-type]
        return gate(self.context, found, screening)


def row(effect: str, apart: float, rival: str = "rival", form: str = "") -> Visibility:
    return Visibility(effect, 0.1, apart, 0.1, rival, ("x", 1.0, "1"), (), form)


@pytest.mark.parametrize(("toe", "stretch", "doubts"), [(0.4, 9.0, 0), (0.6, 0.1, 1)])
def test_an_effect_is_held_against_what_the_design_tells_of_the_law_in_force(
    monkeypatch: pytest.MonkeyPatch, toe: float, stretch: float, doubts: int
) -> None:
    """Ropes of 0.5 sigma that have a toe: how a stretch would be told from ageing does not count."""
    table = (row("ropes", stretch, form="stretch"), row("ropes", toe, form="toe"))
    world = World(monkeypatch, ropes=0.5, rival=0.0)
    world.of = _as_good(world, "ropes", 20.0)  # type: ignore[method-assign]
    assert len(world.gated("ropes", table=table).doubts) == doubts


def test_an_effect_that_moves_too_little_is_listed_and_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    found = World(monkeypatch, friction=0.5, delay=0.12).gated("friction", "delay")
    assert found.best.effects == ("friction",)
    assert [(s.effect, round(s.contribution, 6)) for s in found.small] == [("delay", 0.12)]
    assert set(found.without) == {"friction"}
    assert World(monkeypatch, friction=0.5, delay=0.14).gated("friction", "delay").small == ()


def test_the_bar_is_the_twins_accuracy_where_that_is_higher(monkeypatch: pytest.MonkeyPatch) -> None:
    found = World(monkeypatch, friction=0.5).gated("friction", accuracy=0.6)
    assert found.best.effects == ()
    assert found.without == {}


@pytest.mark.parametrize(
    ("moves", "excused", "sensed", "kept"),
    [(0.5, 0.4, True, True), (0.5, 0.6, True, False), (0.5, 0.4, False, False), (0.12, 0.1, True, False)],
)
def test_or_where_the_sensors_alone_move_by_more_than_theirs(
    monkeypatch: pytest.MonkeyPatch, moves: float, excused: float, sensed: bool, kept: bool
) -> None:
    """A gain of 0.5 sigma over all outputs, all of it in sensors whose own inaccuracy makes `excused`; but never below 0.13."""
    world = World(monkeypatch, gain=moves)
    world.sensed, world.context.excused = {"gain"} if sensed else set(), np.array([np.inf, excused**2 * N])
    assert world.gated("gain", accuracy=0.6).best.effects == (("gain",) if kept else ())


@pytest.mark.parametrize(("history", "kept"), [(0.12, False), (0.14, True)])
def test_what_depends_on_how_a_pose_was_reached_is_no_inaccuracy_of_the_description(
    monkeypatch: pytest.MonkeyPatch, history: float, kept: bool
) -> None:
    world = World(monkeypatch, friction=0.5)
    world.history = history
    assert world.gated("friction", accuracy=0.6).best.effects == (("friction",) if kept else ())
    np.testing.assert_array_equal(world.asked, world.of().fit.z - world.of("friction").fit.z)  # of what the effect changed


@pytest.mark.parametrize(
    ("plainly", "history", "kept"), [(0.14, 0.14, True), (0.12, 0.14, False), (0.14, 0.12, False), (-1.0, 1.0, False)]
)
def test_an_error_that_inputs_may_make_in_a_row_counts_where_outputs_show_it_in_all(
    monkeypatch: pytest.MonkeyPatch, plainly: float, history: float, kept: bool
) -> None:
    """A delay beside noisy inputs: small in white residuals, and all that is wrong with the outputs."""
    world = World(monkeypatch, delay=0.1)
    world.plainly, world.plain_history, world.rest = {"delay": plainly}, history, {("delay",): (0.0, 0.0), (): (0.1, 0.1)}
    assert world.gated("delay").best.effects == (("delay",) if kept else ())
    world.plainly, world.plain_history = {"delay": 0.5}, 0.5
    assert world.gated("delay", accuracy=0.6).best.effects == ()  # the description may be as far off


@pytest.mark.parametrize(("sensed", "kept"), [({"large"}, True), (set(), False), ({"large", "small"}, False)])
def test_a_large_effect_on_the_sensors_alone_is_no_excuse_for_a_small_one_in_the_markers(
    monkeypatch: pytest.MonkeyPatch, sensed: set[str], kept: bool
) -> None:
    """The large one leaves all of a smooth error either way."""
    world = World(monkeypatch, large=4.0, small=0.5)
    world.sensed, world.rest = sensed, {("large", "small"): (1.0, 1.0), ("large",): (1.0, 1.0)}
    assert world.gated("large", "small").best.effects == (("large", "small") if kept else ("large",))


@pytest.mark.parametrize(("left", "unseen", "kept"), [(0.1, 0.2, True), (0.1, 0.6, False), (0.9, 0.2, False)])
def test_beside_a_much_larger_one_it_must_take_half_of_what_is_left_on_trials_left_out_too(
    monkeypatch: pytest.MonkeyPatch, left: float, unseen: float, kept: bool
) -> None:
    world = World(monkeypatch, large=4.0, small=0.5)
    assert world.gated("large", "small").small == (), "nothing smooth is left, with it or without: no fault of a law"
    world.rest = {("large", "small"): (left, unseen), ("large",): (1.0, 1.0)}
    found = world.gated("large", "small")
    assert found.best.effects == (("large", "small") if kept else ("large",))
    assert [s.effect for s in found.small] == ([] if kept else ["small"])


def test_what_the_design_cannot_tell_from_a_rival_that_does_as_well_is_in_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rival takes all but 20 of |z|^2 that the effect takes: less than five standard errors, squared."""
    world = World(monkeypatch, friction=0.5, rival=0.0)
    found = world.gated("friction", table=(row("friction", apart=0.6),))
    assert found.best.effects == ("friction",), "the rival explains nothing"
    world.of = _as_good(world, "friction", 20.0)  # type: ignore[method-assign]
    found = world.gated("friction", table=(row("friction", apart=0.6),))
    assert found.best.effects == ()
    assert [(d.effect, d.rival, d.found.effects, d.other.effects) for d in found.doubts] == [
        ("friction", "rival", ("friction",), ("rival",))
    ]
    assert world.gated("friction", table=(row("friction", apart=0.4),)).best.effects == ("friction",), "the design tells them"
    world.of = _as_good(world, "friction", 30.0)  # type: ignore[method-assign]
    assert world.gated("friction", table=(row("friction", apart=0.6),)).best.effects == ("friction",), "the data tell them"


def test_of_motion_the_rival_is_fitted_whatever_the_design_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rival that ended 300 behind and takes all but 20 of |z|^2 at its minimum; one 500 behind is not fitted further.
    It is fitted from the robot as described, where the rest without the effect was bent."""
    world, starts = World(monkeypatch, friction=0.5, rival=0.0), []

    def added(study: Any, rest: Any, rival: str, start: Any) -> Any:
        starts.append(hasattr(rest, "is_description"))
        return world.of(*rest.effects, rival)

    monkeypatch.setattr(stage, "described", lambda study, rest: SimpleNamespace(effects=rest.effects, is_description=True))
    monkeypatch.setattr(stage, "with_effect_added", added)
    world.context.objective.bends, table = True, (row("friction", apart=0.4),)
    monkeypatch.setattr(stage, "converged", lambda study, w: SimpleNamespace(**vars(w) | {"score": w.score + 280.0}))
    world.of = _as_good(world, "friction", 300.0)  # type: ignore[method-assign]
    found = world.gated("friction", table=table)
    assert [(d.effect, d.other.effects) for d in found.doubts] == [("friction", ("rival",))]
    world.of = _as_good(world, "friction", 500.0)  # type: ignore[method-assign]
    assert world.gated("friction", table=table).best.effects == ("friction",)
    world.of = _as_good(world, "friction", 20.0)  # type: ignore[method-assign]
    world.context.budget = Budget(-1.0)
    assert world.gated("friction", table=table).best.effects == ("friction",)
    assert world.context.budget.untried == ["rival"]
    assert starts == [True, True]


@pytest.mark.parametrize(
    ("drives", "kept"), [((Drive.TENSION,), ("time_delay",)), ((Drive.CURRENT,), ()), ((Drive.TENSION, Drive.DISPLACEMENT), ())]
)
def test_a_delay_weighed_against_a_lag_stays_and_one_that_was_not_is_in_doubt(
    monkeypatch: pytest.MonkeyPatch, drives: tuple[Drive, ...], kept: tuple[str, ...]
) -> None:
    """What the tendons were given tells the two where all are driven alike, not by currents."""
    world = World(monkeypatch, time_delay=0.5)
    world.context.prepared = SimpleNamespace(drives=drives)
    world.of = _as_good(world, "time_delay", 20.0, rival="actuator_lag")  # type: ignore[method-assign]
    found = world.gated("time_delay", table=(row("time_delay", apart=0.6, rival="actuator_lag"),))
    assert found.best.effects == kept
    assert len(found.doubts) == (0 if kept else 1)


def _as_good(world: World, effect: str, short: float, rival: str = "rival") -> Any:
    """World.of in which the rival imitates the effect but for `short` of |z|^2."""

    def of(*effects: str) -> Any:
        stands = tuple(effect if e == rival else e for e in effects)
        made = World.of(world, *stands)
        made.effects = tuple(sorted(effects))
        made.fit.effects = made.effects
        made.score -= short if rival in effects else 0.0
        return made

    return of
