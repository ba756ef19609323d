"""Demonstrations by hand: a person's pushes on fingers whose tendons are slack, recorded as a bench would record them.

Every attempt has its own random stream, by the seed and its number; attempts are made in order until enough have succeeded. Only
those are kept; what became of all is in `meta/attempts.json`. After a stop the same order goes on where it was, to the same files.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from twin.errors import DataError
from twin.learn import lerobot
from twin.learn.hands import Eye, aligned, built, fingers
from twin.learn.kept import EVERY, FPS, SHOWN, Kept, Told, file_of, keep
from twin.robots import Robot
from twin.soft import HandBody
from twin.tasks import Outcome, Person, Task, Trial

FORMAT = "twin-demonstrations/1"
ATTEMPTS = Path("meta/attempts.json")
RESISTANCE, ENCODER = 0.3, 1e-5  # ohm, m: noise of a reading, as in the finger's samples
HOPELESS = 20  # attempts a demonstration that is wanted


@dataclass(frozen=True)
class Order:
    """`n` demonstrations of a task on the hand that `seed` builds."""

    task: Task
    robot: Robot
    n: int
    seed: int

    def manifest(self) -> dict[str, Any]:
        return {"format": FORMAT, "task": self.task.name(), "robot": self.robot.name, "n": self.n, "seed": self.seed}


class Attempt(NamedTuple):
    """What became of it, its frames (every column (n, width)), and what is kept to be looked at."""

    outcome: Outcome
    frames: dict[str, np.ndarray]
    kept: Kept


def stream(seed: int, attempt: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2, attempt)))


def body_of(robot: Robot, values: dict[str, float]) -> HandBody:
    return robot.hand(robot.build(values))


def demonstrate(order: Order, folder: Path, jobs: int, progress: Callable[[str], None] = lambda words: None) -> Counter[Outcome]:
    """Make what is missing of an order in `folder`; what became of all attempts. Raises DataError for a folder with another order
    and where hardly any attempt succeeds."""
    outcomes = _begin(order, folder)
    values = built(order.robot, order.seed)
    body_of(order.robot, values)
    while (kept := outcomes.count(Outcome.SUCCESS)) < order.n:
        if len(outcomes) >= HOPELESS * order.n:
            raise DataError(f"{kept} of {len(outcomes)} attempts at {order.task.name()!r} succeeded; this task cannot be shown so")
        batch = range(len(outcomes), len(outcomes) + min(jobs, order.n - kept))
        made = cast("list[Attempt]", Parallel(n_jobs=jobs, prefer="threads")(delayed(_attempt)(order, values, i) for i in batch))
        for one in made:
            if one.outcome is Outcome.SUCCESS:
                index = outcomes.count(Outcome.SUCCESS)
                lerobot.write_episode(folder, index, one.frames, FPS)
                shown = replace(one.kept, told=replace(one.kept.told, number=index))
                keep(file_of(folder, SHOWN, index), shown)
            outcomes.append(one.outcome)
            write_json(folder / ATTEMPTS, order.manifest() | {"outcomes": outcomes})
        progress(f"{outcomes.count(Outcome.SUCCESS)} of {order.n}, {len(outcomes)} attempts")
    lerobot.write_meta(folder, f"{order.task.name()}: {order.task.about}", order.robot.name, FPS)
    return Counter(outcomes)


def read(folder: Path) -> dict[str, Any]:
    """The order that a folder of demonstrations was made to. Raises DataError where it is none or not whole."""
    try:
        there = json.loads((folder / ATTEMPTS).read_text("utf-8"))
    except (OSError, ValueError):
        raise DataError(f"{folder} holds no demonstrations; make them with twin demonstrate TASK --out {folder}") from None
    if there.get("format") != FORMAT or there["outcomes"].count(Outcome.SUCCESS) < there["n"]:
        raise DataError(f"{folder}: its demonstrations are not whole; run the same twin demonstrate again to go on")
    return there


def write_json(path: Path, content: Any) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    part.replace(path)


def _begin(order: Order, folder: Path) -> list[Outcome]:
    path = folder / ATTEMPTS
    if path.exists():
        try:
            there = json.loads(path.read_text("utf-8"))
            outcomes = [Outcome(o) for o in there.pop("outcomes")]
        except (OSError, ValueError, KeyError):
            there, outcomes = None, []
        if there != order.manifest():
            raise DataError(f"{folder} holds other demonstrations; give a new folder with --out, or ask for the same to go on")
        return outcomes
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DataError(f"{folder} is there already and holds no demonstrations; give a new folder with --out")
    return []


def _attempt(order: Order, values: dict[str, float], i: int) -> Attempt:
    robot, rng = order.robot, stream(order.seed, i)
    eye = Eye(fingers(robot, aligned(robot, values, order.seed)))
    with threadpool_limits(limits=1):
        trial = Trial(order.task, body_of(robot, values), robot.gravity, rng)
        person = Person.draw(rng, len(trial.start.nodes), order.task.strength)
        rows: dict[str, list[np.ndarray]] = {name: [] for name in ("resistance", "encoder", "state", "object")}
        k = 0
        while not trial.over:
            if k % EVERY == 0:
                seen = trial.seen
                felt = read_bench(seen.resistance, RESISTANCE, rng), read_bench(seen.shortening, ENCODER, rng)
                pose = np.concatenate([seen.place[0], seen.turn[0]])
                for name, value in zip(rows, (*felt, eye.look(*felt), pose), strict=True):
                    rows[name].append(value.ravel())
            trial.push(person)
            k += 1
    state = np.stack(rows["state"])
    action = np.vstack([np.diff(state, axis=0), np.zeros((1, state.shape[1]))])
    columns = {f"observation.{name}": np.stack(rows[name]) for name in ("state", "resistance", "encoder")}
    columns |= {"action": action, "object.pose": np.stack(rows["object"])}
    told = Told(order.task.name(), robot.name, order.seed, SHOWN, i)
    return Attempt(trial.outcome(), columns, Kept.of(trial, told))


def read_bench(true: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
    """A reading of what is true."""
    return true + noise * rng.normal(size=true.shape)
