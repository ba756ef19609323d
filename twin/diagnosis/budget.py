"""Time for a search: when it is up nothing more is tried, and what was not is said."""

import math
import time


class Budget:
    """Seconds from now in which sets of effects are tried; without end where none are given."""

    def __init__(self, seconds: float | None = None) -> None:
        self.seconds = math.inf if seconds is None else seconds
        self._end = time.monotonic() + self.seconds
        self.untried: list[str] = []

    def allows(self, what: str) -> bool:
        """Whether there is time left to try this; where not it is noted."""
        if time.monotonic() < self._end:
            return True
        if what not in self.untried:
            self.untried.append(what)
        return False

    def words(self) -> tuple[str, ...]:
        """What a reader should know: nothing where all was tried."""
        if not self.untried:
            return ()
        untried = ", ".join(self.untried)
        after = f"the budget of {self.seconds:.3g} s ended the search; not tried: {untried}."
        return (f"{after} The verdict stands on what was tried; more time may find more",)
