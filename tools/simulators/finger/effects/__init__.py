"""What a real finger's bench has and the description has not; laws by where they act, found by their `id`."""

import importlib
import pkgutil

from tools.simulators.finger.effects.effect import Effect


def all_effects() -> dict[str, type[Effect]]:
    """Every effect by identifier; `in_catalogue` tells whether a diagnosis may know it by name."""
    for module in pkgutil.iter_modules(__path__, __name__ + "."):
        importlib.import_module(module.name)
    return {kind.id: kind for kind in sorted(Effect.__subclasses__(), key=lambda kind: kind.id)}


__all__ = ["Effect", "all_effects"]
