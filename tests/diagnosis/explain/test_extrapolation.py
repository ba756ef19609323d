"""Levels of a condition, and an effect that helps inside what was fitted and harms beyond it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from twin.diagnosis.explain import extrapolation as stage
from twin.diagnosis.explain.extrapolation import extrapolation, levels

TIME = np.arange(20.0)


def trial(payload: float = 0.0, torque: float = 0.0, seconds: float = 1.0) -> Any:
    loads = SimpleNamespace(payload=payload, torque=np.full(20, torque), gravity=np.array([0.0, 0.0, 9.81]))
    return SimpleNamespace(loads=loads, time=seconds * TIME, command=np.sin(0.5 * TIME)[:, None])


def beside_a_still_one(made: Any) -> Any:
    """Of two tendons, one of which stays where it is."""
    made.command = np.column_stack([made.command, np.ones(len(made.time))])
    return made


def bench(*trials: Any) -> Any:
    return SimpleNamespace(inputs=trials, outputs=[SimpleNamespace(group="angle")])


def test_trials_share_a_level_where_their_condition_is_alike() -> None:
    loaded = bench(*(trial(torque=t) for t in (0.0101, 0.05, 0.0104, 0.09)))
    assert levels(loaded, range(4)) == {"load torque": [[0, 2], [1], [3]]}
    assert levels(loaded, range(3)) == {}, "two levels: one left out leaves no trend"
    paced = bench(trial(), trial(seconds=0.1), trial(seconds=1.1), trial(seconds=20.0))
    assert levels(paced, range(4)) == {"rate of pull": [[3], [0, 2], [1]]}
    one = [beside_a_still_one(trial(seconds=s)) for s in (1.0, 0.1, 1.1, 20.0)]
    assert levels(bench(*one), range(4)) == {"rate of pull": [[3], [0, 2], [1]]}, "of the tendon that moves"
    mounted = [trial() for _ in range(4)]
    for each, up in zip(mounted, ([0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 1e-5, 1]), strict=True):
        each.loads.gravity = 9.81 * np.array(up)
    assert levels(bench(*mounted), range(4)) == {"mount": [[0, 3], [1], [2]]}
    assert levels(bench(trial(), trial(), trial()), range(3)) == {}, "one condition only"
    assert levels(bench(trial(), trial(0.01), trial(0.02)), range(3)) == {}, "a level of one trial is that trial left out"


def weighed(J: np.ndarray, y: np.ndarray, effects: tuple[str, ...]) -> Any:
    x = np.linalg.lstsq(J, y, rcond=None)[0]
    free = [SimpleNamespace(parameter=SimpleNamespace(std=None, step=1.0, value=0.0)) for _ in x]
    model = SimpleNamespace(free=free, vector=lambda: x)
    fit = SimpleNamespace(J=-J, z=y - J @ x, model=model, trust=1.0, at_bound=lambda: np.zeros(len(x), bool))
    return SimpleNamespace(fit=fit, effects=effects)


@pytest.mark.parametrize(
    ("inside", "far", "harms"), [(1.1, 1.011, True), (1.1, 1.009, False), (0.9, 1.1, False), (1.0, 1.1, False)]
)
def test_an_effect_harms_that_helps_inside_and_enlarges_the_error_beyond(
    inside: float, far: float, harms: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Squared errors without it 4 `inside` and 9 / `far`, with it 4 and 9: by more than half a percent (1.01 in squares) beyond."""
    squares = {("with", None): 4.0, ("with", "groups"): 9.0, ("less", None): 4.0 * inside, ("less", "groups"): 9.0 / far}
    monkeypatch.setattr(stage, "left_out", lambda study, fit, groups=None: SimpleNamespace(square=squares[fit, groups]))
    monkeypatch.setattr(stage, "levels", lambda bench, trials: {"payload": "groups"})
    study: Any = SimpleNamespace(prepared=None, trials=[])
    final: Any = SimpleNamespace(fit="with", effects=("creep",))
    gated: Any = SimpleNamespace(without={e: SimpleNamespace(fit="less") for e in ("creep", "gone")})  # the second was not kept
    (found,) = extrapolation(study, final, gated, False)
    assert (found.inside, found.beyond, found.levels) == (2.0, 3.0, 6)
    assert found.harmful == (("creep",) if harms else ())


@pytest.mark.parametrize(("asked", "trials", "told"), [(True, 4, True), (False, 4, False), (True, 3, False)])
def test_where_it_is_asked_for_the_session_is_left_out_by_halves(
    asked: bool, trials: int, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    squares = {"with": (1.0, 9.0), "less": (4.0, 4.0)}  # on trials, and on halves
    monkeypatch.setattr(stage, "left_out", lambda study, fit, groups=None: SimpleNamespace(square=squares[fit][0]))
    monkeypatch.setattr(stage, "halves", lambda study, weighed: SimpleNamespace(square=squares[weighed.fit][1]))
    monkeypatch.setattr(stage, "levels", lambda bench, trials: {})
    study: Any = SimpleNamespace(prepared=None, trials=range(trials))
    final: Any = SimpleNamespace(fit="with", effects=("creep",))
    found = extrapolation(study, final, cast(Any, SimpleNamespace(without={"creep": SimpleNamespace(fit="less")})), asked)
    assert [(b.condition, b.levels, b.inside, b.beyond, b.harmful) for b in found] == (
        [("half of the session", 2, 1.0, 3.0, ("creep",))] if told else []
    )


def test_an_effect_that_takes_what_grows_with_the_payload_for_a_square_is_told_to_harm_beyond() -> None:
    """Measured: a load's bend that saturates. A parabola fits three payloads better than a line does, and misses one left out by
    more; a law that is right helps on both."""
    load = np.repeat([0.0, 1.0, 2.0, 3.0], 40)
    rng = np.random.default_rng(0)
    y = np.tanh(2.0 * load) + 0.05 * rng.normal(size=160)
    day = bench(*(trial(payload) for payload in np.repeat([0.0, 0.01, 0.02, 0.03], 2)))
    study: Any = SimpleNamespace(
        prepared=day, trials=range(8), objective=SimpleNamespace(n=160), evidence=SimpleNamespace(present=np.ones((160, 1), bool))
    )
    line = np.column_stack([np.ones(160), load])
    for name, column, harms in (("cube", load**3 - 4 * load**2, True), ("right", np.tanh(2.0 * load), False)):
        final, without = weighed(np.column_stack([line, column]), y, (name,)), weighed(line, y, ())
        (found,) = extrapolation(study, final, cast(Any, SimpleNamespace(without={name: without})), False)
        assert (found.condition, found.levels, found.harmful) == ("payload", 4, (name,) if harms else ())
        assert found.beyond >= found.inside
        assert ("harms beyond" in found.words()) is harms
