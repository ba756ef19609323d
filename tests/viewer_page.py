"""The viewer served to a test, and a real browser's window on it."""

from __future__ import annotations

import io
import shutil
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
import pytest
import viser
from PIL import Image

from twin.effects import effect_class
from twin.measurements import Recording, read
from twin.prediction.twin import Twin
from twin.viewer import TwinPanel
from twin.viewer.panel import Panel

SAMPLE = Path(__file__).parents[1] / "models/continuum/samples/friday"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
P = TypeVar("P", bound=Panel)
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


def rubbing() -> Twin:
    return replace(Twin.of("continuum"), effects=(effect_class("tendon_friction")({"mu": 0.21}),))


def sample() -> Recording:
    whole = read(SAMPLE)
    return replace(whole, trials=whole.select(["circle_1", "slow_1"]).trials)


@dataclass
class Served(Generic[P]):
    app: P
    address: str


def served(
    twins: Sequence[tuple[str, Twin]], recording: Recording | None = None, port: int = 8650
) -> AbstractContextManager[Served[TwinPanel]]:
    return serving(lambda server: TwinPanel(server, twins, recording), port)


@contextmanager
def serving(make: Callable[[viser.ViserServer], P], port: int = 8650) -> Iterator[Served[P]]:
    server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    app, over = make(server), threading.Event()

    def loop() -> None:
        while not over.is_set():
            app.tick()
            time.sleep(0.005)

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        yield Served(app, f"http://127.0.0.1:{server.get_port()}")
    finally:
        over.set()
        thread.join()
        server.stop()


Look = Callable[[str], "Page"]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if CHROMIUM is None:
        warnings.warn("NO BROWSER: the viewer was not tried; apt-get install chromium", stacklevel=1)
        pytest.skip("no chromium here: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        yield chromium
        chromium.close()


@pytest.fixture
def look(browser: Any) -> Iterator[Callable[[str], Page]]:
    """Opens a page at an address; all are closed in the end, as one that nobody looks at draws on."""
    opened: list[Page] = []

    def at(address: str) -> Page:
        opened.append(Page(browser, address))
        return opened[-1]

    yield at
    for one in opened:
        one.page.close()


class Page:
    """A browser's window of 1366 x 768, of which the left 1,000 columns below the notices are the scene."""

    def __init__(self, browser: Any, address: str) -> None:
        self.page = browser.new_page(viewport={"width": 1366, "height": 768})
        self.page.goto(address)
        self.page.wait_for_selector("canvas", timeout=60_000)

    def scene(self) -> np.ndarray:
        shot = self.page.screenshot(clip={"x": 320, "y": 160, "width": 700, "height": 560})
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)

    def until(self, true: Callable[[], bool]) -> bool:
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

    def drop_down(self, label: str) -> Any:
        """A drop-down list."""
        row = self.page.locator("label", has_text=label).first.locator("xpath=ancestor::div[.//input][1]")
        return row.locator("input").first

    def chosen(self, label: str) -> str:
        """What of a drop-down list is shown."""
        return self.drop_down(label).input_value()

    def choose(self, label: str, value: str) -> None:
        """Of a drop-down list."""
        self.drop_down(label).click()
        self.page.get_by_role("option", name=value).click()

    def button(self, name: str) -> Any:
        return self.page.get_by_role("button", name=name)
