"""What all panels share: pictures and films of the scene, and the loop that serves them.

Callbacks of a panel only note what is wanted: one loop solves and draws, since a solver serves one thread.
"""

from __future__ import annotations

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import viser

from twin.errors import TwinError
from twin.figure import Range
from twin.viewer.colours import bar
from twin.viewer.film import Film, captioned, plain, png, render
from twin.viewer.scrubber import Clock

RATE = 60.0  # Hz, of the loop
PAUSE = 0.25  # s: a clock that was held up for longer does not catch up
SHADES = {"tension": "tension of the tendons", "strain": "strain of the skin", "resistance": "resistance of the cords"}
Sent = Callable[[str, bytes], None]


class Panel(ABC):
    """Base of what stands beside a scene. It has a clock, `scrubber`, and a heading, which `_heading` makes."""

    scrubber: Clock

    def __init__(self, server: viser.ViserServer) -> None:
        self.server = server
        self._wanted, self._clock = True, time.monotonic()
        self._asked: list[Callable[[], None]] = []  # what clicks and buttons left to the loop
        self._film: tuple[Film, Sent] | None = None
        self._ranges: dict[str, Range] = {}
        self.drawn = 0  # pictures sent

    def _heading(self, gui: viser.GuiApi) -> None:
        """The colour bars, and what is said of the picture."""
        self._bar, self.words = gui.add_html(""), gui.add_markdown("")

    def _picture_button(self, gui: viser.GuiApi) -> None:
        self.picture = gui.add_button("save picture", hint="of the scene as you see it, its colour bar beside it, as PNG")
        self.picture.on_click(lambda event: self._asked.append(lambda: self._save(event)))

    def _film_button(self, gui: viser.GuiApi) -> None:
        self.film = gui.add_button("save film", hint="the trial from first to last at this speed, as GIF; keep the window open")
        self.film.on_click(lambda event: self._asked.append(lambda: self._filmed(event)))

    def _changed(self, handle: Any) -> None:
        def note(event: viser.GuiEvent) -> None:
            # What the loop itself moved needs no second picture.
            if event.client is not None:
                self._wanted = True

        clicked = isinstance(handle, viser.GuiButtonGroupHandle | viser.GuiButtonHandle)
        (handle.on_click if clicked else handle.on_update)(note)

    def _colours(self, gui: viser.GuiApi, shades: Sequence[str]) -> None:
        """What the figure may be coloured by."""
        told = tuple(SHADES[s] for s in shades)
        self.shade = gui.add_dropdown("colour by", told, visible=len(told) > 1, hint="what the colours of the robot mean")
        self._changed(self.shade)

    @property
    def _shade(self) -> str:
        return next(s for s, told in SHADES.items() if told == self.shade.value)

    @property
    def _bars(self) -> list[Range]:
        """The ranges that are in the picture."""
        return [r for shade, r in self._ranges.items() if shade in (self._shade, "temperature")]

    def _range(self, ranges: dict[str, Range]) -> None:
        """From now on colours mean this."""
        self._ranges = ranges
        now = "".join(bar(r) for r in self._bars)
        if now != self._bar.content:
            self._bar.content = now

    @property
    @abstractmethod
    def _end(self) -> float:
        """s, of the chosen trial."""

    @abstractmethod
    def _stand(self) -> None:
        """Draw the chosen trial at the scrubber's time."""

    @abstractmethod
    def _shown(self, passed: float) -> bool:
        """Draw what is wanted, `passed` (s) after the last time. Whether anything was drawn."""

    # ---- pictures and films ---------------------------------------------------------------------------------------------

    def _save(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            camera = event.client.camera
            picture = render(event.client, int(camera.image_width), int(camera.image_height))
            self._handed(event.client)("twin.png", png(captioned(picture, plain(self.words.content), self._bars)))

    def _filmed(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self.begin_film(event.client, self._handed(event.client))

    def _handed(self, client: viser.ClientHandle) -> Sent:
        return lambda name, content: client.send_file_download(name, content, save_immediately=True)

    def begin_film(self, client: viser.ClientHandle, sent: Sent) -> None:
        """Take a film of the chosen trial as `client` sees it; `sent` takes its name and content. Raises DataError for one of too
        many pictures."""
        self.scrubber.play.value = False
        self._film = Film(client, self._end, self.scrubber.speed.value), sent

    def _take(self, film: Film, sent: Sent) -> None:
        self.scrubber.time.value = film.time
        self._stand()
        film.take(f"{self.scrubber.trial.value}\n{plain(self.words.content)}", self._bars)
        self.words.content = f"taking a film: {film.time:.2f} of {film.end:.2f} s"
        if film.done:
            sent(f"{self.scrubber.trial.value}.gif", film.gif())
            self._film, self._wanted = None, True

    @property
    def filming(self) -> bool:
        return self._film is not None

    # ---- the loop -------------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Serve until interrupted."""
        while True:
            started = time.monotonic()
            self.tick()
            time.sleep(max(0.001, 1.0 / RATE - (time.monotonic() - started)))

    def tick(self) -> None:
        """Draw what is wanted by now."""
        now = time.monotonic()
        passed, self._clock = min(now - self._clock, PAUSE), now
        try:
            while self._asked:
                self._wanted = True
                self._asked.pop(0)()
            if self._film is not None:
                self._take(*self._film)
            elif not self._shown(passed):
                return
        except TwinError as error:
            self.words.content, self._film = f"**{error}**", None
            return
        self.drawn += 1


Make = Callable[[viser.ViserServer], Panel]  # a panel on a server


def served(port: int, label: str | None = None) -> viser.ViserServer:
    """A server on 127.0.0.1, at the first free port from `port` on."""
    # Browsers open connections ahead and drop those they do not need, each of which would be a traceback.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    return viser.ViserServer(host="127.0.0.1", port=port, label=label, verbose=False)


def serve(make: Make, name: str, port: int, told: Callable[[str], None]) -> None:
    """Serve on 127.0.0.1, the first free port from `port` on, until interrupted; `told` the address once the picture stands."""
    server = served(port, f"twin view {name}")
    try:
        panel = make(server)
        panel.tick()
        told(f"http://127.0.0.1:{server.get_port()}")
        panel.run()
    finally:
        server.stop()
