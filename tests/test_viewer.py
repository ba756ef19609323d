"""The viewer: what it draws is what the twin predicts, and a real browser shows it and drives it.

The browser's part needs Chromium (Debian's `chromium`) and is skipped, loudly, where there is none.
"""

from __future__ import annotations

import io
import shutil
import threading
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import viser
from PIL import Image

from twin.body import Problem
from twin.effects import Drive, Loads, Route, named
from twin.errors import DataError
from twin.evaluate import evaluate
from twin.figure import Range
from twin.measurements import Recording, read
from twin.twin import Twin, simulate
from twin.viewer import App
from twin.viewer import app as app_module
from twin.viewer import replay as replay_module
from twin.viewer.colours import bar, colours
from twin.viewer.live import Live
from twin.viewer.replay import Replay

SAMPLE = Path(__file__).parents[1] / "models/continuum/samples/friday"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
G = np.array([0.0, 0.0, 9.81])


def rubbing() -> Twin:
    return replace(Twin.of("continuum"), effects=(named("tendon_friction")({"mu": 0.21}),))


def sample() -> Recording:
    whole = read(SAMPLE)
    return replace(whole, trials=whole.select(["circle_1", "slow_1"]).trials)


# ---- what is drawn ----------------------------------------------------------------------------------------------------------


def test_the_finger_skin_moves_with_the_silicone() -> None:
    twin = Twin.of("finger")
    drawn = twin.figure()
    shown = Live(twin).shape(np.array([1.5, 0.0, 0.0, 0.0]), Loads(G))
    tip = shown.markers[0, -1]
    assert np.allclose(shown.skin[0, -1], tip, atol=1e-9)  # the last point of the skin is the tip
    assert tip[0] > 0.01  # m, towards tendon 1
    inside, outside = shown.strain[0].reshape(-1)[:-1].reshape(-1, 32)[14, [0, 16]]
    assert inside < -0.02 < 0.02 < outside  # pressed on the side that is pulled, stretched on the other
    assert drawn.faces.max() == shown.skin.shape[1] - 1


def test_tension_along_the_tendons_falls_by_friction_and_not_without() -> None:
    tension = np.array([1.5, 0.0, 0.0])
    for twin, falls in ((rubbing(), True), (Twin.of("continuum"), False)):
        along = Live(twin).shape(tension, Loads(G)).tension[0].reshape(3, -1)[0]
        assert along[0] == pytest.approx(1.5)
        if falls:  # Euler: 1.5 exp(-mu theta) at most; the turn at the holes adds up to less than the bend of a radian
            assert np.all(np.diff(along) < 0.0)
            assert 1.5 * np.exp(-0.21 * 1.2) < along[-1] < 1.5 * np.exp(-0.21 * 0.5)
        else:
            assert np.allclose(along, 1.5, atol=1e-12)


def test_a_replay_is_what_evaluate_measures() -> None:
    one = replace(sample(), trials=sample().trials[:1])
    replay, twin = Replay(one, rubbing()), rubbing()
    track = replay.track(twin, 0)
    assert 1e3 * track.rms == pytest.approx(evaluate(twin, one)["rmse"], rel=1e-6)
    assert np.allclose(track.frames.markers[:, :8], track.markers)  # no effect stands between the two here
    slack = track.frames.at(3).tension[0]
    between = track.frames.at(3, 0.5).tension[0]
    assert np.allclose(between, 0.5 * (slack + track.frames.at(4).tension[0]))


def test_the_standing_robot_and_the_replayed_one_are_one_figure() -> None:
    twin = Twin.of("continuum")
    tension = np.array([1.0, 0.4, 0.0])
    drawn = twin.figure()
    path = twin.robot.solver(twin.body()).solve(Problem(np.zeros(1), tension[None], Loads(G)))
    replayed, standing = drawn.frames(path, Loads(G), Route()), Live(twin).shape(tension, Loads(G))
    for name in ("place", "piece", "markers"):
        assert np.allclose(getattr(replayed, name), getattr(standing, name), atol=1e-6)  # m: two solves' tolerance


def test_the_bar_says_what_the_colours_are() -> None:
    over = Range("tension", "N", 1.0, 0.0, 2.0)
    assert colours(np.array([0.0, 2.0, 9.0]), over).tolist() == [[68, 1, 84], [253, 231, 37], [253, 231, 37]]
    for word in ("tension, N", ">0<", ">1<", ">2<"):
        assert word in bar(over)


def test_what_is_not_drawn_is_said() -> None:
    with pytest.raises(DataError, match="not drawn here yet"):
        Twin.of("two_link").figure()


def test_a_robot_under_sliders_remembers_where_its_tendons_turned_and_no_more() -> None:
    """Pre-sliding friction wipes out a loop inside a larger pull, so that small steps up, or a dip on the way, end where one pull
    ends; letting go half-way does not."""
    live = Live(rubbing())

    def tip(*pulls: float) -> np.ndarray:
        for pull in (0.0, *pulls):
            shown = live.shape(np.array([pull, 0.0, 0.0]), Loads(G))
        return shown.markers[0, -1]

    def fresh(*pulls: float) -> np.ndarray:
        nonlocal live
        live = Live(rubbing())
        return tip(*pulls)

    at_once = fresh(1.0)
    assert np.allclose(fresh(0.2, 0.4, 0.6, 0.8, 1.0), at_once, atol=1e-6)  # m: the solves' tolerance
    assert np.allclose(fresh(0.7, 0.4, 1.0), at_once, atol=1e-6)
    assert np.linalg.norm(fresh(1.5, 1.0) - at_once) > 1e-3  # the loop of mu = 0.21 is millimetres wide
    live.shape(np.array([1.0, 0.0, 0.0]), Loads(G, 0.01))  # other loads: it starts anew from slack
    loaded = live.shape(np.array([1.0, 0.0, 0.0]), Loads(G, 0.01)).markers[0, -1]
    fresh_loaded = Live(rubbing()).shape(np.array([1.0, 0.0, 0.0]), Loads(G, 0.01)).markers[0, -1]
    assert np.allclose(loaded, fresh_loaded, atol=1e-6)


def test_motors_that_take_up_length_pull_as_the_tension_they_cause() -> None:
    twin = Twin.of("continuum")
    held = Live(twin, Drive.DISPLACEMENT).shape(np.array([2e-3, -2e-3, -2e-3]), Loads(G))
    tension = held.tension[0].reshape(3, -1)[:, 0]
    assert tension[0] > 0.2  # N
    assert held.markers[0, -1, 0] > 5e-3  # m, towards tendon 1
    pulled = Live(twin).shape(tension, Loads(G))
    assert np.allclose(pulled.markers, held.markers, atol=2e-5)  # m: a motor's length is solved to 1e-6, a tip follows ten-fold


def test_a_hands_fingers_stand_around_its_palm() -> None:
    """Equal pulls under gravity along the axis: a third of a turn takes one finger to the next."""
    twin = Twin.of("hand")
    drawn = twin.figure()
    pull = np.array([1.0 if i % 4 == 0 else 0.0 for i in range(twin.robot.n_tendon)])
    shown = Live(twin).shape(pull, Loads(np.array([0.0, 0.0, -9.81])))
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
    """The rate itself is for `tools/viewer_speed.py`: here the clock is the test's own."""
    solved, now = [], [100.0]
    monkeypatch.setattr(replay_module, "simulate", lambda *a, **b: solved.append(1) or simulate(*a, **b))
    monkeypatch.setattr(app_module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    server = viser.ViserServer(host="127.0.0.1", port=8670, verbose=False)
    try:
        app = App(server, [("", rubbing())], sample())
        app.tick()
        app.scrubber.play.value, app.scrubber.speed.value = True, 2.0
        for _ in range(90):
            now[0] += 1.0 / 60.0
            app.tick()
        assert app.drawn == 91
        assert app.scrubber.time.value == pytest.approx(3.0)  # 1.5 s at twice the speed
        assert len(solved) == 2  # the trial as described and with its effect, once each
    finally:
        server.stop()


# ---- in a browser -----------------------------------------------------------------------------------------------------------


@dataclass
class Served:
    app: App
    address: str


def _served(twin: Twin, recording: Recording | None, port: int = 8650) -> Iterator[Served]:
    server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    app, over = App(server, [("", twin)], recording), threading.Event()

    def loop() -> None:
        while not over.is_set():
            app.tick()
            time.sleep(0.005)

    thread = threading.Thread(target=loop)
    thread.start()
    yield Served(app, f"http://127.0.0.1:{server.get_port()}")
    over.set()
    thread.join()
    server.stop()


@pytest.fixture
def replayed() -> Iterator[Served]:
    yield from _served(rubbing(), sample())


@pytest.fixture(params=["continuum", "finger"])
def by_hand(request: pytest.FixtureRequest) -> Iterator[Served]:
    yield from _served(Twin.of(request.param), None)


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    if CHROMIUM is None:
        warnings.warn("NO BROWSER: the viewer was not tried; apt-get install chromium", stacklevel=1)
        pytest.skip("no chromium here: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    software = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=CHROMIUM, args=software)
        yield chromium
        chromium.close()


class Page:
    """A browser's window of 1366 x 768, of which the left 1,000 columns below the notices are the scene."""

    def __init__(self, browser, address: str) -> None:  # type: ignore[no-untyped-def]
        self.page = browser.new_page(viewport={"width": 1366, "height": 768})
        self.page.goto(address)
        self.page.wait_for_selector("canvas")

    def scene(self) -> np.ndarray:
        shot = self.page.screenshot(clip={"x": 320, "y": 160, "width": 700, "height": 560})
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)

    def until(self, true) -> bool:  # type: ignore[no-untyped-def]
        """Whether `true()` comes true within 30 s; a software renderer on a busy machine takes its time."""
        end = time.monotonic() + 30.0
        while time.monotonic() < end:
            if true():
                return True
            self.page.wait_for_timeout(250)
        return False

    def changed(self, before: np.ndarray) -> bool:
        """Whether over 500 pixels of the scene become other ones: a disk is larger."""
        return self.until(lambda: int((np.abs(self.scene() - before).max(axis=2) > 40).sum()) > 500)

    def there(self) -> bool:
        """Whether the scene is more than its white: a robot fills thousands of pixels."""
        return self.until(lambda: int((self.scene().min(axis=2) < 200).sum()) > 3000)

    def put(self, label: str, value: str) -> None:
        """Into the number beside a slider."""
        row = self.page.locator("label", has_text=label).first.locator("xpath=ancestor::div[.//input[@type='text']][1]")
        box = row.locator("input[type=text]").first
        box.fill(value)
        box.press("Enter")


def _tip_x(app: App) -> float:
    return float(app.words.content.split("**")[1])


def test_a_slider_moves_the_robot(browser, by_hand: Served) -> None:  # type: ignore[no-untyped-def]
    page = Page(browser, by_hand.address)
    assert page.there()
    before, words = page.scene(), by_hand.app.words.content
    page.put("tendon 1, N", "2")
    assert page.until(lambda: by_hand.app.hand.pulls[0].value == 2.0)
    assert page.changed(before)
    assert by_hand.app.words.content != words
    assert "2.00 N" in by_hand.app.words.content
    before, x = page.scene(), _tip_x(by_hand.app)
    page.put("push, N", "0.1")
    assert page.until(lambda: by_hand.app.hand.push.value == 0.1)
    assert page.changed(before)
    assert _tip_x(by_hand.app) > x + 1.0  # mm, along x: 0.1 N sideways bend a rod and a finger by far more


def test_scrubber_and_effect_switch_change_picture_and_numbers(browser, replayed: Served) -> None:  # type: ignore[no-untyped-def]
    page, app = Page(browser, replayed.address), replayed.app
    assert page.there()
    before, words = page.scene(), app.words.content
    page.put("time, s", "6")
    assert page.changed(before)
    assert page.until(lambda: "t = 5." in app.words.content)  # the last sample before 6 s: they come every half second
    assert app.words.content != words
    before, words = page.scene(), app.words.content
    page.page.get_by_role("checkbox", checked=True).first.click()  # the effect's: nothing plays
    assert page.until(lambda: "no effect" in app.words.content)
    assert page.changed(before)
    page.page.get_by_role("button", name="as described").click()
    assert page.until(lambda: "(as described)" in app.words.content)


def test_two_clients_one_that_goes_and_a_second_server_on_the_port(browser, replayed: Served) -> None:  # type: ignore[no-untyped-def]
    first, second = Page(browser, replayed.address), Page(browser, replayed.address)
    assert first.there()
    assert second.there()
    first.page.close()
    before = second.scene()
    second.put("time, s", "6")
    assert second.changed(before)
    other = next(_served(Twin.of("continuum"), None, int(replayed.address.rpartition(":")[2])))
    assert other.address != replayed.address
