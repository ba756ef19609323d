"""What `test_conformance.py` leaves open of every effect: all its bounds, all its corners, its energy to the solver's digits,
that hooks keep their hands off what they are given, and that a law in the way of a reading can be undone.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tests.effects.test_conformance import cycle as one_cycle
from tests.effects.test_conformance import predict, recording
from twin.body import Loads, Route, Signals
from twin.effects import Effect, catalogue
from twin.foundation.errors import SolveError, TwinError
from twin.foundation.parameters import SIZE_EXPONENTS
from twin.measurements import Trial
from twin.prediction.prepared import prepare
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.robots import load

# Laws that need more than a backbone has are tried on their own robot in test_conformance.py and test_finger_day.py.
LAWS = {name: law for name, law in catalogue().items() if law.needs <= load("continuum").build().features}
laws = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
N = 64  # samples a cycle
REVERSIBLE = 1e-7  # J, of some 7 mJ that go in and out: displacements within 1e-7 rad x 8 mm x 48, times 3 N


def two_cycles(seconds: float = 20.0) -> Trial:
    """Smooth, periodic tensions, twice round: what is lost the second time is lost every time."""
    angle = 2 * np.pi * np.arange(2 * N) / N
    tension = np.stack([1.5 - 1.3 * np.cos(angle), 1.0 + 0.9 * np.sin(angle), 0.3 + 0.2 * np.cos(2 * angle)], axis=1)
    like = one_cycle("a.csv", 0.0, 1.0, 0.0)
    values = {name: np.zeros(2 * N) for name in like.values} | {f"tendon_{i + 1}_tension": tension[:, i] for i in range(3)}
    return replace(like, time=np.arange(2 * N) * seconds / N, values=values, conditions={"tip_payload": 0.01})


def loss(*effects: Effect) -> float:
    """Work (J) the motors do on the robot in the second cycle: sum T . dD/dangle, by Fourier series, exact for smooth loops."""
    twin = Twin(load("continuum"), {}, effects)
    true = simulate(twin, prepare(recording(two_cycles()), twin.robot))[0].true
    T, D = true.tension[N:], true.displacement[N:]
    rate = np.fft.ifft(1j * np.fft.fftfreq(N, 1 / N)[:, None] * np.fft.fft(D, axis=0), axis=0).real
    return float((T * rate).sum() * 2 * np.pi / N)


def on(law: type[Effect]) -> Effect:
    """The law at a moderate strength, the same for all: its fits' own start, or a fifth of the way to its bounds."""
    predicted = [t.true for t in simulate(Twin(load("continuum")), prepare(recording(two_cycles()), load("continuum")))]
    start = next(iter(law.fit_starts(predicted, 3)), None)
    if start is None:
        pytest.skip("it acts on springs, which do not drive here")
    return law(start.values, 3)


def test_the_plain_robot_gives_back_what_it_takes() -> None:
    assert loss() == pytest.approx(0.0, abs=REVERSIBLE)


@laws
def test_what_changes_body_or_loads_loses_nothing_and_what_rubs_or_creeps_does(law: type[Effect]) -> None:
    effect = on(law)
    if effect.acts_in("command", "drive", "sense"):
        pytest.skip("it changes what is read or commanded, not the robot")
    lost = loss(effect)
    if effect.route().mu > 0.0 or effect.deform().amplitude:
        assert lost > 1e-4  # J: mu 0.1 of 20 mJ over several turns; 6 % of late strain
    elif np.ptp(effect.soften(np.full(2, 296.15), np.array([0.0, 40.0]))):
        # J: a body that loses 1e-5 of its stiffness a second keeps some 20 s of that of its 20 mJ
        assert 1e-7 < lost < 4e-6
    elif effect.acts_in("surround") and effect.surround(Loads(np.array([0, 0, 9.81]))).wall[4]:
        # J: elastic too, but touching the wall is a kink, whose Fourier series falls as 1 / N^2 only
        assert lost == pytest.approx(0.0, abs=1e-4)
    else:
        assert lost == pytest.approx(0.0, abs=REVERSIBLE)


def test_more_friction_and_more_creep_lose_more() -> None:
    friction, creep = catalogue()["tendon_friction"], catalogue()["backbone_creep"]
    assert 0 < loss(friction(mu=0.02)) < loss(friction(mu=0.05)) < loss(friction(mu=0.1))
    assert 0 < loss(creep(amplitude=0.02, time=5.0)) < loss(creep(amplitude=0.1, time=5.0))
    # Far slower or far faster than the cycle it is elastic again (a loss peak at omega tau = 1, here tau = 3.2 s).
    peak = loss(creep(amplitude=0.1, time=3.2))
    assert loss(creep(amplitude=0.1, time=300.0)) < 0.1 * peak
    assert loss(creep(amplitude=0.1, time=0.3)) < 0.3 * peak


@laws
def test_every_bound_is_kept_and_named(law: type[Effect]) -> None:
    """Of what grows with a robot the sign is kept, of what does not both ends."""
    for p in law.all_parameters(3):
        assert law({p.name: p.low}, 3)[p.name] == p.low
        assert law({p.name: p.high}, 3)[p.name] == p.high
        width = p.high - p.low
        outside, allowed = [p.low - 0.01 * width - 1e-6, p.high + 0.01 * width + 1e-6], f"[{p.low:g}, {p.high:g}]"
        if p.unit in SIZE_EXPONENTS:
            assert law({p.name: 1e3 * p.high}, 3)[p.name] == 1e3 * p.high
            outside = [-1e-9] if p.low >= 0.0 else []
            allowed = "0 or more" if p.low == 0.0 else "more than 0" if p.low > 0.0 else "any finite number"
        for value in (*outside, *([0.0] if p.low > 0.0 else []), np.nan, np.inf, -np.inf):
            with pytest.raises(TwinError) as raised:
                law({p.name: value}, 3)
            said = str(raised.value)
            assert law.id in said
            assert p.name in said
            assert allowed in said


@laws
def test_no_nan_anywhere_within_its_bounds(law: type[Effect]) -> None:
    """Corners of all parameters, tendons' alike, and random interiors: finite, or refused in so many words."""
    rng = np.random.default_rng(0)
    declared = law.all_parameters(3)
    corners = list(itertools.product([0, 1], repeat=len(declared)))
    chosen = [corners[k] for k in rng.permutation(len(corners))[:16]] + list(rng.uniform(size=(16, len(declared))))
    data = recording(replace(one_cycle("a.csv", 0.0, 2.0, 0.0)))
    solved = 0
    for weights in chosen:
        values = {p.name: p.low + w * (p.high - p.low) for p, w in zip(declared, weights, strict=True)}
        try:
            predicted = predict((law(values, 3),), data)
        except SolveError as error:
            assert "no static equilibrium at sample" in str(error)  # noqa: PT017
            continue
        assert all(np.isfinite(y).all() for y in predicted), values
        solved += 1
    assert solved >= 8


def some_signals(seed: int = 0, n: int = 40) -> Signals:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.2, 0.8, n))
    smooth = np.sin(0.3 * time[:, None] + np.arange(3))
    arrays = (time, 100.0 + time, 1.5 + smooth, 5e-3 * smooth, 0.05 * np.stack([smooth] * 9, axis=1), np.full(n, 296.0))
    for a in arrays:
        a.setflags(write=False)  # whoever writes to what it is given raises here
    return Signals(*arrays)


@laws
def test_hooks_are_functions(law: type[Effect]) -> None:
    """They leave what they are given as it was, and answer the same question in the same way."""
    effect, seen = on(law), some_signals()
    for hook in (effect.command, effect.drive, effect.sense):
        one, two = hook(seen), hook(seen)
        for name in ("time", "clock", "tension", "displacement", "markers", "temperature"):
            np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
            assert getattr(one, name).shape == getattr(seen, name).shape
    gravity = np.array([0.0, 0.0, 9.81])
    gravity.setflags(write=False)
    one, two = effect.surround(Loads(gravity, 0.01)), effect.surround(Loads(gravity, 0.01))
    np.testing.assert_array_equal(one.gravity, two.gravity)
    assert one.payload == two.payload
    assert effect.route() == effect.route()
    assert effect.deform() == effect.deform()
    warm = np.linspace(290.0, 310.0, 5)
    np.testing.assert_array_equal(effect.soften(warm, warm), effect.soften(warm, warm))


@laws
def test_it_is_a_value(law: type[Effect]) -> None:
    effect = on(law)
    same = law(dict(effect.values), 3)
    assert same == effect
    assert hash(same) == hash(effect)
    p = law.all_parameters(3)[0]
    other = law({**effect.values, p.name: p.low if effect[p.name] != p.low else p.high}, 3)
    assert other != effect
    assert effect != Route()
    assert law.id in repr(effect)


@laws
def test_off_places_change_nothing(law: type[Effect]) -> None:
    """At its OFF values a law is the identity in every place it acts in."""
    off, seen = law(n_tendon=3), some_signals()
    for hook in (off.command, off.drive, off.sense):
        for name in ("tension", "displacement", "markers"):
            # relative to values of order one: a rounding of a product with one or a sum with zero
            np.testing.assert_allclose(getattr(hook(seen), name), getattr(seen, name), rtol=0, atol=1e-15)
    loads = off.surround(Loads(np.array([1.0, 2.0, 9.0]), 0.01))
    np.testing.assert_allclose(loads.gravity, [1.0, 2.0, 9.0], rtol=0, atol=1e-15)
    assert loads.payload == 0.01
    assert loads.wall[4] == 0.0
    assert off.route().mu == 0.0
    assert off.route().stretch == 0.0
    assert np.all(off.soften(np.array([250.0, 350.0]), np.array([0.0, 1e4])) == 1.0)
    assert off.deform().amplitude == ()


@laws
def test_what_a_cell_misreads_is_undone_where_it_drives(law: type[Effect]) -> None:
    """`command` is the inverse of `sense` for tensions: a law that has both agrees with itself."""
    effect, seen = on(law), some_signals()
    if not (effect.acts_in("command") and effect.acts_in("sense")):
        pytest.skip("it has one side only")
    if np.array_equal(effect.sense(seen).tension, seen.tension):
        pytest.skip("it does not touch what tensions read")
    np.testing.assert_allclose(effect.command(effect.sense(seen)).tension, seen.tension, rtol=0, atol=1e-14)  # N: rounding
    np.testing.assert_allclose(effect.sense(effect.command(seen)).tension, seen.tension, rtol=0, atol=1e-14)


@pytest.mark.parametrize("pair", list(itertools.combinations(sorted(LAWS), 2))[::6], ids="+".join)
def test_two_laws_live_together(pair: tuple[str, str]) -> None:
    """A twin with two laws predicts, and with the second one off is the twin with the first."""
    a, b = (catalogue()[name] for name in pair)
    data = recording(one_cycle("a.csv", 0.0, 2.0, 0.01))
    both, one, padded = predict((on(a), on(b)), data), predict((on(a),), data), predict((on(a), b(n_tendon=3)), data)
    assert np.isfinite(both[0]).all()
    np.testing.assert_allclose(padded[0], one[0], rtol=0, atol=1e-12)  # m: the same computation, but for rounding
