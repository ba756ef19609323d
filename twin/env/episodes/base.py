"""Base of the environments on a twin: options, drawn twins, own goals, saved states, copies and pickles."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Protocol

import gymnasium
import numpy as np

from twin.env.episodes.domain_randomisation import ParameterSpread, draw_twin, read_spread, twin_arrays, twin_from_arrays
from twin.env.episodes.observation import ObservationLayout
from twin.env.episodes.rendering import FrameRenderer
from twin.env.episodes.validation import parse_options, parse_reset_options, select_arrays
from twin.foundation.errors import DataError, SolveError
from twin.prediction.twin import Twin
from twin.prediction.twin_file.storage import read_twin

MOST_REDRAWS = 20  # of a twin or a goal without equilibrium


class Plant(Protocol):
    """A robot stepped in time, whose state can be saved."""

    def get_state(self) -> dict[str, np.ndarray]: ...

    def set_state(self, state: Mapping[str, np.ndarray]) -> None: ...


class TwinEnv(gymnasium.Env[Any, np.ndarray], ABC):
    """Base of the environments on a twin.

    `copy.deepcopy` and `pickle` give an environment that continues identically; `set_state` continues from what `get_state` saved.
    The episode's robot is built from `_drawn`, a twin and further drawn numbers. `layout` names the observation's parts.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 20}
    options_type: ClassVar[type]
    plant: Any
    layout: ObservationLayout

    def __init__(self, twin: str | Path | Twin, render_mode: str | None, options: Mapping[str, Any]) -> None:
        """Raises UnknownNameError for an unknown option or render mode, DataError for a number that is not above zero."""
        self.options = parse_options(self.options_type, options, render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.described = twin if isinstance(twin, Twin) else read_twin(twin)
        certain = isinstance(twin, Twin) or not self.options.randomise
        self._spread = ParameterSpread() if certain else read_spread(twin, self.described)  # type: ignore[arg-type]
        self._drawn: tuple[Any, ...] = (self.described,)
        self._renderer: FrameRenderer | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode at rest, with a drawn twin and goal, or with the own goal in `options={"goal": ...}`.

        Raises DataError for another option and for a goal that is out of reach, SolveError where no drawn twin has an equilibrium.
        """
        super().reset(seed=seed)
        given = parse_reset_options(options)
        goal = None if given is None else self._check_goal(given)
        for attempt in range(MOST_REDRAWS):
            try:
                self._draw_episode()
                break
            except SolveError as fault:
                if attempt == MOST_REDRAWS - 1:
                    raise SolveError(
                        f"{MOST_REDRAWS} drawn twins in a row have no equilibrium, the last: {fault}; draw less widely"
                    ) from None
        if goal is not None:
            self._place_goal(goal)
        return self._observation(), self._info()

    def close(self) -> None:
        """Close the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def get_state(self) -> dict[str, np.ndarray]:
        """Return the state of the running episode, random numbers included, as arrays by name.

        Raises DataError before the first reset.
        """
        twin, *numbers = self._drawn
        parts = {
            "twin": twin_arrays(twin) | {"numbers": np.array(numbers, float)}, "plant": self.plant.get_state(),
            "episode": self._episode_arrays(),
        }  # fmt: skip
        arrays = {f"{part}.{name}": np.array(a) for part, group in parts.items() for name, a in group.items()}
        return arrays | {"random": _random_array(self.np_random)}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a saved state of an environment with the same twin and options.

        Raises DataError for a state that lacks an array.
        """
        drawn, now = select_arrays(state, "twin"), twin_arrays(self._drawn[0]) | {"numbers": np.array(self._drawn[1:], float)}
        if drawn.keys() != now.keys() or not all(np.array_equal(drawn[name], now[name]) for name in now):
            self._drawn = (twin_from_arrays(self.described, drawn), *drawn["numbers"].tolist())
            self.plant = self._build_plant()
        self.plant.set_state(select_arrays(state, "plant"))
        self._restore_episode(select_arrays(state, "episode"))
        self.np_random = _random_generator(state["random"])

    def __getstate__(self) -> dict[str, Any]:
        kept = {name: value for name, value in vars(self).items() if name not in ("plant", "_renderer")}
        return kept | {"plant": self.plant.get_state()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _renderer=None)
        self.plant = self._build_plant()
        self.plant.set_state(state["plant"])

    def _draw_twin(self) -> Twin:
        """Draw an episode's twin."""
        return draw_twin(self.described, self._spread, self.options.ranges, self.np_random)

    @abstractmethod
    def _draw_episode(self) -> None:
        """Draw an episode and start it at rest. Raises SolveError where the twin or the goal has no equilibrium."""

    @abstractmethod
    def _build_plant(self) -> Plant:
        """Build the robot of `_drawn`, at rest. Raises SolveError where it has no equilibrium."""

    def _check_goal(self, given: Any) -> np.ndarray:
        """Return an own goal as an array. Raises DataError where it is misshaped or out of reach."""
        raise DataError("a goal came, but this task has none to choose: its things are drawn; reset without options")

    def _place_goal(self, goal: np.ndarray) -> None:
        """Set a goal that `_check_goal` returned as the episode's."""
        raise NotImplementedError

    def _achieved(self) -> np.ndarray:
        """Return what of the goal is true now, (d,), in the observation's units."""
        raise NotImplementedError

    def _desired(self) -> np.ndarray:
        """Return the goal (d,), in the observation's units."""
        raise NotImplementedError

    def _goal_reward(self, achieved: np.ndarray, desired: np.ndarray) -> np.ndarray:
        """Return the reward (...) of what was achieved (..., d) where that (..., d) was desired."""
        raise NotImplementedError

    def _observation(self) -> Any:
        """Return the observation now."""
        return self.layout.join(self._observation_parts(), self.layout.parts)

    @abstractmethod
    def _observation_parts(self) -> dict[str, np.ndarray]:
        """Return the observation's parts now, by name."""

    @abstractmethod
    def _info(self) -> dict[str, Any]:
        """Return the info now."""

    @abstractmethod
    def _episode_arrays(self) -> dict[str, np.ndarray]:
        """Return what an episode keeps beside its plant, by name. Raises DataError before the first reset."""

    @abstractmethod
    def _restore_episode(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Restore what `_episode_arrays` returned."""


def refuse_before_reset(env: TwinEnv, attribute: str) -> None:
    """Raise DataError for an environment without this attribute of an episode."""
    if not hasattr(env, attribute):
        raise DataError("no episode has begun: reset the environment before its state is saved")


def _random_array(rng: np.random.Generator) -> np.ndarray:
    """Return the state of a PCG64 generator as (6,) integers of 64 bits."""
    s = rng.bit_generator.state
    words = [half for name in ("state", "inc") for half in divmod(s["state"][name], 2**64)]
    return np.array([*words, s["has_uint32"], s["uinteger"]], np.uint64)


def _random_generator(words: np.ndarray) -> np.random.Generator:
    """Return the generator of such a state."""
    a, b, c, d, has_uint32, uinteger = (int(w) for w in words)
    bits = np.random.PCG64()
    bits.state = {
        "bit_generator": "PCG64", "state": {"state": (a << 64) + b, "inc": (c << 64) + d}, "has_uint32": has_uint32,
        "uinteger": uinteger,
    }  # fmt: skip
    return np.random.Generator(bits)
