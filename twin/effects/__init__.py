"""Effects that a robot's description may lack: one a file, found automatically.

An effect's identifier is its file's name, and its class has the same name in CamelCase: tendon_friction.py has TendonFriction. A
new file is in the catalogue, in the fits, in the reports and under test; there is no list to edit.

>>> from twin.effects import TendonFriction, effect_class
>>> TendonFriction(mu=0.2) == effect_class("tendon_friction")(mu=0.2)
True
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import Any

from twin.effects.base.effect import Effect, FitStart
from twin.foundation.errors import UnknownNameError

__all__ = ["Effect", "FitStart", "catalogue", "effect_class"]


@cache
def catalogue() -> dict[str, type[Effect]]:
    """Return all effects by identifier."""
    names = [module.name for module in pkgutil.iter_modules(__path__) if not module.ispkg]
    return {name: getattr(importlib.import_module(f"{__name__}.{name}"), _class_name(name)) for name in names}


def effect_class(identifier: str) -> type[Effect]:
    """Return the effect with this identifier. Raises UnknownNameError, listing those that exist."""
    try:
        return catalogue()[identifier]
    except KeyError:
        raise UnknownNameError("effect", identifier, list(catalogue())) from None


def _class_name(identifier: str) -> str:
    return "".join(word.capitalize() for word in identifier.split("_"))


def __getattr__(name: str) -> Any:
    """Import an effect's class by its name."""
    if name[:1].isupper():
        for identifier, effect in catalogue().items():
            if name == _class_name(identifier):
                return effect
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *map(_class_name, catalogue())])
