"""One training and what became of it: a cell of the table, kept in a file of its own."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import gymnasium

from tools.benchmarks.tasks.policy.bench_reach import BenchReach, robot_of
from tools.benchmarks.tasks.policy.days import EFFECT_DAYS, twin_of
from tools.benchmarks.tasks.policy.inverse import InverseKinematics
from tools.benchmarks.tasks.policy.reach import (
    MOVES,
    SENSORS_SEEN,
    TASK,
    TRAINING_STEPS,
    Act,
    acting,
    distances,
    episodes_of,
    task,
    train,
)

EPISODES, GLANCE = 50, 25  # on the bench and on the own twin at the end; on the own twin while it learns


@dataclass(frozen=True)
class Cell:
    """`effect` of the day whose twin it is; "any" for the described one, the same for all. `seed` None: inverse kinematics."""

    twin: str
    effect: str
    blind: bool
    seed: int | None

    @property
    def file(self) -> str:
        who = "inverse" if self.seed is None else f"seed_{self.seed}"
        return f"{self.effect}-{self.twin}-{'blind' if self.blind else 'camera'}-{who}.json"

    @property
    def days(self) -> tuple[str, ...]:
        return tuple(EFFECT_DAYS) if self.effect == "any" else (self.effect,)


def plan(seeds: int) -> list[Cell]:
    """Inverse kinematics, then seed by seed, so that any first part is a fair sample."""
    twins = [("described", "any"), *((twin, e) for e in EFFECT_DAYS for twin in ("calibrated", "diagnosed", "randomised"))]
    who: list[int | None] = [None, *range(seeds)]
    return [
        Cell(twin, effect, blind, seed)
        for seed in who
        for effect, twin in ((e, t) for t, e in twins)
        for blind in (True, False)
        if not (seed is None and twin == "randomised")
    ]


def run(cell: Cell, out: Path, steps: int = TRAINING_STEPS, episodes: int = EPISODES) -> None:
    """Train, try, and write out/`cell.file` whole; nothing where it is there already."""
    file, source = out / cell.file, twin_of(cell.twin, cell.effect, out / "days")
    if file.is_file():
        return
    curve: list[tuple[int, list[float]]] = []
    if cell.seed is None:
        own, bench = [], {day: _by_inverse(cell, source, day, out, episodes) for day in cell.days}
    else:
        trial = task(source, cell.blind)

        def look(step: int, act: Act) -> None:
            curve.append((step, distances(trial, act, min(GLANCE, episodes))))

        act = acting(train(task(source, cell.blind, cell.twin == "randomised"), cell.seed, steps, look))
        own = distances(trial, act, episodes)
        bench = {day: distances(episodes_of(_bench(cell, source, day, out)), act, episodes) for day in cell.days}
    part = file.with_suffix(".part")
    part.write_text(json.dumps({"cell": vars(cell), "steps": steps, "curve": curve, "own": own, "bench": bench}))
    os.replace(part, file)


def _bench(cell: Cell, source: str, day: str, out: Path) -> BenchReach:
    return BenchReach(robot_of(out / "days" / day), source, sensors=SENSORS_SEEN[cell.blind], **TASK)


def _by_inverse(cell: Cell, source: str, day: str, out: Path, episodes: int) -> list[float]:
    env = _bench(cell, source, day, out)
    controller = InverseKinematics(env)
    return distances(gymnasium.wrappers.TimeLimit(env, MOVES), controller.act, episodes, controller.begin)
