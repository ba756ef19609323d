"""The viewer in a real browser, which shows it and drives it.

Needs Chromium (Debian's `chromium`) and is skipped, loudly, where there is none.
"""

from __future__ import annotations

import io
import threading
from pathlib import Path

import numpy as np
import pytest
import viser
from PIL import Image

from tests.viewer_page import Look, Page, browser, look, rubbing, sample, served
from twin.body import Drive
from twin.prediction.twin import Twin
from twin.viewer import TwinPanel
from twin.viewer.drawing import film as film_module
from twin.viewer.panel import open_panel, start_server
from twin.viewer.waiting import WorkNotice

__all__ = ["browser", "look"]  # fixtures


def _tip_x(app: TwinPanel) -> float:
    return float(app.words.content.split("**")[1])


def _click(page: Page) -> None:
    """On the robot: the darkest pixel of the scene that is not its rim."""
    dark = page.scene().sum(axis=2)
    y, x = divmod(int(dark[60:-60, 60:-60].argmin()), dark.shape[1] - 120)
    page.page.mouse.click(320 + 60 + x, 160 + 60 + y)


def test_a_backbone_by_tension_then_by_currents_and_pushed_where_it_is_clicked(look: Look) -> None:
    with served([("", Twin.of("continuum"))]) as here:
        page, app = look(here.address), here.app
        assert page.there()
        before, words = page.scene(), app.words.content
        page.put("tendon 1, N", "2")
        assert page.until(lambda: app.controls.pulls[0].value == 2.0)
        assert page.changed(before)
        assert app.words.content != words
        assert "2.00 N" in app.words.content
        before = page.scene()
        page.choose("pull by", "current")
        assert page.until(lambda: app.controls.drive is Drive.CURRENT and "springs at 23, 23, 23 degC" in app.words.content)
        assert page.changed(before)  # springs, and a straight robot
        page.put("clock x", "0")
        page.put("spring 1, A", "1")
        assert page.until(lambda: "still warming" in app.words.content)
        assert page.page.get_by_text("temperature of the SMA springs, degC").is_visible()
        before = page.scene()
        page.button("run until at rest").click()
        assert page.until(lambda: "at rest: the clock waits" in app.words.content)
        assert _tip_x(app) > 10.0  # mm, towards the warm spring
        assert page.changed(before)
        _click(page)
        assert page.until(lambda: app.controls.push.value > 0.0)
        assert page.page.get_by_text("push at, mm").is_visible()


def test_a_finger_its_cords_and_a_push_where_its_skin_is_clicked(look: Look) -> None:
    with served([("", Twin.of("finger"))]) as here:
        page, app = look(here.address), here.app
        assert page.there()
        before, words = page.scene(), app.words.content
        page.put("tendon 1, N", "2")
        assert page.until(lambda: app.words.content != words)
        assert page.changed(before)
        before = page.scene()
        page.choose("colour by", "resistance of the cords")
        assert page.until(page.page.get_by_text("resistance of the sensor cords, R/R0 - 1, %").is_visible)
        assert page.changed(before)
        x = _tip_x(app)
        page.put("push, N", "0.1")
        assert page.until(lambda: app.controls.push.value == 0.1 and _tip_x(app) > x + 1.0)  # mm: it bends a finger by far more
        page.put("push at, mm", "20")
        assert page.until(lambda: _tip_x(app) < x + 1.0)  # near the clamp it does not
        height, aside = app.controls.height.value, app.controls.push_azimuth.value
        _click(page)
        assert page.until(lambda: (app.controls.height.value, app.controls.push_azimuth.value) != (height, aside))


def test_scrubber_effect_switch_picture_and_film(look: Look, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film_module, "FILM_RATE", 1.0)  # pictures a second: four of the trial at twenty times its speed
    with served([("", rubbing())], sample()) as here:
        page, app = look(here.address), here.app
        assert page.there()
        before, words = page.scene(), app.words.content
        page.put("time, s", "6")
        assert page.changed(before)
        assert page.until(lambda: "t = 5." in app.words.content)  # the last sample before 6 s: they come every half second
        assert app.words.content != words
        loop = page.page.locator("svg polyline")
        assert page.until(lambda: loop.count() == 2)  # as described and as shown
        mark, drawn = page.page.locator("svg circle").first, app.scrubber.loop.content
        assert mark.is_visible()
        page.put("time, s", "12")
        assert page.until(lambda: app.scrubber.loop.content != drawn)
        before, words = page.scene(), app.words.content
        page.page.get_by_role("checkbox", checked=True).first.click()  # the effect's: nothing plays
        assert page.until(lambda: "no effect" in app.words.content)
        assert page.changed(before)
        assert page.chosen("predicted") == "with effects"
        page.choose("predicted", "as described")
        assert page.until(lambda: "(as described)" in app.words.content)
        with page.page.expect_download() as download:
            page.button("save picture").click()
        shot = Image.open(Path(download.value.path()))
        assert shot.format == "PNG"
        assert len(shot.convert("RGB").getcolors(1 << 20) or ()) > 50  # not empty: a robot, and its bar
        page.put("speed x", "20")
        assert page.until(lambda: app.scrubber.speed.value == 20.0)
        with page.page.expect_download() as download:
            page.button("save film").click()
        taken = Image.open(io.BytesIO(Path(download.value.path()).read_bytes()))
        assert taken.format == "GIF"
        assert getattr(taken, "n_frames", 1) == int(app.scrubber.time.max / 20.0) + 1


def test_two_twins_two_clients_one_that_goes_and_a_second_server_on_the_port(look: Look) -> None:
    with served([("report", rubbing()), ("continuum", Twin.of("continuum"))], sample()) as here:
        first, second = look(here.address), look(here.address)
        assert first.there()
        assert second.there()
        first.page.close()
        before = second.scene()
        assert (before[:, :350].min(axis=2) < 200).sum() > 1500  # a robot on either side
        assert (before[:, 350:].min(axis=2) < 200).sum() > 1500
        second.put("time, s", "6")
        assert second.changed(before)
        with served([("", Twin.of("continuum"))], port=int(here.address.rpartition(":")[2])) as other:
            assert other.address != here.address


def test_a_page_opened_before_the_robot_says_what_it_waits_for_and_lives(look: Look) -> None:
    """Work that ends when the test has seen enough, in place of a compiler: the page counts its seconds and takes what is entered;
    its camera is then the one it would have had."""
    server = start_server("127.0.0.1", 8690)
    notice, over, panels = WorkNotice(server), threading.Event(), list[TwinPanel]()
    seen = threading.Event()

    def make(on: viser.ViserServer) -> TwinPanel:
        panel = TwinPanel(on, [("", Twin.of("continuum"))])
        seen.wait(60.0)
        return panel

    def work() -> None:
        with notice:
            panels.append(open_panel(make, server))
        while not over.wait(0.01):
            with notice:
                panels[0].tick()

    thread = threading.Thread(target=work)
    try:
        page = look(f"http://127.0.0.1:{server.get_port()}")
        thread.start()
        words = page.page.get_by_text("compiling and solving, ")
        assert page.until(words.is_visible)
        first = words.inner_text()
        assert page.until(lambda: words.is_visible() and words.inner_text() != first)
        page.put("tendon 1, N", "2")
        assert not panels  # entered while the work went on
        seen.set()
        assert page.until(lambda: bool(panels) and "2.00 N" in panels[0].words.content)
        assert page.until(lambda: not words.is_visible())
        client = next(iter(server.get_clients().values()))
        assert page.until(lambda: bool(np.allclose(client.camera.position, server.initial_camera.position, atol=1e-3)))
        assert page.there()
    finally:
        seen.set()
        over.set()
        thread.join()
        notice.close()
        server.stop()
