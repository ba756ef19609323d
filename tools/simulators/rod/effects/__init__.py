"""What a real bench has and the robot's description has not; laws by where they act, found by their `id`."""

import importlib
import pkgutil

from tools.simulators.rod.effects.effect import Effect, Situation


def all_effects() -> dict[str, type[Effect]]:
    """Every effect by identifier; `in_catalogue` tells whether the twin's catalogue names it."""
    for module in pkgutil.iter_modules(__path__, __name__ + "."):
        importlib.import_module(module.name)
    kinds = (kind for kind in Effect.__subclasses__() if kind.__module__.startswith(__name__))  # not what other benches add
    return {kind.id: kind for kind in sorted(kinds, key=lambda kind: kind.id)}


__all__ = ["Effect", "Situation", "all_effects"]
