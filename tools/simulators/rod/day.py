"""From a seed to a measurement set on disk; the same arguments give the same bytes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import UseAppendAction, arg

from tools.simulators.rod.amplitude import Scale, scaled
from tools.simulators.rod.bench import run
from tools.simulators.rod.design import BENCH_DESIGNS, bench_day
from tools.simulators.rod.effects import Effect, all_effects
from tools.simulators.rod.nuisance import built
from tools.simulators.rod.sensors import Noise
from tools.simulators.rod.write import write_set, write_truth

MISMATCH = {"exact": 0.0, "built": 1.0, "rough": 1.5}  # how far the robot is from its description, in tolerances
UNNAMED = {"soft_spot": 0.15, "helix": 0.05}  # what a rough robot has besides, that no parameter spans: some 0.1 sigma together


@dataclass(frozen=True)
class Recipe:
    """What a measurement set is made of; the same recipe gives the same bytes."""

    effects: Annotated[UseAppendAction[tuple[str, ...]], arg(name="effect")] = ()  # may be repeated
    amplitude: float = 3.0  # sigmas left by each effect, after refitting
    seed: int = 0
    design: str = "default"  # of BENCH_DESIGNS
    displacement: bool = False  # also log tendon displacements
    ambient: bool = False  # also log the ambient temperature
    coloured: bool = False  # marker noise AR(1) 0.4 with Student-t tails, 5 degrees
    mismatch: str = "built"  # how far the robot is from its description: exact, built or rough

    def __post_init__(self) -> None:
        """Raise ValueError for a name that is not known."""
        for names, known in ((self.effects, all_effects()), ((self.design,), BENCH_DESIGNS), ((self.mismatch,), MISMATCH)):
            if other := set(names) - set(known):
                raise ValueError(f"{', '.join(sorted(other))}: not one of {', '.join(known)}")


def make_set(folder: Path, recipe: Recipe, progress: Callable[[str], None] = lambda what: None) -> list[tuple[Effect, float]]:
    """Write the set; return each effect as scaled and the sigmas it leaves."""
    known = all_effects()
    # Streams of their own, so that adding an effect changes neither robot nor day.
    robot, motions, instruments, laws = (np.random.default_rng([recipe.seed, n]) for n in range(4))
    rod = built(robot, spread=MISMATCH[recipe.mismatch])
    day = bench_day(recipe.design, motions)
    noise = Noise.draw(instruments, recipe.coloured)
    found, scale = [], Scale(rod, day, noise)
    for name in recipe.effects:
        progress(f"scaling {name}")
        found.append(scaled(known[name].draw(laws), recipe.amplitude, scale))
    chosen = [effect for effect, _ in found]
    rough = recipe.mismatch == "rough"
    unnamed = [replace(known[n].draw(laws), strength=s) for n, s in UNNAMED.items()] if rough else []
    logs = run(rod, [*chosen, *unnamed], day, lambda done: progress(f"trial {done} of {len(day.trials)}"))
    write_set(
        folder, f"Virtual bench day {recipe.seed}", day, logs, noise, instruments,
        displacement=recipe.displacement or any(e.seen_in == "displacement" for e in chosen),
        ambient=recipe.ambient or any(e.needs_ambient for e in chosen),
        exact_input=any(e.logs_command for e in chosen),
    )  # fmt: skip
    write_truth(folder, {"seed": recipe.seed, "design": recipe.design, "mismatch": recipe.mismatch}, rod, found, noise)
    return found
