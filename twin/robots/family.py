"""Families of bodies: modules that build bodies from a `robot.toml` and provide their solvers."""

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Protocol, cast

from twin.body import Body, Solver
from twin.body.drawable import Drawable
from twin.body.hinge_chain import HingeChain
from twin.foundation.errors import UnknownNameError
from twin.mechanics.silicone import HandBody, SoftBody
from twin.robots.schema import Schema


class Family(Protocol):
    """The interface of a module of `twin.robots.families`, which is found by the name in `robot.toml`.

    SCHEMA declares what it reads of a file. The others are None for a family without them: `dynamics` simulates motion, `figure`
    draws the body, and `chain`, `silicone` and `hand` return the body as a chain of hinges, as one piece of silicone, and as
    silicone fingers on a palm (`Robot.chain`, ...).
    """

    SCHEMA: Schema
    dynamics: Callable[[Any], Solver] | None
    figure: Callable[[Any], Drawable] | None
    chain: Callable[[Any], HingeChain] | None
    silicone: Callable[[Any], SoftBody] | None
    hand: Callable[[Any], HandBody] | None

    def build(self, structure: Mapping[str, object], values: Mapping[str, float]) -> Body:
        """Build the body from counts and values (SI, by parameter name). Raises DataError if that is impossible."""
        ...

    def statics(self, body: Any) -> Solver:
        """Return the body's static solver."""
        ...


@cache
def family_names() -> tuple[str, ...]:
    """Return the names of all families."""
    package = importlib.import_module("twin.robots.families")
    names = [m.name for m in pkgutil.iter_modules(package.__path__)]
    return tuple(
        n for n in names if {"SCHEMA", "build", "statics"} <= set(vars(importlib.import_module(f"twin.robots.families.{n}")))
    )


def load_family(name: str) -> Family:
    """Return the family called `name`. Raises UnknownNameError, listing those that exist."""
    if name not in family_names():
        raise UnknownNameError("family", name, family_names())
    return cast(Family, importlib.import_module(f"twin.robots.families.{name}"))
