"""A film of a replay without a window: Chromium looks at the viewer, and nobody at Chromium."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from twin.errors import DataError
from twin.viewer.film import HIGH, WIDE
from twin.viewer.panel import Make, Panel, served

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PORT = 8080  # or the next one that is free
OPENING = 60.0  # s for the browser to come
# Without a screen, and drawing by the processor.
QUIETLY = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


def take_film(make: Make, trial: str | None, speed: float, out: Path, progress: Callable[[str], None]) -> None:
    """Write a GIF of a panel's trial (its own by default), `speed` times as fast, to `out`. Raises DataError for a trial that is
    not there, and where no browser is found or draws."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        raise DataError("no Chromium is found to draw a film: apt-get install chromium, or save the film in the viewer's page")
    server = served(PORT)
    try:
        app = make(server)
        if trial is not None and trial not in app.scrubber.labels:
            raise DataError(f"the set has no trial {trial!r}; it has {', '.join(app.scrubber.labels)}")
        app.scrubber.trial.value, app.scrubber.speed.value = trial or app.scrubber.trial.value, speed
        app.tick()
        with tempfile.TemporaryDirectory() as profile:
            size = f"--window-size={WIDE + 500},{HIGH + 200}"
            address = f"http://127.0.0.1:{server.get_port()}"
            command = [browser, *QUIETLY, size, f"--user-data-dir={profile}", address]
            with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
                try:
                    _taken(app, out, progress)
                finally:
                    process.terminate()
    finally:
        server.stop()


def _taken(app: Panel, out: Path, progress: Callable[[str], None]) -> None:
    end = time.monotonic() + OPENING
    while not app.server.get_clients():
        if time.monotonic() > end:
            raise DataError(f"Chromium did not open the viewer within {OPENING:.0f} s; save the film in the viewer's page")
        time.sleep(0.1)
    client, made = next(iter(app.server.get_clients().values())), []
    app.begin_film(client, lambda _, content: made.append(content))
    while app.filming:
        app.tick()
        progress(app.words.content)
    if not made:
        raise DataError(app.words.content.strip("*"))
    part = out.with_name(out.name + ".part")
    part.write_bytes(made[0])
    part.replace(out)
