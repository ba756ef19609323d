"""What is asked of an environment and what it is told: unknown options refused, actions clipped or refused."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

import gymnasium
import numpy as np

from twin.errors import DataError, UnknownNameError

Chosen = TypeVar("Chosen")


def chosen(kind: type[Chosen], given: Mapping[str, Any], render_mode: str | None, modes: Sequence[str]) -> Chosen:
    """The options of a dataclass. Raises UnknownNameError for one that is not there, and for a render mode there is not."""
    known = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    for name in given:
        if name not in known:
            raise UnknownNameError("option", name, [*known, "twin", "render_mode"])
    if render_mode not in (None, *modes):
        raise UnknownNameError("render_mode", str(render_mode), modes)
    made = kind(**given)
    observe = getattr(made, "observe", "sensors")
    if observe not in OBSERVED:
        raise UnknownNameError("observe", str(observe), OBSERVED)
    for name in ("interval", "rate", "most"):
        value = getattr(made, name, 1.0)
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise DataError(f"option {name} = {value!r}; a number above zero is needed")
    return made


OBSERVED = ("sensors", "full")


class Actions:
    """n numbers in [-1, 1]."""

    def __init__(self, n: int) -> None:
        self.n, self._warned = n, False

    def checked(self, action: np.ndarray) -> np.ndarray:
        """(n,) within the bounds; the first that is not is said, once. Raises DataError for what is not n finite numbers."""
        rate = np.asarray(action, float)
        if rate.shape != (self.n,):
            raise DataError(f"an action of shape {rate.shape} came; ({self.n},) is needed")
        if not np.isfinite(rate).all():
            k = int(np.flatnonzero(~np.isfinite(rate))[0])
            raise DataError(f"action {k} is {rate[k]}: a finite number in [-1, 1] is needed")
        if np.abs(rate).max() > 1.0 and not self._warned:
            self._warned = True
            k = int(np.argmax(np.abs(rate)))
            gymnasium.logger.warn(f"action {k} is {rate[k]:g}: actions are clipped to [-1, 1] (said once)")
        return np.clip(rate, -1.0, 1.0)
