"""What all panels share: pictures and films of the scene, and the loop that draws.

Callbacks only record what is wanted; one loop solves and draws, since a solver serves one thread.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import viser

from twin.body.drawable import ColourScale
from twin.foundation.errors import TwinError
from twin.viewer.address import free_port
from twin.viewer.drawing.colours import colour_bar
from twin.viewer.drawing.film import Film, add_caption, encode_png, strip_markdown, take_picture
from twin.viewer.scrubber import Clock
from twin.viewer.waiting import WorkNotice

LOOP_RATE = 60.0  # Hz, of the loop
LONGEST_TICK = 0.25  # s; after a longer delay the clock does not catch up
COLOUR_FIELDS = {"tension": "tension of the tendons", "strain": "strain of the skin", "resistance": "resistance of the cords"}
SendFile = Callable[[str, bytes], None]


class Panel(ABC):
    """Base of panels beside a scene. It has a clock, `scrubber`, and a heading from `_add_heading`."""

    scrubber: Clock

    def __init__(self, server: viser.ViserServer) -> None:
        self.server = server
        self._redraw, self._clock = True, time.monotonic()
        self._pending: list[Callable[[], None]] = []  # actions of clicks and buttons, left to the loop
        self._film: tuple[Film, SendFile] | None = None
        self._ranges: dict[str, ColourScale] = {}
        self.pictures_drawn = 0  # pictures sent

    def _add_heading(self, gui: viser.GuiApi) -> None:
        """Add the colour bars and the text about the picture."""
        self._bar, self.words = gui.add_html(""), gui.add_markdown("")

    def _add_picture_button(self, gui: viser.GuiApi) -> None:
        self.picture = gui.add_button("save picture", hint="the scene as you see it with its colour bar, as PNG")
        self.picture.on_click(lambda event: self._pending.append(lambda: self._save_picture(event)))

    def _add_film_button(self, gui: viser.GuiApi) -> None:
        self.film = gui.add_button("save film", hint="the whole trial at this speed, as GIF; keep the window open")
        self.film.on_click(lambda event: self._pending.append(lambda: self._start_film(event)))

    def _redraw_on_change(self, handle: Any) -> None:
        def note(event: viser.GuiEvent) -> None:
            # Handles that the loop itself moved need no second picture.
            if event.client is not None:
                self._redraw = True

        clicked = isinstance(handle, viser.GuiButtonGroupHandle | viser.GuiButtonHandle)
        (handle.on_click if clicked else handle.on_update)(note)

    def _add_colour_choice(self, gui: viser.GuiApi, shades: Sequence[str]) -> None:
        """Add the choice of what the colours mean."""
        told = tuple(COLOUR_FIELDS[s] for s in shades) or ("nothing",)
        self.colour_choice = gui.add_dropdown("colour by", told, visible=len(told) > 1, hint="what the colours of the robot mean")
        self._redraw_on_change(self.colour_choice)

    @property
    def _colour_field(self) -> str:
        return next((s for s, told in COLOUR_FIELDS.items() if told == self.colour_choice.value), "")

    @property
    def _visible_ranges(self) -> list[ColourScale]:
        """Return the ranges of the colours in the picture."""
        return [r for shade, r in self._ranges.items() if shade in (self._colour_field, "temperature")]

    def _set_ranges(self, ranges: dict[str, ColourScale]) -> None:
        """Set the ranges of the colours and their bars."""
        self._ranges = ranges
        now = "".join(colour_bar(r) for r in self._visible_ranges)
        if now != self._bar.content:
            self._bar.content = now

    @property
    @abstractmethod
    def _trial_end(self) -> float:
        """Return the end of the chosen trial, s."""

    @abstractmethod
    def _draw_now(self) -> None:
        """Draw the chosen trial at the time of the scrubber."""

    @abstractmethod
    def _draw_if_wanted(self, passed: float) -> bool:
        """Draw what is wanted, `passed` (s) after the last time; return whether anything was drawn."""

    # ---- pictures and films ---------------------------------------------------------------------------------------------

    def _save_picture(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            camera = event.client.camera
            picture = take_picture(event.client, int(camera.image_width), int(camera.image_height))
            self._download_to(event.client)(
                "twin.png", encode_png(add_caption(picture, strip_markdown(self.words.content), self._visible_ranges))
            )

    def _start_film(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self.begin_film(event.client, self._download_to(event.client))

    def _download_to(self, client: viser.ClientHandle) -> SendFile:
        return lambda name, content: client.send_file_download(name, content, save_immediately=True)

    def begin_film(self, client: viser.ClientHandle, sent: SendFile) -> None:
        """Take a film of the chosen trial as `client` shows it; `sent` takes its name and content.

        Raises DataError for too many pictures.
        """
        self.scrubber.play.value = False
        self._film = Film(client, self._trial_end, self.scrubber.speed.value), sent

    def _take_film_picture(self, film: Film, sent: SendFile) -> None:
        self.scrubber.time.value = film.time
        self._draw_now()
        film.add_picture(f"{self.scrubber.trial.value}\n{strip_markdown(self.words.content)}", self._visible_ranges)
        self.words.content = f"taking a film: {film.time:.2f} of {film.end:.2f} s"
        if film.done:
            sent(f"{self.scrubber.trial.value}.gif", film.encode_gif())
            self._film, self._redraw = None, True

    @property
    def filming(self) -> bool:
        return self._film is not None

    # ---- the loop -------------------------------------------------------------------------------------------------------

    def run(self, notice: WorkNotice) -> None:
        """Serve until interrupted; `notice` tells in the page what takes long."""
        while True:
            started = time.monotonic()
            with notice:
                self.tick()
            time.sleep(max(0.001, 1.0 / LOOP_RATE - (time.monotonic() - started)))

    def tick(self) -> None:
        """Run the pending actions and draw what is wanted."""
        now = time.monotonic()
        passed, self._clock = min(now - self._clock, LONGEST_TICK), now
        try:
            while self._pending:
                self._redraw = True
                self._pending.pop(0)()
            if self._film is not None:
                self._take_film_picture(*self._film)
            elif not self._draw_if_wanted(passed):
                return
        except TwinError as error:
            self.words.content, self._film = f"**{error}**", None
            return
        self.pictures_drawn += 1


MakePanel = Callable[[viser.ViserServer], Panel]  # a panel on a server


def start_server(host: str, port: int, label: str | None = None) -> viser.ViserServer:
    """Start a server at the first free port of `host` from `port` on. Raises DataError as `free_port`."""
    return viser.ViserServer(host=host, port=free_port(host, port), label=label, verbose=False)


def serve(make: MakePanel, name: str, host: str, port: int, announce: Callable[[int], None]) -> None:
    """Serve at the first free port from `port` on until interrupted; `announce` the port at once.

    A page that is opened before the first picture says what it waits for.
    """
    server = start_server(host, port, f"twin view {name}")
    notice = WorkNotice(server)
    try:
        announce(server.get_port())
        with notice:
            panel = open_panel(make, server)
        panel.run(notice)
    finally:
        notice.close()
        server.stop()


def open_panel(make: MakePanel, server: viser.ViserServer) -> Panel:
    """Return the panel with its first picture, and set the cameras of pages that were opened before the panel set one for all."""
    panel = make(server)
    panel.tick()
    for client in server.get_clients().values():
        camera, wanted = client.camera, server.initial_camera
        with client.atomic():
            if wanted.up is not None:
                camera.up_direction = wanted.up
            camera.position, camera.look_at = wanted.position, wanted.look_at
    return panel
