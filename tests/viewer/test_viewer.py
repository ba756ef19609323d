"""The viewer: what it draws is what the twin predicts. A real browser looks at it in test_viewer_browser.py."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import viser
from PIL import Image

from tests.viewer_page import rubbing, sample
from twin.body import Drive, Loads, Problem, Push, Route
from twin.body.drawable import ColourScale
from twin.cli.use.view import View
from twin.foundation.errors import DataError
from twin.prediction.evaluate import evaluate
from twin.prediction.kinematics import warmest_current
from twin.prediction.rollout import full_pull
from twin.prediction.simulate import simulate
from twin.prediction.twin import Twin
from twin.viewer import TwinPanel
from twin.viewer import app as app_module
from twin.viewer import panel as panel_module
from twin.viewer import replay as replay_module
from twin.viewer.drawing import headless
from twin.viewer.drawing.colours import colour_bar, colour_values
from twin.viewer.drawing.film import Film
from twin.viewer.drawing.tip_loop import TipLoop, draw_svg
from twin.viewer.live import LiveHeatedRobot, LiveRobot
from twin.viewer.replay import MOST_PREDICTIONS, Replay

G = np.array([0.0, 0.0, 9.81])


# ---- what is drawn ----------------------------------------------------------------------------------------------------------


def test_the_finger_skin_moves_with_the_silicone() -> None:
    twin = Twin.of("finger")
    drawn = twin.figure()
    shown = LiveRobot(twin).shape(np.array([1.5, 0.0, 0.0, 0.0]), Loads(G))
    tip = shown.markers[0, -1]
    assert np.allclose(shown.skin[0, -1], tip, atol=1e-9)  # the last point of the skin is the tip
    assert tip[0] > 0.01  # m, towards tendon 1
    inside, outside = shown.strain[0].reshape(-1)[:-1].reshape(-1, 32)[14, [0, 16]]
    assert inside < -0.02 < 0.02 < outside  # pressed on the side that is pulled, stretched on the other
    assert drawn.faces.max() == shown.skin.shape[1] - 1


def test_tension_along_the_tendons_falls_by_friction_and_not_without() -> None:
    tension = np.array([1.5, 0.0, 0.0])
    for twin, falls in ((rubbing(), True), (Twin.of("continuum"), False)):
        along = LiveRobot(twin).shape(tension, Loads(G)).tension[0].reshape(3, -1)[0]
        assert along[0] == pytest.approx(1.5)
        if falls:  # Euler: 1.5 exp(-mu theta) at most; the turn at the holes adds up to less than the bend of a radian
            assert np.all(np.diff(along) < 0.0)
            assert 1.5 * np.exp(-0.21 * 1.2) < along[-1] < 1.5 * np.exp(-0.21 * 0.5)
        else:
            assert np.allclose(along, 1.5, atol=1e-12)


def test_a_replay_is_what_evaluate_measures() -> None:
    one = replace(sample(), trials=sample().trials[:1])
    replay, twin = Replay(one, rubbing()), rubbing()
    track = replay.predict(twin, 0)
    assert 1e3 * track.rms == pytest.approx(evaluate(twin, one)["rmse"], rel=1e-6)
    assert np.allclose(track.frames.markers[:, :8], track.markers)  # no effect stands between the two here
    slack = track.frames.frame_at(3).tension[0]
    between = track.frames.frame_at(3, 0.5).tension[0]
    assert np.allclose(between, 0.5 * (slack + track.frames.frame_at(4).tension[0]))


def test_the_standing_robot_and_the_replayed_one_are_one_figure() -> None:
    twin = Twin.of("continuum")
    tension = np.array([1.0, 0.4, 0.0])
    drawn = twin.figure()
    path = twin.robot.solver(twin.body()).solve(Problem(np.zeros(1), tension[None], Loads(G)))
    replayed, standing = drawn.frames(path, Loads(G), Route()), LiveRobot(twin).shape(tension, Loads(G))
    for name in ("link_positions", "tendon_pieces", "markers"):
        assert np.allclose(getattr(replayed, name), getattr(standing, name), atol=1e-6)  # m: two solves' tolerance


def test_the_bar_says_what_the_colours_are() -> None:
    over = ColourScale("tension", "N", 1.0, 0.0, 2.0)
    assert colour_values(np.array([0.0, 2.0, 9.0]), over).tolist() == [[68, 1, 84], [253, 231, 37], [253, 231, 37]]
    for word in ("tension, N", ">0<", ">1<", ">2<"):
        assert word in colour_bar(over)


def test_what_is_not_drawn_is_said() -> None:
    with pytest.raises(DataError, match="not drawn here yet"):
        Twin.of("two_link").figure()


def test_a_robot_under_sliders_remembers_where_its_tendons_turned_and_no_more() -> None:
    """Pre-sliding friction wipes out a loop inside a larger pull, so that small steps up, or a dip on the way, end where one pull
    ends; letting go half-way does not."""
    live = LiveRobot(rubbing())

    def tip(*pulls: float) -> np.ndarray:
        for pull in (0.0, *pulls):
            shown = live.shape(np.array([pull, 0.0, 0.0]), Loads(G))
        return shown.markers[0, -1]

    def fresh(*pulls: float) -> np.ndarray:
        nonlocal live
        live = LiveRobot(rubbing())
        return tip(*pulls)

    at_once = fresh(1.0)
    assert np.allclose(fresh(0.2, 0.4, 0.6, 0.8, 1.0), at_once, atol=1e-6)  # m: the solves' tolerance
    assert np.allclose(fresh(0.7, 0.4, 1.0), at_once, atol=1e-6)
    assert np.linalg.norm(fresh(1.5, 1.0) - at_once) > 1e-3  # the loop of mu = 0.21 is millimetres wide
    live.shape(np.array([1.0, 0.0, 0.0]), Loads(G, 0.01))  # other loads: it starts anew from slack
    loaded = live.shape(np.array([1.0, 0.0, 0.0]), Loads(G, 0.01)).markers[0, -1]
    fresh_loaded = LiveRobot(rubbing()).shape(np.array([1.0, 0.0, 0.0]), Loads(G, 0.01)).markers[0, -1]
    assert np.allclose(loaded, fresh_loaded, atol=1e-6)


def test_motors_that_take_up_length_pull_as_the_tension_they_cause() -> None:
    twin = Twin.of("continuum")
    held = LiveRobot(twin, Drive.DISPLACEMENT).shape(np.array([2e-3, -2e-3, -2e-3]), Loads(G))
    tension = held.tension[0].reshape(3, -1)[:, 0]
    assert tension[0] > 0.2  # N
    assert held.markers[0, -1, 0] > 5e-3  # m, towards tendon 1
    pulled = LiveRobot(twin).shape(tension, Loads(G))
    assert np.allclose(pulled.markers, held.markers, atol=2e-5)  # m: a motor's length is solved to 1e-6, a tip follows ten-fold


def test_a_hands_fingers_stand_around_its_palm() -> None:
    """Equal pulls under gravity along the axis: a third of a turn takes one finger to the next."""
    twin = Twin.of("hand")
    drawn = twin.figure()
    pull = np.array([1.0 if i % 4 == 0 else 0.0 for i in range(twin.robot.n_tendon)])
    shown = LiveRobot(twin).shape(pull, Loads(np.array([0.0, 0.0, -9.81])))
    first, second, third = np.split(shown.skin[0], 3)
    c, s = -0.5, np.sqrt(0.75)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert np.allclose(first @ turn.T, second, atol=1e-7)
    assert np.allclose(second @ turn.T, third, atol=1e-7)
    base = first[:32].mean(axis=0)  # its first ring, on the palm's rim
    assert np.hypot(*base[:2]) == pytest.approx(drawn.cylinders[0, 0], abs=1e-4)
    assert len(drawn.faces) % 3 == 0
    assert drawn.faces.max() == len(shown.skin[0]) - 1
    assert shown.strain.shape[1] == len(shown.skin[0])


def test_a_running_replay_draws_at_every_turn_of_the_loop_and_solves_nothing_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rate itself is for `tools/benchmarks/viewer/speed.py`: here the clock is the test's own."""
    solved, now = [], [100.0]
    monkeypatch.setattr(replay_module, "simulate", lambda *a, **b: solved.append(1) or simulate(*a, **b))
    for module in (app_module, panel_module):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    server = viser.ViserServer(host="127.0.0.1", port=8670, verbose=False)
    try:
        app = TwinPanel(server, [("", rubbing())], sample())
        app.tick()
        app.scrubber.play.value, app.scrubber.speed.value = True, 2.0
        for _ in range(90):
            now[0] += 1.0 / 60.0
            app.tick()
        assert app.pictures_drawn == 91
        assert app.scrubber.time.value == pytest.approx(3.0)  # 1.5 s at twice the speed
        assert len(solved) == 2  # the trial as described and with its effect, once each
    finally:
        server.stop()


# ---- springs, cords, pushes, films ---------------------------------------------------------------------------------------------


def test_springs_under_sliders_heat_as_a_trial_of_the_same_currents_does() -> None:
    """30 s of heating, 10 s of cooling, in steps of a tick as they come."""
    twin, hot, cold = rubbing(), np.array([1.25, 0.0, 0.4]), np.zeros(3)
    live = LiveHeatedRobot(twin)
    for _ in range(90):
        live.shape(hot, Loads(G), 1.0 / 3.0)
    for _ in range(60):
        shown = live.shape(cold, Loads(G), 1.0 / 6.0)
    assert live.time == pytest.approx(40.0)
    time = np.arange(0.0, 40.05, 0.1)
    command = np.where(time[:, None] < 29.95, hot, cold)
    drives, ambient = (Drive.CURRENT,) * 3, np.full(len(time), 296.15)
    problem = Problem(time, command, Loads(G), twin.effect_chain.route, drives, heating=twin.heating(ambient))
    path = twin.robot.solver(twin.body()).solve(problem)
    assert path.others["temperature"].max() > 370.0  # K: past the phase change, so that there is a history to keep
    assert np.allclose(live.temperature, path.others["temperature"][-1], atol=0.05)  # K; and m: two solves' tolerance
    assert np.allclose(shown.markers[0], path.markers[-1], atol=2e-5)
    replayed = twin.figure().frames(path, Loads(G), twin.effect_chain.route, problem.heating).frame_at(-1)
    for name in ("spring_pieces", "tendon_pieces", "tension", "temperature"):
        assert np.allclose(getattr(replayed, name), getattr(shown, name), rtol=0, atol=0.06 if name == "temperature" else 2e-3)


def test_springs_are_drawn_as_long_as_they_are_and_stay_warm_under_another_load() -> None:
    live = LiveHeatedRobot(Twin.of("continuum"))
    rest = live.rest(np.zeros(3), Loads(G))

    def lengths(shown: Any) -> np.ndarray:
        return np.ptp(shown.spring_pieces[0, ..., 2].reshape(3, -1), axis=1)

    pulled = live.rest(np.array([warmest_current(Twin.of("continuum"))[0], 0.0, 0.0]), Loads(G))
    assert not live.changing
    shortened = lengths(rest) - lengths(pulled)
    # The tendon on the inside goes in by r theta, those at 120 degrees out by half of it.
    assert shortened[0] > 2e-3
    assert shortened[1:] == pytest.approx([-0.5 * shortened[0]] * 2, rel=0.03)
    warm = live.temperature.copy()
    live.shape(np.array([1.1, 0.0, 0.0]), Loads(G, payload=0.02, push=Push(np.array([0.0, 0.05, 0.0]), 0.5)), 0.0)
    assert np.array_equal(live.temperature, warm)
    assert live.changing


def test_cords_are_coloured_by_what_they_read() -> None:
    """Bent towards tendon 1 at 0 degrees, the cords at 45 and 315 degrees shorten and read less, the others more."""
    twin = Twin.of("finger")
    shown = LiveRobot(twin).shape(np.array([2.0, 0.0, 0.0, 0.0]), Loads(G))
    change = shown.resistance[0].reshape(4, -1)
    assert np.ptp(change, axis=1).max() == 0.0
    assert change[:, 0] == pytest.approx(change[[3, 2, 1, 0], 0], abs=1e-4)
    assert change[0, 0] < -0.05 < 0.0 < change[1, 0]
    # R/R0 = (1 + kappa e)^2 of cords as described, kappa 1: and e is the drawn line's own.
    line, straight = (
        LiveRobot(twin).shape(np.array(T), Loads(0 * G)).cord_pieces[0].reshape(4, -1, 2, 3) for T in ([2.0, 0, 0, 0], [0.0] * 4)
    )
    length, rest = (np.linalg.norm(c[:, :, 1] - c[:, :, 0], axis=2).sum(axis=1) for c in (line, straight))
    weightless = LiveRobot(twin).shape(np.array([2.0, 0.0, 0.0, 0.0]), Loads(0 * G)).resistance[0].reshape(4, -1)[:, 0]
    assert (length / rest) ** 2 - 1.0 == pytest.approx(weightless, abs=1e-6)


@pytest.fixture
def server() -> Any:
    server = viser.ViserServer(host="127.0.0.1", port=8680, verbose=False)
    yield server
    server.stop()


@pytest.mark.parametrize("robot", ["continuum", "hand"])
def test_a_push_taken_at_a_point_is_at_that_point(server: Any, robot: str) -> None:
    app = TwinPanel(server, [("", Twin.of(robot))])
    hand, figure = app.controls, app.shown_twins[0].figure
    app.tick()
    shown = app.shown_twins[0].frames
    assert shown is not None
    for hold in range(5, len(figure.push_points), 401):
        hand.push_at(hold)
        found, wanted = figure.push_positions(shown)[[hand.pushed_point(), hold]]
        assert np.linalg.norm(found - wanted) < 4e-3  # m: half the drawn points' distance around, and a slider's step
        # Seen from outside, that point is met first.
        outwards = -hand.force / np.linalg.norm(hand.force)
        origin = wanted / figure.height + 3.0 * outwards
        if robot == "hand":
            assert (
                figure.push_points[app.shown_twins[0].scene.point_on_ray(shown, origin, -outwards) or 0, 2]
                == figure.push_points[hold, 2]
            )
    assert app.shown_twins[0].scene.point_on_ray(shown, np.array([9.0, 9.0, 9.0]), np.array([1.0, 0.0, 0.0])) is None


def driven(app: TwinPanel, drive: str, *values: float) -> str:
    """The words of the page with the sliders of a drive at these values, the others at zero."""
    hand = app.controls
    hand.drive_choice.value = drive
    app._pending.append(app._release)
    app.tick()
    for slider, value in zip(hand.pulls, values, strict=False):
        slider.value = value
    app._redraw = True
    app.tick()
    return app.words.content


@pytest.mark.parametrize("robot", ["continuum", "finger", "three_cable"])
def test_lengths_move_in_bends_that_jam_nothing(server: Any, robot: str) -> None:
    """0.2 mm of one tendon alone pulled all of a rod's to 16.7 N. A bend of one full pull takes about one full pull's tension."""
    twin = Twin.of(robot)
    app, full = TwinPanel(server, [("", twin)]), full_pull(twin)
    for share, most in ((0.02, 0.1), (1.0, 1.3)):
        bend = 1e3 * share * full.displacement
        assert "tip at" in driven(app, "displacement", bend)
        assert app.controls.command == pytest.approx(share * full.displacement * full.towards[:, 0])
        frames = app.shown_twins[0].frames
        assert frames is not None
        assert frames.tension.max() < most * full.tension
    # Both ends at once are a bend no larger than one.
    end = app.controls.pulls[0].max
    assert "tip at" in driven(app, "displacement", end, end)
    assert np.abs(app.controls.command).max() <= 1e-3 * end * (1.0 + 1e-9)


def test_fingers_are_named(server: Any) -> None:
    app = TwinPanel(server, [("", Twin.of("hand"))])
    words = driven(app, "tension", *[0.0] * 4, 1.0)  # finger 2 tendon 1
    assert [s.label for s in app.controls.pulls[3:6]] == ["finger 1 tendon 4, N", "finger 2 tendon 1, N", "finger 2 tendon 2, N"]
    rest = driven(app, "tension")
    moved = [
        line.partition(" tip at")[0] for line, before in zip(words.splitlines(), rest.splitlines(), strict=True) if line != before
    ]
    assert moved[0] == "finger 2"
    assert moved[1].startswith("tension along")
    assert len(moved) == 2
    assert [line[:15] for line in rest.splitlines()[:3]] == [f"finger {k} tip at" for k in (1, 2, 3)]
    driven(app, "displacement", 0.0, 0.0, 0.0, 0.0, 0.0, 3.0)
    assert app.controls.pulls[5].label == "finger 3 bend y, mm"
    lengths = app.controls.command.reshape(3, 4)
    assert lengths[:2].tolist() == np.zeros((2, 4)).tolist()
    # Finger 3 stands at 240 degrees, its tendons 1 and 3 towards and from the palm's axis, 2 and 4 across.
    assert lengths[2] == pytest.approx(3e-3 * np.array([np.sqrt(0.75), 0.5, -np.sqrt(0.75), -0.5]), abs=1e-5)
    one = TwinPanel(server, [("", Twin.of("finger"))])
    assert one.controls.pulls[0].label == "tendon 1, N"
    assert driven(one, "tension").startswith("tip at x **")


def test_a_film_has_every_instant_from_first_to_last(server: Any) -> None:
    app = TwinPanel(server, [("", rubbing())], sample())
    app.tick()
    seen: list[float] = []

    def get_render(high: int, wide: int, timeout: float) -> np.ndarray:
        seen.append(app.scrubber.time.value)
        return np.full((high, wide, 3), 255 - len(seen), np.uint8)

    client, made = cast(Any, SimpleNamespace(get_render=get_render)), []
    app.scrubber.speed.value = 20.0
    app.begin_film(client, lambda name, content: made.append((name, content)))
    while app.filming:
        app.tick()
    (name, content), end = made[0], app.scrubber.time.max
    assert name == "circle_1.gif"
    assert seen == pytest.approx(np.arange(len(seen)) * 1.6)  # s: 20 trial seconds a second, 12.5 pictures
    assert end - 1.6 < seen[-1] <= end
    picture = Image.open(io.BytesIO(content))
    assert getattr(picture, "n_frames", 1) == len(seen)
    assert picture.size == (800, 600)
    with pytest.raises(DataError, match=r"set the speed to 2\.1 or more"):
        Film(client, 100.0, 1.0)


def test_a_film_begins_once_the_browser_looks_from_the_servers_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    """It connects with viser's own camera (3, 3, 3): a first picture from there came in three films of three."""
    camera, polls = SimpleNamespace(position=np.array([3.0, 3.0, -3.0])), []

    def clients() -> dict[int, Any]:
        polls.append(1)
        if len(polls) == 4:
            camera.position = np.array([0.0, -1.45, 0.15])
        return {} if len(polls) == 1 else {0: SimpleNamespace(camera=camera)}

    server = cast(Any, SimpleNamespace(get_clients=clients, initial_camera=SimpleNamespace(position=(0.0, -1.45, 0.15))))
    now = [0.0]
    clock = SimpleNamespace(monotonic=lambda: now[0], sleep=lambda s: now.__setitem__(0, now[0] + s))
    monkeypatch.setattr(headless, "time", clock)
    assert headless._placed_client(server).camera is camera
    assert len(polls) == 4
    camera.position = np.array([3.0, 3.0, -3.0])
    with pytest.raises(DataError, match="did not open the viewer within 60 s"):
        headless._placed_client(server)


def test_a_film_begins_once_pictures_stay_alike() -> None:
    """The first are darker, as the page loads its light while it draws: two of those, then one between, then the same for good."""
    shades = iter([40, 40, 120, 200, 200, 200])
    drawn: list[int] = []

    def get_render(high: int, wide: int, timeout: float) -> np.ndarray:
        drawn.append(next(shades))
        return np.full((high, wide, 3), drawn[-1], np.uint8)

    headless._await_light(cast(Any, SimpleNamespace(get_render=get_render)))
    assert drawn == [40, 40, 120, 200, 200]


def test_a_browser_that_goes_ends_its_film_and_nothing_else(server: Any) -> None:
    app = TwinPanel(server, [("", rubbing())], sample())
    app.tick()

    def get_render(high: int, wide: int, timeout: float) -> np.ndarray:
        raise RuntimeError("the client disconnected")

    app.begin_film(cast(Any, SimpleNamespace(get_render=get_render)), lambda name, content: None)
    app.tick()
    assert not app.filming
    assert "no picture came" in app.words.content
    app._redraw = True
    app.tick()
    assert "over the trial" in app.words.content


def test_two_twins_are_told_apart_and_two_that_no_slider_drives_are_refused(server: Any) -> None:
    app = TwinPanel(server, [("report", rubbing()), ("continuum", Twin.of("continuum"))], sample())
    app.tick()
    assert "A: report: error" in app.words.content
    assert "B: continuum: error" in app.words.content
    rubbed, plain = (side.predict(0).rms for side in app.shown_twins)
    assert rubbed < 0.5 * plain
    with pytest.raises(DataError, match="the same sliders do not drive continuum and finger"):
        TwinPanel(server, [("a", Twin.of("continuum")), ("b", Twin.of("finger"))])


def test_a_replay_keeps_no_more_than_it_may() -> None:
    replay = Replay(sample(), rubbing())
    for mu in range(MOST_PREDICTIONS + 2):
        replay.predict(replace(Twin.of("continuum"), values={"tendons.radius": 8e-3 + 1e-6 * mu}), 0)
    assert len(replay._predictions) == MOST_PREDICTIONS


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ({"what": ("continuum", "finger", "hand")}, "at most two twins and one set"),
        ({"what": ("continuum",), "film": Path("x.gif")}, "a film shows a replay"),
        ({"film": Path("nowhere/x.gif")}, "is no folder"),
    ],
)
def test_what_cannot_be_shown_is_said(words: dict[str, object], told: str) -> None:
    said = View(**words)  # type: ignore[arg-type]
    with pytest.raises(DataError, match=told):
        said.run()


def test_a_loop_shows_what_friction_keeps_back() -> None:
    """The tip follows a play of 1 mm that the prediction has not: half of it behind as the pull rises, half before as it falls."""
    pull = np.concatenate([np.linspace(0.0, 2.0, 50), np.linspace(2.0, 0.0, 50)])
    where = 0.01 * pull
    played = where - 5e-4 * np.where(np.arange(100) < 50, 1.0, -1.0)
    tip = lambda x: np.column_stack([0.0 * x, -x, 0.1 + 0.0 * x])  # noqa: E731
    measured = tip(played)
    measured[[0, 7]] = np.nan
    loop = TipLoop("tension of tendon 1, N", pull, measured, [tip(where), tip(played)])
    missed, none = loop.tip_errors()
    assert np.isnan(missed[[0, 7]]).all()
    assert np.nanmax(np.abs(missed[1:50] + 0.5)) < 1e-9  # mm, counted as the pull rises, though y falls
    assert missed[50:] == pytest.approx(0.5)
    assert np.nanmax(np.abs(none)) < 1e-9
    drawn = draw_svg(loop, ("#111111", "#222222"), 20)
    assert drawn.count("<polyline") == drawn.count("<circle") == 2
    assert "nan" not in drawn
    assert draw_svg(loop, ("#111111",), 7).count("<circle") == 0  # not seen then
    assert draw_svg(TipLoop("", np.ones(100), measured, [tip(where)]), ("#111111",), 0) == ""


def test_a_replays_loop_is_of_the_tendon_that_moves_it() -> None:
    replay = Replay(sample(), rubbing())
    for k, label in enumerate(replay.labels):
        words, pull = replay.strongest_pull(k)
        assert words.startswith("tension of tendon ")
        assert words.endswith(", N")
        raw = next(t for t in sample().trials if t.name.startswith(label)).values
        most = max((np.ptp(raw[f"tendon_{i}_tension"]), i) for i in (1, 2, 3))[1]
        assert words == f"tension of tendon {most}, N"
        assert np.array_equal(pull, raw[f"tendon_{most}_tension"])
