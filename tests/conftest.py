"""Bench days from the independent simulator, made once a session."""

from __future__ import annotations

import os

os.environ.setdefault("MUJOCO_GL", "egl")  # before anything imports mujoco, which reads it then

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tools.bench.bench import run
from tools.bench.design import bench_day
from tools.bench.effects import all_effects
from tools.bench.effects.effect import Effect
from tools.bench.nuisance import built
from tools.bench.sensors import Noise
from tools.bench.write import write_set
from twin.measurements import Recording, read

Day = Callable[..., tuple[Recording, Effect | None]]


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Day:
    """bench(effect, strength=2, seed=5, design="hanging", displacement=False) -> (the day as logged, the effect or None); an effect
    by its name, at `strength` times its drawn size, or a law as it is."""

    @cache
    def day(
        effect: str | Effect | None, strength: float = 2.0, seed: int = 5, design: str = "hanging", displacement: bool = False
    ) -> tuple[Recording, Effect | None]:
        robot, motions, instruments, laws = (np.random.default_rng([seed, n]) for n in range(4))
        plan = bench_day(design, motions)
        noise = Noise.draw(instruments, coloured=False)
        truth = replace(all_effects()[effect].draw(laws), strength=strength) if isinstance(effect, str) else effect
        logs = run(built(robot), [] if truth is None else [truth], plan, lambda done: None)
        folder: Path = tmp_path_factory.mktemp("days") / "day"
        write_set(
            folder, f"test day {seed}", plan, logs, noise, instruments,
            displacement=displacement or (truth is not None and truth.seen_in == "displacement"),
            ambient=truth is not None and truth.needs_ambient,
            exact_input=truth is not None and truth.logs_command,
        )  # fmt: skip
        return read(folder), truth

    return day
