"""Say in the page that something is being compiled or solved, and for how long, while the page stays alive.

The work runs in the thread that called; viser serves the page from its own, and a third counts the seconds.
"""

import threading
import time
from types import TracebackType

import viser

WAITING_PERIOD = 0.25  # s between two looks at the work
SHORTEST_WAIT = 0.7  # s of work before the page says so: sliders are followed faster than that


class WorkNotice:
    """A line of the page that appears while work takes long: `with notice: ...`, one at a time."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Add the line, hidden."""
        self._words = server.gui.add_markdown("", visible=False)
        self._since: float | None = None
        self._over = threading.Event()
        self._counter = threading.Thread(target=self._count, daemon=True, name="twin-view-notice")
        self._counter.start()

    def __enter__(self) -> None:
        self._since = time.monotonic()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._since = None

    def close(self) -> None:
        """End the counting."""
        self._over.set()
        self._counter.join()

    def _count(self) -> None:
        """Write the seconds until closed."""
        while not self._over.wait(WAITING_PERIOD):
            since = self._since
            waited = 0.0 if since is None else time.monotonic() - since
            if waited > SHORTEST_WAIT:
                self._words.content = (
                    f"**compiling and solving, {waited:.0f} s** (the first time takes longest; the page stays alive)"
                )
            if self._words.visible != (waited > SHORTEST_WAIT):
                self._words.visible = waited > SHORTEST_WAIT
