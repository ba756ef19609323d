"""Check options, actions and own goals of an environment: unknown options are refused, actions clipped or refused."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

import gymnasium
import numpy as np

from twin.foundation.errors import DataError, UnknownNameError

OptionsT = TypeVar("OptionsT")
OBSERVATION_MODES = ("sensors", "full")


def parse_options(kind: type[OptionsT], given: Mapping[str, Any], render_mode: str | None, modes: Sequence[str]) -> OptionsT:
    """Return the options as a dataclass.

    Raises UnknownNameError for an unknown option or render mode, DataError for a number that is not above zero.
    """
    known = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    for name in given:
        if name not in known:
            raise UnknownNameError("option", name, [*known, "twin", "render_mode"])
    if render_mode not in (None, *modes):
        raise UnknownNameError("render_mode", str(render_mode), modes)
    options = kind(**given)
    observe = getattr(options, "observe", "sensors")
    if observe not in OBSERVATION_MODES:
        raise UnknownNameError("observe", str(observe), OBSERVATION_MODES)
    for name in ("interval", "rate", "most"):
        value = getattr(options, name, 1.0)
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise DataError(f"option {name} = {value!r}; a number above zero is needed")
    return options


class ActionBounds:
    """Bounds of n actions in [-1, 1]."""

    def __init__(self, n: int) -> None:
        self.n, self._warned = n, False

    def clip(self, action: np.ndarray) -> np.ndarray:
        """Return the action (n,) within the bounds, with one warning for the first that is not.

        Raises DataError for an action that is not n finite numbers.
        """
        values = np.asarray(action, float)
        if values.shape != (self.n,):
            raise DataError(f"an action of shape {values.shape} came; ({self.n},) is needed")
        if not np.isfinite(values).all():
            k = int(np.flatnonzero(~np.isfinite(values))[0])
            raise DataError(f"action {k} is {values[k]}: a finite number in [-1, 1] is needed")
        if np.abs(values).max() > 1.0 and not self._warned:
            self._warned = True
            k = int(np.argmax(np.abs(values)))
            gymnasium.logger.warn(f"action {k} is {values[k]:g}: actions are clipped to [-1, 1] (said once)")
        return np.clip(values, -1.0, 1.0)


def parse_reset_options(given: Mapping[str, Any] | None) -> Any | None:
    """Return the own goal in the options of a reset, or None without one. Raises DataError for another option."""
    others = ", ".join(repr(name) for name in given or {} if name != "goal")
    if others:
        raise DataError(f"reset options {others} came; reset takes 'goal' only, give other options when the environment is made")
    return None if given is None else given.get("goal")


def parse_goal(given: Any, shape: tuple[int, ...], words: str) -> np.ndarray:
    """Return an own goal as finite numbers; -1 in `shape` stands for any number of rows, and `words` for what they are.

    Raises DataError for a goal of another shape and one that is not finite.
    """
    try:
        goal = np.asarray(given, float)
    except (TypeError, ValueError):
        raise DataError(f"the goal {given!r} came; {words} is needed, in numbers") from None
    fits = goal.ndim == len(shape) and all(want in (-1, have) for want, have in zip(shape, goal.shape, strict=True))
    if not fits or not goal.size:
        raise DataError(f"a goal of shape {goal.shape} came; {words} is needed")
    if not np.isfinite(goal).all():
        raise DataError(f"the goal {goal.tolist()} is not finite; {words} is needed")
    return goal


def select_arrays(state: Mapping[str, np.ndarray], part: str) -> dict[str, np.ndarray]:
    """Return the arrays of one part of a saved state. Raises DataError where there are none."""
    found = {name.partition(".")[2]: a for name, a in state.items() if name.partition(".")[0] == part}
    if not found:
        raise DataError(f"the state has no arrays of {part!r}; give one that get_state returned")
    return found
