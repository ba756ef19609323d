"""The time limit of a search, and what it left untried."""

import math
import time


class Budget:
    """A time limit in seconds from now for trying sets of effects; no limit where none is given."""

    def __init__(self, seconds: float | None = None) -> None:
        self.seconds = math.inf if seconds is None else seconds
        self._end = time.monotonic() + self.seconds
        self.untried: list[str] = []

    def allows(self, what: str) -> bool:
        """Return whether time is left to try `what`; note it as untried otherwise."""
        if time.monotonic() < self._end:
            return True
        if what not in self.untried:
            self.untried.append(what)
        return False

    def words(self) -> tuple[str, ...]:
        """Return a notice of what was not tried; empty where everything was."""
        if not self.untried:
            return ()
        untried = ", ".join(self.untried)
        after = f"the budget of {self.seconds:.3g} s ended the search; not tried: {untried}."
        return (f"{after} The verdict stands on what was tried; more time may find more",)
