"""What a description may lack: one physical law per file, found by itself.

An effect's identifier is its file's name. A new file with a subclass of `Effect` is in the catalogue, in the fit, in the reports
and under test without any list to edit.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from twin.effects.effect import ROPES, Bearing, Creep, Drive, Drives, Effect, Loads, Push, Route, Signals, Start, driven_by
from twin.errors import UnknownNameError

__all__ = [
    "ROPES",
    "Bearing",
    "Creep",
    "Drive",
    "Drives",
    "Effect",
    "Loads",
    "Push",
    "Route",
    "Signals",
    "Start",
    "catalogue",
    "driven_by",
    "named",
]


NO_LAWS = ("effect", "levelling", "similar")  # what laws share


@cache
def catalogue() -> dict[str, type[Effect]]:
    """All laws by identifier."""
    laws = {}
    for module in pkgutil.iter_modules(__path__):
        if module.name in NO_LAWS:
            continue
        members = vars(importlib.import_module(f"{__name__}.{module.name}")).values()
        laws[module.name] = next(m for m in members if isinstance(m, type) and issubclass(m, Effect) and m is not Effect)
    return laws


def named(identifier: str) -> type[Effect]:
    """The law with this identifier. Raises UnknownNameError, listing those that exist."""
    try:
        return catalogue()[identifier]
    except KeyError:
        raise UnknownNameError("effect", identifier, list(catalogue())) from None
