"""From a seed to a measurement set on disk; the same arguments give the same bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tools.bench.amplitude import Scale, scaled
from tools.bench.bench import run
from tools.bench.design import Trial, bench_day
from tools.bench.effects import Effect, all_effects
from tools.bench.nuisance import built
from tools.bench.sensors import Noise
from tools.bench.write import write_set, write_truth

MISMATCH = {"exact": 0.0, "built": 1.0, "rough": 1.5}  # how far the robot is from its description, in tolerances
UNNAMED = {"soft_spot": 0.15, "helix": 0.05}  # what a rough robot has besides, that no parameter spans: some 0.1 sigma together


def make_set(
    folder: Path,
    effects: Sequence[str],
    amplitude: float = 3.0,  # sigmas left by each effect
    seed: int = 0,
    design: str = "default",
    *,
    displacement: bool = False,
    ambient: bool = False,
    coloured: bool = False,
    mismatch: str = "built",
    more: Sequence[Trial] = (),
    progress: Callable[[str], None] = lambda what: None,
) -> list[tuple[Effect, float]]:
    """Write the set; returns each effect as scaled and the sigmas it leaves. `mismatch` is one of MISMATCH; `more` trials are
    run when the day is over."""
    known = all_effects()
    # Streams of their own, so that adding an effect changes neither robot nor day.
    robot, motions, instruments, laws = (np.random.default_rng([seed, n]) for n in range(4))
    rod = built(robot, spread=MISMATCH[mismatch])
    day = bench_day(design, motions)
    noise = Noise.draw(instruments, coloured)
    found, scale = [], Scale(rod, day, noise)
    for name in effects:
        progress(f"scaling {name}")
        found.append(scaled(known[name].draw(laws), amplitude, scale))
    day = replace(day, trials=(*day.trials, *more))
    chosen = [effect for effect, _ in found]
    unnamed = [replace(known[n].draw(laws), strength=s) for n, s in UNNAMED.items()] if mismatch == "rough" else []
    logs = run(rod, [*chosen, *unnamed], day, lambda done: progress(f"trial {done} of {len(day.trials)}"))
    title = f"Virtual bench day {seed}"
    write_set(
        folder,
        title,
        day,
        logs,
        noise,
        instruments,
        displacement=displacement or any(e.seen_in == "displacement" for e in chosen),
        ambient=ambient or any(e.needs_ambient for e in chosen),
        exact_input=any(e.logs_command for e in chosen),
    )
    write_truth(folder, seed, design, rod, found, noise, mismatch)
    return found
