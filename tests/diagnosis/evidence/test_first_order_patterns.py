"""First-order patterns by hand: a catalogue of four laws, models that are what was switched on, columns that are numbers."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from twin.diagnosis.evidence import first_order as stage
from twin.diagnosis.evidence.first_order import Dictionary, Pattern, dictionary
from twin.effects import FitStart
from twin.foundation.errors import TwinError

N = 4


def law(starts: list[FitStart], akin: tuple[str, ...] = (), needs: frozenset[str] = frozenset()) -> Any:
    """Amplitudes a (OFF 0) and b (OFF 1), a time t that means nothing while they are OFF."""

    def from_(predicted: list[Any], n_tendon: int) -> Iterator[FitStart]:
        assert (predicted, n_tendon) == ([((), "true")], 3)
        yield from starts

    declared = [SimpleNamespace(name=n, value=v) for n, v in (("a", 0.0), ("b", 1.0), ("t", 5.0))]
    return SimpleNamespace(
        fit_starts=from_, confusable_with=akin, needs=needs, inactive_when_off=("t",), all_parameters=lambda n_tendon: declared
    )


BOTH = FitStart({"a": 0.5, "b": 3.0, "t": 8.0}, ("a", "b", "t"))
ONE = FitStart({"a": 0.5, "t": 8.0}, ("a", "t"))


class World:
    """A fitted model of some effects. A model's column is its size, in every sample; those of a twin in `lost` cannot be solved."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, laws: dict[str, Any], present: tuple[str, ...] = ()) -> None:
        self.asked: list[list[Any]] = []
        self.lost: set[str] = set()
        monkeypatch.setattr(stage, "catalogue", lambda: laws)
        monkeypatch.setattr(
            stage, "scaled_starts", lambda law, predicted, n, size: law.fit_starts(predicted, n) if size == "its size" else ()
        )
        monkeypatch.setattr(stage, "scaled_parameters", lambda law, n, size: law.all_parameters(n) if size == "its size" else ())
        chain = SimpleNamespace(sense=lambda true: ((), true))
        twin = SimpleNamespace(effects=[SimpleNamespace(id=e) for e in present], effect_chain=chain)
        model = SimpleNamespace(twin=twin, with_effect=self.with_effect)
        trace = SimpleNamespace(true="true")
        self.fit: Any = SimpleNamespace(model=model, evaluation=SimpleNamespace(traces={0: trace}), z=np.zeros(N))
        body = SimpleNamespace(features=frozenset({"tendons"}))
        bench = SimpleNamespace(n_tendon=3, robot=SimpleNamespace(build=lambda: body, size="its size"))
        self.objective: Any = SimpleNamespace(prepared=bench, columns=self.columns)

    def with_effect(self, identifier: str, values: dict[str, float], free: tuple[str, ...], n_tendon: int) -> Any:
        if values.get("a") == -1.0:
            raise TwinError("below its range")
        assert (free, n_tendon) == ((), 3)
        return SimpleNamespace(twin=(identifier, tuple(sorted(values.items()))))

    def columns(self, at: Any, models: list[tuple[Any, float]], unsolved: str) -> np.ndarray:
        assert at is self.fit.evaluation
        assert unsolved == "zeros", "one that is lost must not take the others with it"
        self.asked.append(models)
        return np.ones((N, 1)) * [0.0 if m.twin[0] in self.lost else size for m, size in models]

    def found(self) -> Dictionary:
        return dictionary(self.objective, self.fit)


def test_each_amplitude_is_switched_on_alone_by_how_far_its_start_is_from_off(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch, {"creep": law([BOTH]), "drift": law([FitStart({"a": 2.0}, ("a", "b"))])})
    found = world.found()
    assert [(p.effect, p.start, p.amplitudes, p.where) for p in found.patterns] == [
        ("creep", BOTH, ("a", "b"), (0, 1)),
        ("drift", FitStart({"a": 2.0}, ("a", "b")), ("a", "b"), (2, 3)),
    ]
    np.testing.assert_array_equal(found.columns, np.tile([0.5, 2.0, 2.0, 0.0], (N, 1)))
    assert [m.twin for m, _ in world.asked[0]] == [
        ("creep", (("a", 0.5), ("t", 8.0))),
        ("creep", (("b", 3.0), ("t", 8.0))),
        ("drift", (("a", 2.0),)),
        ("drift", (("b", 1.0),)),
    ]


def test_starts_that_share_an_amplitude_share_its_column(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch, {"creep": law([ONE, BOTH])})
    found = world.found()
    assert [p.where for p in found.patterns] == [(0,), (0, 1)]
    assert found.columns.shape == (N, 2)


def test_what_is_there_what_is_like_it_and_what_the_body_has_no_part_for_has_no_pattern(monkeypatch: pytest.MonkeyPatch) -> None:
    laws = {
        "friction": law([ONE]),
        "stretch": law([ONE], akin=("friction",)),
        "routing": law([ONE], akin=("gain",), needs=frozenset({"tendons"})),
        "bedding": law([ONE], needs=frozenset({"antagonists"})),
        "mirror": law([FitStart({"a": -1.0}, ("a",)), ONE]),
        "saturation": law(
            [FitStart({"a": 0.7}, ("a",), frozenset({"ropes"})), FitStart({"a": 0.6}, ("a",), frozenset({"tendons"}))]
        ),
    }
    assert [p.effect for p in World(monkeypatch, laws, ("friction",)).found().patterns] == ["routing", "mirror", "saturation"]
    found = World(monkeypatch, laws).found().patterns
    assert [p.effect for p in found] == ["friction", "stretch", "routing", "mirror", "saturation"]
    assert found[-2].start is ONE, "a start outside the law's range is passed over"
    assert dict(found[-1].start.values) == {"a": 0.6}, "so is one of parameters that act on what the body has not"


def test_a_pattern_without_equilibrium_is_zero_and_takes_no_other_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch, {"creep": law([ONE]), "contact": law([BOTH]), "drift": law([ONE])})
    world.lost = {"contact"}
    found = world.found()
    np.testing.assert_array_equal(found.columns, np.tile([0.5, 0.0, 0.0, 0.5], (N, 1)))
    assert [p.where for p in found.patterns] == [(0,), (1, 2), (3,)]


def test_beside_an_effect_are_neither_itself_nor_those_like_it(monkeypatch: pytest.MonkeyPatch) -> None:
    World(monkeypatch, {"friction": law([]), "stretch": law([], akin=("friction",)), "creep": law([])})
    columns = np.zeros((N, 3))
    every = Dictionary(tuple(Pattern(e, ONE, ("a",), (i,)) for i, e in enumerate(("friction", "stretch", "creep"))), columns)
    assert [p.effect for p in every.beside({"friction"}).patterns] == ["creep"]
    assert [p.effect for p in every.beside(("creep",)).patterns] == ["friction", "stretch"]
    assert every.beside(()).patterns == every.patterns
    assert every.beside({"friction"}).columns is columns
