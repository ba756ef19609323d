"""What a family of bodies is: a module here that builds them from a `robot.toml` and says how they are solved."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Protocol, cast

from twin.body import Body, Solver
from twin.errors import UnknownNameError
from twin.figure import Figure
from twin.hinges import HingeChain
from twin.robots.schema import Schema
from twin.soft import HandBody, SoftBody


class Family(Protocol):
    """A module of `twin.robots` with these names is a family, found by the name that `robot.toml` gives.

    SCHEMA: all it reads of a file. What not every body can is None where it cannot: `dynamics` solves it in motion, `figure` draws
    it; `chain`, `silicone` and `hand` give it as that mechanics knows it (a chain of hinges, one piece of silicone, silicone
    fingers on a palm), to those who need more of a body than its solver: `Robot` asks for them.
    """

    SCHEMA: Schema
    dynamics: Callable[[Any], Solver] | None
    figure: Callable[[Any], Figure] | None
    chain: Callable[[Any], HingeChain] | None
    silicone: Callable[[Any], SoftBody] | None
    hand: Callable[[Any], HandBody] | None

    def build(self, structure: Mapping[str, object], values: Mapping[str, float]) -> Body:
        """The robot of these counts and values (SI, by parameter name). Raises DataError for what cannot be built."""
        ...

    def statics(self, body: Any) -> Solver: ...


@cache
def families() -> tuple[str, ...]:
    """Names of the families there are."""
    package = importlib.import_module("twin.robots")
    names = [m.name for m in pkgutil.iter_modules(package.__path__)]
    return tuple(n for n in names if {"SCHEMA", "build", "statics"} <= set(vars(importlib.import_module(f"twin.robots.{n}"))))


def family(name: str) -> Family:
    """The family called `name`. Raises UnknownNameError, listing those that exist."""
    if name not in families():
        raise UnknownNameError("family", name, families())
    return cast(Family, importlib.import_module(f"twin.robots.{name}"))
