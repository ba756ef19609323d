"""Base class of effects: an immutable physical law with parameters, each with unit, bounds, source and an OFF value.

An effect acts in the following places, in the order of the signal. It has no state; state is passed in and returned.

    command   reported input -> true input      (a load cell that misreads: the inverse of its `sense`)
    drive     command -> delivered command      (lag, saturation, play)
    edit      the body                          (stiffness, rest shape, routing)
    soften    temperature, time -> stiffness
    surround  the loads on the body             (gravity, payload, a wall)
    route     along the tendon                  (friction, stretch)
    spring    the SMA springs that pull         (heat loss, phase change)
    deform    slow change of the rest shape     (creep)
    sense     true output -> reported output    (frame, delay, drift)

An effect that acts in `sense` only needs no new simulation: it is applied to the existing prediction.

In an exported MJCF (`twin.prediction.mjcf`) effects that act in `edit` and `surround` are numbers of the model, friction is known
from `route`, and readings go through `sense`. One that acts in `command` or `drive` says how by `write` and `by_step`.
"""

from __future__ import annotations

import re
from abc import ABC
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import ClassVar

import mujoco
import numpy as np

from twin.body import Body, Creep, Loads, Route, Signals
from twin.body.drives.counts import joint_names
from twin.body.drives.spring import Spring
from twin.foundation.errors import TwinError
from twin.foundation.parameters import Parameter, Values, fill_defaults


class DataNeed(StrEnum):
    """What the trials of an experiment need, so that an effect shows and is not taken for another."""

    REVERSALS = "loading and unloading"
    TWO_RATES = "two rates of pull, ten times apart"
    LONG_HOLDS = "holds of a minute"
    TWO_LOADS = "two payloads, or two mounts"
    EVERY_TENDON = "pulls of every tendon, alone and together"
    THREE_MARKERS = "three markers along the body"
    DISPLACEMENTS = "tendon displacements"
    TEMPERATURES = "a logged room temperature that varies by 2 K or more"
    RANDOM_ORDER = "a random order of the trials"


@dataclass(frozen=True)
class FitStart:
    """A start of an effect's fit: values, the parameters that are fitted, and the body's features these need in addition."""

    values: Mapping[str, float]
    free: tuple[str, ...]
    needs: frozenset[str] = frozenset()


def each_then_all(single: Sequence[Mapping[str, float]]) -> Iterator[FitStart]:
    """Yield a start with each of these values alone, such as those of one drive; of several, then also one with all of them."""
    for values in (*single, *([{k: v for s in single for k, v in s.items()}] if len(single) > 1 else [])):
        yield FitStart(values, tuple(values))


class Effect(ABC):
    """Base of all effects. A subclass declares its data and overrides the places it acts in; the base's places change nothing.

    `parameters` exist once, `per_tendon` parameters once per tendon or actuator, as name_1, name_2, ..., `per_joint` parameters
    once per joint of an MJCF, as name_JOINT.
    `inactive_when_off`: parameters without meaning while the effect is OFF, such as the time constant of no creep.
    `extended_parameters`: parameters of an extended law, which stay OFF until the plain law is accepted.
    `confusable_with`: effects that look so much like this one that both are never claimed together.
    `needs`: features of a body that the effect acts on (`twin.body.Body.features`); `extended_needs` those of its extended law.
    `guesses`: values from which fits start. `moves_with`: the quantity that the effect varies with, in words.
    `plot_against`: the kind of variable that shows it in a plot (`twin.report.plots.variables`): azimuth, clock, elapsed, loop,
    payload, position, rate, reach, temperature, tension or torque.
    `hidden_without`: what an experiment needs, or the effect is hidden or taken for another.
    """

    id: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    per_tendon: ClassVar[tuple[Parameter, ...]] = ()
    per_joint: ClassVar[tuple[Parameter, ...]] = ()
    inactive_when_off: ClassVar[tuple[str, ...]] = ()
    extended_parameters: ClassVar[tuple[str, ...]] = ()
    confusable_with: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[frozenset[str]] = frozenset()
    extended_needs: ClassVar[frozenset[str]] = frozenset()
    guesses: ClassVar[tuple[Values, ...]] = ()
    moves_with: ClassVar[str]
    plot_against: ClassVar[str] = "tension"
    hidden_without: ClassVar[frozenset[DataNeed]] = frozenset()

    def __init__(self, values: Values | None = None, n_tendon: int | None = None, **named: float) -> None:
        """Make the effect with these values; the others are those of the reference robot (see `scaled_effect` for other sizes).

        Without `n_tendon` the names given tell the number of tendons: bias_1, ..., bias_4 mean four. Raises TwinError for an
        unknown parameter, a value that no robot has, and if nothing tells the number of tendons of per-tendon parameters.
        """
        given = {**(values or {}), **named}
        self.n_tendon = self._infer_n_tendon(given) if n_tendon is None else n_tendon
        try:
            declared = [p.without_size_bounds for p in self.all_parameters(self.n_tendon)]
            self.values: dict[str, float] = fill_defaults(declared, given)
        except TwinError as error:
            raise TwinError(f"effect {self.id}: {error}") from None

    @classmethod
    def depends_on_tendons(cls) -> bool:
        """Return whether the effect has parameters per tendon."""
        return len(cls.all_parameters(3)) > len(cls.all_parameters(1))

    @classmethod
    def _infer_n_tendon(cls, names: Collection[str]) -> int:
        if not cls.depends_on_tendons():
            return 1
        indices = [int(index) for name in names for index in re.findall(r"_(\d{1,2})(?!\d)", name)]
        if not indices:
            raise TwinError(f"effect {cls.id} has parameters for each tendon: give the number of tendons, such as n_tendon=3")
        n = max(indices)
        # Where the last spring's parameters follow from the others', name_i needs i + 1 springs.
        return n + 1 if set(names) & ({p.name for p in cls.all_parameters(n + 1)} - {p.name for p in cls.all_parameters(n)}) else n

    @classmethod
    def all_parameters(cls, n_tendon: int) -> tuple[Parameter, ...]:
        """Return all parameters, with those per tendon as name_1, name_2, ..."""
        many = (replace(p, name=f"{p.name}_{i}") for i in range(1, n_tendon + 1) for p in cls.per_tendon)
        joints = (replace(p, name=f"{p.name}_{joint}") for joint in joint_names(n_tendon) for p in cls.per_joint)
        return (*cls.parameters, *many, *joints)

    @classmethod
    def fit_starts(cls, predicted: list[Signals], n_tendon: int) -> Iterator[FitStart]:
        """Yield starts of a fit: each guess; for per-tendon parameters each tendon alone and all, with the first parameter and all.

        `predicted` is the prediction without the effect, for effects whose starts depend on the robot's motion.
        """
        names = tuple(p.name for p in cls.parameters if p.name not in cls.extended_parameters)
        for guess in cls.guesses:
            yield FitStart(guess, names)
        tendons = range(1, n_tendon + 1)
        for kind in (cls.per_tendon[:k] for k in range(1, len(cls.per_tendon) + 1)):
            single = [{f"{p.name}_{i}": p.value + p.step for p in kind} for i in tendons]
            for values in (*single, {k: v for s in single for k, v in s.items()}):
                yield FitStart(values, tuple(values))
        if joints := {f"{p.name}_{j}": p.value + p.step for p in cls.per_joint[:1] for j in joint_names(n_tendon)}:
            yield FitStart(joints, (*joints, *names))

    @classmethod
    def form(cls, free: Collection[str]) -> str:
        """Return which of an effect's several laws has these free parameters; empty for an effect with one law.

        Sets of effects are scored with each form. Starts of the same form lead to the same fit from different values.
        """
        return ""

    def extended_starts(self, predicted: list[Signals]) -> Iterator[FitStart]:
        """Yield starts of the extended law from this fitted plain one; `predicted` is the prediction with the plain law."""
        table = {p.name: p for p in self.all_parameters(self.n_tendon)}
        yield FitStart(
            {n: table[n].value + (0.0 if n in self.inactive_when_off else table[n].step) for n in self.extended_parameters},
            self.extended_parameters,
        )

    def why_implausible(self) -> str:
        """Return why no real effect of this kind has these values, in words; empty if one may."""
        return ""

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def per_tendon_values(self, name: str) -> np.ndarray:
        """Return a per-tendon parameter as an array (n_tendon,)."""
        return np.array([self.values[f"{name}_{i}"] for i in range(1, self.n_tendon + 1)])

    def per_joint_values(self, name: str) -> tuple[float, ...]:
        """Return a per-joint parameter (n_joint,)."""
        return tuple(self.values[f"{name}_{joint}"] for joint in joint_names(self.n_tendon))

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.values == other.values  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash((self.id, tuple(sorted(self.values.items()))))

    def __repr__(self) -> str:
        return f"{self.id}({', '.join(f'{k}={v:.4g}' for k, v in self.values.items())})"

    def acts_in(self, *places: str) -> bool:
        """Return whether the effect overrides any of the named places."""
        return any(getattr(type(self), p) is not getattr(Effect, p) for p in places)

    @property
    def acts_on_robot(self) -> bool:
        """Whether the effect acts on the robot or its drives, not only on reported outputs."""
        return self.acts_in("command", "drive", "edit", "soften", "surround", "route", "spring", "deform")

    # ---- in an MJCF that is stepped -----------------------------------------------------------------------------------

    def write(self, spec: mujoco.MjSpec) -> bool:
        """Write into an MJCF what it can say of a law of commands; return whether that is all of it."""
        return False

    def erase(self, spec: mujoco.MjSpec) -> None:
        """Take out of an MJCF what `write` put there in place of a law that is stepped."""

    def by_step(self, step: float, first: np.ndarray) -> Callable[[np.ndarray], np.ndarray] | None:
        """Return what makes delivered commands (nu,) of those given, one call every `step` s from rest under the `first`.

        None for an effect that does not act on commands, or not in time order.
        """
        return None

    # ---- the places, in the order of the signal -----------------------------------------------------------------------

    def command(self, reported: Signals) -> Signals:
        """Return the true inputs from the reported ones."""
        return reported

    def drive(self, command: Signals) -> Signals:
        """Return what the drives deliver for a command."""
        return command

    def edit(self, body: Body) -> None:
        """Change the body before it is compiled."""

    def soften(self, temperature: np.ndarray, clock: np.ndarray) -> np.ndarray | float:
        """Return the body's stiffness over the described one, at `temperature` (n,) K and `clock` (n,) s since the first trial."""
        return 1.0

    def surround(self, loads: Loads) -> Loads:
        """Return the loads that act on the body."""
        return loads

    def route(self) -> Route:
        """Return the tendons' properties that the effect adds."""
        return Route()

    def spring(self, spring: Spring) -> Spring:
        """Return the SMA springs that pull."""
        return spring

    def deform(self) -> Creep:
        """Return the creep elements that the effect adds."""
        return Creep()

    def sense(self, true: Signals) -> Signals:
        """Return the reported signals from the true ones."""
        return true
