"""Take a film of a replay without a window, in headless Chromium."""

import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import viser

from twin.foundation.atomic_write import write_atomically
from twin.foundation.errors import DataError
from twin.viewer.address import THIS_MACHINE
from twin.viewer.drawing.film import FILM_HEIGHT, FILM_WIDTH, take_picture
from twin.viewer.panel import MakePanel, Panel, start_server

BROWSER_NAMES = ("chromium", "chromium-browser", "google-chrome")
FILM_PORT = 8080  # or the next free one
BROWSER_TIMEOUT = 60.0  # s for the browser to connect and to take its camera
CAMERA_TOLERANCE = 1e-3  # heights
FIRST_TRIALS, MOST_TRIALS = 3, 20  # pictures before a film: the second may still be as dark as the first
SAME_PICTURE = 0.1  # grey levels, mean difference of two pictures of the same
# Without a screen; the processor draws.
BROWSER_OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)


def take_film(make: MakePanel, trial: str | None, speed: float, out: Path, progress: Callable[[str], None]) -> None:
    """Write a GIF of a trial of the panel (by default the one it shows), `speed` times as fast, to `out`.

    Raises DataError for an unknown trial, and where no browser is found or draws.
    """
    browser = next((found for name in BROWSER_NAMES if (found := shutil.which(name))), None)
    if browser is None:
        raise DataError(
            "no Chromium was found to draw the film: apt-get install chromium, or save the film in the page of the viewer"
        )
    server = start_server(THIS_MACHINE, FILM_PORT)
    try:
        app = make(server)
        if trial is not None and trial not in app.scrubber.labels:
            raise DataError(f"the set has no trial {trial!r}; it has {', '.join(app.scrubber.labels)}")
        app.scrubber.trial.value, app.scrubber.speed.value = trial or app.scrubber.trial.value, speed
        app.tick()
        with tempfile.TemporaryDirectory() as profile:
            size = f"--window-size={FILM_WIDTH + 500},{FILM_HEIGHT + 200}"
            address = f"http://{THIS_MACHINE}:{server.get_port()}"
            command = [browser, *BROWSER_OPTIONS, size, f"--user-data-dir={profile}", address]
            with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
                try:
                    _record(app, out, progress)
                finally:
                    process.terminate()
    finally:
        server.stop()


def _record(app: Panel, out: Path, progress: Callable[[str], None]) -> None:
    client, made = _placed_client(app.server), []
    _await_light(client)
    app.begin_film(client, lambda _, content: made.append(content))
    while app.filming:
        app.tick()
        progress(app.words.content)
    if not made:
        raise DataError(app.words.content.strip("*"))
    write_atomically(out, made[0])


def _placed_client(server: viser.ViserServer) -> viser.ClientHandle:
    """Return the browser once it looks from the camera that the server gave it.

    A page connects with viser's own camera and takes the server's some messages later: a picture before that is from elsewhere.
    """
    end = time.monotonic() + BROWSER_TIMEOUT
    while time.monotonic() < end:
        for client in server.get_clients().values():
            if np.allclose(client.camera.position, server.initial_camera.position, atol=CAMERA_TOLERANCE):
                return client
        time.sleep(0.1)
    raise DataError(f"Chromium did not open the viewer within {BROWSER_TIMEOUT:.0f} s; save the film in the page of the viewer")


def _await_light(client: viser.ClientHandle) -> None:
    """Wait until the browser draws the same picture twice: its first ones lack the light, which it loads beside drawing.

    Raises DataError where it draws nothing.
    """
    pictures: list[np.ndarray] = []
    while len(pictures) < MOST_TRIALS:
        pictures.append(np.asarray(take_picture(client), int))
        if len(pictures) >= FIRST_TRIALS and np.abs(pictures[-1] - pictures[-2]).mean() < SAME_PICTURE:
            return
